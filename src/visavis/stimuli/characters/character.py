"""One virtual human as plain arrays, ready for any renderer and any collision kernel."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.skeleton import Skeleton

MORPHS: Final[tuple[str, ...]] = (
    "left_blink",
    "right_blink",
    "lids_up",
    "lids_down",
    "jaw_open",
    "smile",
    "frown",
)
"""Shapes of the face; one that lacks a shape keeps it at rest. Everybody should have all but
`frown`, which imported figures with ARKit's shapes have.

`lids_up` and `lids_down` are how the lids look when the eyes turn 30° up or down.
"""

MaterialKind = Literal["skin", "eye", "hair", "lash", "teeth", "cloth", "leather", "other"]


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps of a surface in addition to its colour, as in glTF; (h, w, 3) uint8 each, on the same
    uv.

    `normal` leans the surface (tangent space, y up), `surface` is occlusion, roughness and
    metalness, `glow_srgb` what it sends out itself, `sheen_srgb` the colour of its fibres.
    """

    normal: npt.NDArray[np.uint8] | None = None
    surface: npt.NDArray[np.uint8] | None = None
    glow_srgb: npt.NDArray[np.uint8] | None = None
    sheen_srgb: npt.NDArray[np.uint8] | None = None


@dataclass(frozen=True, eq=False)
class Material:
    """How a surface looks; `texture_srgb` (h, w, 3 or 4) uint8 multiplies the vertex colour.

    One that has `maps` has a picture, too, be it white.
    """

    name: str
    kind: MaterialKind
    roughness_01: float = 0.7
    texture_srgb: npt.NDArray[np.uint8] | None = None
    double_sided: bool = False
    maps: Maps | None = None


@dataclass(frozen=True, eq=False)
class Morph:
    """A shape of the face: displacements (k, 3) in metres of the vertices (k,) that move."""

    vertices: npt.NDArray[np.int32]
    delta_m: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """One level of detail, at rest: the T-pose of the character's skeleton, hips at the origin.

    For v vertices and t triangles: `vertices_m` and `normals` (v, 3), `colour_srgb` (v, 3) uint8,
    `uv` (v, 2) with the origin top left or None, `joints` (v, 4) indices into the skeleton with
    `weights` (v, 4) that sum to 1; `triangles` (t, 3) counter-clockwise from outside,
    `triangle_part` (t,) index into `body_parts.PARTS`, `triangle_material` (t,) index into the
    character's materials.
    """

    vertices_m: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    colour_srgb: npt.NDArray[np.uint8]
    uv: npt.NDArray[np.float32] | None
    joints: npt.NDArray[np.uint8]
    weights: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    triangle_part: npt.NDArray[np.uint8]
    triangle_material: npt.NDArray[np.uint8]
    morphs: Mapping[str, Morph]


@dataclass(frozen=True, eq=False)
class BodyCapsule:
    """A rigid piece of the body: `start_m`, `end_m` (3,) from `joint`, in its axes."""

    part: str
    joint: str
    start_m: Vector
    end_m: Vector
    radius_m: float


@dataclass(frozen=True, eq=False)
class Eyeball:
    """A sphere about its eye joint; the visual axis leaves along −z of that joint at rest."""

    radius_m: float
    iris_radius_m: float
    pupil_radius_m: float
    iris_srgb: tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Character:
    """One person: canonical joint names, own lengths; rest is a T-pose facing −z.

    `levels` go from the most detailed to the lightest; `measuring` are copies, in the same order,
    that body parts are measured on and nobody sees. `stature_m` is crown to sole with shoes as
    worn. `source` and `licence` say where the figure comes from. `closed` is the bare body as one
    closed surface, for measuring volumes; None where it has to be built. A figure without gaze has
    no `eyeball`, and may be neither a woman nor a man.
    """

    name: str
    gender: Literal["female", "male"] | None
    stature_m: float
    age_years: float | None
    skeleton: Skeleton
    levels: tuple[SkinnedMesh, ...]
    measuring: tuple[SkinnedMesh, ...]
    materials: tuple[Material, ...]
    capsules: tuple[BodyCapsule, ...]
    eyeball: Eyeball | None
    source: str
    licence: str
    closed: SkinnedMesh | None = None

    @property
    def has_gaze(self) -> bool:
        """Whether its eyes turn; one without gaze looks nowhere that could be told."""
        return self.eyeball is not None

    @property
    def has_lids(self) -> bool:
        """Whether shapes of its face close both eyes; without gaze many have none."""
        return {"left_blink", "right_blink"} <= set(self.levels[0].morphs)
