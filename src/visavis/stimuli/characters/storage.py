"""Characters as single compressed files: quantised arrays, packed textures and a head of JSON."""

import io
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.plain_files import parse_json, read_arrays
from visavis.stimuli.characters.character import (
    BodyCapsule,
    Character,
    Eyeball,
    Maps,
    Material,
    Morph,
    SkinnedMesh,
)
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.motion.skeleton import Skeleton

FIGURE_FILES = (".glb", ".vrm", ".fbx")
"""Files that figures are imported from."""
FORMAT = 3
_READ = (2, 3)
"""Formats that can be read; format 2 had no maps and one picture per material."""
_STEP_M = 1 / 16384  # 0.06 mm; int16 reaches 2 m either way
_MORPH_STEP_M = 1 / 262144
_UV_STEP = 1 / 2048  # int16 reaches ±16 repeats of a cloth's texture


def _pack_mesh(mesh: SkinnedMesh, key: str) -> dict[str, npt.NDArray[Any]]:
    wide = len(mesh.vertices_m) > 65535
    arrays: dict[str, npt.NDArray[Any]] = {
        "vertices": np.round(mesh.vertices_m / _STEP_M).astype(np.int16),
        "normals": np.round(mesh.normals * 127).astype(np.int8),
        "colour": mesh.colour_srgb,
        "joints": mesh.joints,
        "weights": np.round(mesh.weights * 255).astype(np.uint8),
        "triangles": mesh.triangles.astype(np.uint32 if wide else np.uint16),
        "part": mesh.triangle_part,
        "material": mesh.triangle_material,
    }
    if mesh.uv is not None:
        arrays["uv"] = np.round(mesh.uv / _UV_STEP).astype(np.int16)
    for name, morph in mesh.morphs.items():
        arrays[f"morph_{name}_v"] = morph.vertices
        arrays[f"morph_{name}_d"] = np.round(morph.delta_m / _MORPH_STEP_M).astype(np.int16)
    return {f"{key}_{name}": array for name, array in arrays.items()}


def _unpack_mesh(arrays: Mapping[str, npt.NDArray[Any]], key: str) -> SkinnedMesh:
    def get(name: str) -> npt.NDArray[Any]:
        return arrays[f"{key}_{name}"]

    normals = get("normals").astype(np.float32)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    weights = get("weights").astype(np.float32)
    weighing = weights.sum(axis=1, keepdims=True)
    if not ((weighing > 0) & np.isfinite(weighing)).all():
        raise ValueError(f"{key}: a vertex hangs on no joint")
    prefix = f"{key}_morph_"
    morphs = {
        name.removeprefix(prefix)[:-2]: Morph(
            arrays[name], arrays[name[:-1] + "d"].astype(np.float32) * np.float32(_MORPH_STEP_M)
        )
        for name in arrays
        if name.startswith(prefix) and name.endswith("_v")
    }
    uv = get("uv").astype(np.float32) * np.float32(_UV_STEP) if f"{key}_uv" in arrays else None
    return SkinnedMesh(
        vertices_m=get("vertices").astype(np.float32) * np.float32(_STEP_M),
        normals=(normals / np.where(length == 0, 1, length)).astype(np.float32),
        colour_srgb=get("colour"),
        uv=uv,
        joints=get("joints"),
        weights=weights / weighing,
        triangles=get("triangles").astype(np.int32),
        triangle_part=get("part"),
        triangle_material=get("material"),
        morphs=morphs,
    )


def _packed_image(pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    buffer = io.BytesIO()
    image = Image.fromarray(pixels)
    if pixels.shape[2] == 3:
        image.save(buffer, format="JPEG", quality=90, subsampling=0, optimize=True)
    else:
        image.save(buffer, format="PNG", optimize=True)
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)


@dataclass(eq=False)
class _Pictures:
    """Pictures of all materials; one that several share is written once."""

    pictures: list[npt.NDArray[np.uint8]] = field(default_factory=list)

    def of(self, material: Material) -> dict[str, int]:
        """Return the numbers of a material's pictures by what they are."""
        maps = Maps() if material.maps is None else material.maps
        pixels_of = {"colour": material.texture_srgb} | {
            f.name: getattr(maps, f.name) for f in fields(Maps)
        }
        return {name: self._number(p) for name, p in pixels_of.items() if p is not None}

    def _number(self, pixels: npt.NDArray[np.uint8]) -> int:
        for i, picture in enumerate(self.pictures):
            if picture is pixels:
                return i
        self.pictures.append(pixels)
        return len(self.pictures) - 1


def write_character(character: Character, path: Path) -> None:
    """Write a character into one file; positions keep 0.06 mm."""
    pictures = _Pictures()
    head = {
        "format": FORMAT,
        "name": character.name,
        "gender": character.gender,
        "stature_m": character.stature_m,
        "age_years": character.age_years,
        "joints": character.skeleton.names,
        "levels": len(character.levels),
        "measuring": len(character.measuring),
        "materials": [
            {
                "name": m.name,
                "kind": m.kind,
                "roughness_01": m.roughness_01,
                "double_sided": m.double_sided,
                "pictures": pictures.of(m),
            }
            for m in character.materials
        ],
        "capsules": [[c.part, c.joint, c.radius_m] for c in character.capsules],
        "eyeball": None if character.eyeball is None else asdict(character.eyeball),
        "source": character.source,
        "licence": character.licence,
    }
    # The JSON head travels as bytes inside the .npz, so that a character is one file.
    arrays: dict[str, npt.NDArray[Any]] = {
        "head": np.frombuffer(json.dumps(head).encode(), dtype=np.uint8),
        "parents": character.skeleton.parents.astype(np.int16),
        "offsets": character.skeleton.offsets_m.astype(np.float32),
        "tips": character.skeleton.tips_m.astype(np.float32),
        "capsule_ends": np.array(
            [[c.start_m, c.end_m] for c in character.capsules], dtype=np.float32
        ).reshape(-1, 2, 3),
    }
    for i, mesh in enumerate(character.levels):
        arrays |= _pack_mesh(mesh, f"level{i}")
    for i, mesh in enumerate(character.measuring):
        arrays |= _pack_mesh(mesh, f"measuring{i}")
    if character.closed is not None:
        arrays |= _pack_mesh(character.closed, "closed")
    for i, pixels in enumerate(pictures.pictures):
        arrays[f"picture{i}"] = _packed_image(pixels)
    np.savez_compressed(path, allow_pickle=False, **arrays)


def read_character(path: Path) -> Character:
    """Read a character written by `write_character`.

    Raises:
        CharacterError: the file cannot be read or is of another format.
    """
    try:
        arrays = read_arrays(path)
        head = parse_json(arrays["head"].tobytes())
        if head["format"] not in _READ:
            raise CharacterError(
                f"{path}: format {head['format']}, this version reads {FORMAT}; import it again"
            )
        return _character(arrays, head)
    except FileNotFoundError as e:
        raise CharacterError(
            f"{path}: no such character; `visavis character list` names all"
        ) from e
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        Image.DecompressionBombError,
    ) as e:
        raise CharacterError(f"{path}: not a whole character file ({e}); import it again") from e


def _character(arrays: Mapping[str, npt.NDArray[Any]], head: dict[str, Any]) -> Character:
    skeleton = Skeleton(
        tuple(head["joints"]),
        arrays["parents"].astype(np.int64),
        arrays["offsets"].astype(np.float64),
        arrays["tips"].astype(np.float64),
    )
    pictures = {
        name: np.asarray(Image.open(io.BytesIO(png_bytes.tobytes()), formats=("PNG", "JPEG")))
        for name, png_bytes in arrays.items()
        if re.fullmatch(r"(texture|picture)\d+", name)
    }
    materials = []
    for i, entry in enumerate(head["materials"]):
        numbers = entry.pop("pictures", None)
        if numbers is None:
            materials.append(Material(texture_srgb=pictures.get(f"texture{i}"), **entry))
            continue
        material_pictures = {name: pictures[f"picture{number}"] for name, number in numbers.items()}
        colour = material_pictures.pop("colour", None)
        maps = Maps(**material_pictures) if material_pictures else None
        materials.append(Material(texture_srgb=colour, maps=maps, **entry))
    ends = arrays["capsule_ends"].astype(np.float64)
    ball = head["eyeball"]
    return Character(
        name=head["name"],
        gender=head["gender"],
        stature_m=head["stature_m"],
        age_years=head["age_years"],
        skeleton=skeleton,
        levels=tuple(_unpack_mesh(arrays, f"level{i}") for i in range(head["levels"])),
        measuring=tuple(_unpack_mesh(arrays, f"measuring{i}") for i in range(head["measuring"])),
        materials=tuple(materials),
        capsules=tuple(
            BodyCapsule(part, joint, start, end, radius)
            for (part, joint, radius), (start, end) in zip(head["capsules"], ends, strict=True)
        ),
        eyeball=None
        if ball is None
        else Eyeball(**{**ball, "iris_srgb": tuple(ball["iris_srgb"])}),
        source=head["source"],
        licence=head["licence"],
        closed=_unpack_mesh(arrays, "closed") if "closed_vertices" in arrays else None,
    )
