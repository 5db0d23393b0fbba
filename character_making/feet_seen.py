"""Feet as seen from all round: shoes closed, and none seen through the trousers above them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from visavis.stimuli.characters.character import Character, SkinnedMesh
from visavis.stimuli.characters.coverage import seen_tags, view_from
from visavis.stimuli.characters.skinning import skin_of
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.kinds import Idle, Sit, Walk
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import forward

_OUTSIDE, _INSIDE, _TROUSERS = 1, 2, 3
_STEP_M = 0.0015
_LEG_M = 0.35
"""How far above the ankle trousers are looked at."""
_LOOKED_FROM = [(yaw, down) for yaw in range(0, 360, 45) for down in (5.0, 30.0)]
"""Directions in degrees: round the person, and down from level."""
POSES: dict[str, tuple[Idle | Walk | Sit, tuple[float, ...]]] = {
    "stands": (Idle(), (1.0,)),
    "walks": (Walk(), (2.15, 2.6)),
    "sits": (Sit(), (3.0,)),
}
MAX_SEEN_M2 = {0: 10e-6, 1: 45e-6, 2: 300e-6}
"""By level: an edge-on triangle may show its back for a few rays; lighter levels, less than one
pixel where they begin (a face of 24 and of 8.5 pixels)."""


@dataclass(frozen=True)
class _Foot:
    """One foot as seen from one direction: which pixels show what."""

    seen: npt.NDArray[np.uint8]

    def slit_m2(self) -> float:
        """Return what is seen of the inside of a shoe, or of the world through it."""
        shoe = np.isin(self.seen, (_OUTSIDE, _INSIDE))
        through = ndimage.binary_fill_holes(shoe) & (self.seen == 0)
        return float(((self.seen == _INSIDE) | through).sum()) * _STEP_M**2

    def speck_m2(self) -> float:
        """Return what is seen of a shoe with trousers all round."""
        shoe = np.isin(self.seen, (_OUTSIDE, _INSIDE))
        pieces, _ = ndimage.label(shoe, np.ones((3, 3)))
        beside = ndimage.binary_dilation(self.seen == 0, np.ones((3, 3), dtype=bool))
        below = np.unique(pieces[shoe & beside])
        return float((shoe & ~np.isin(pieces, below)).sum()) * _STEP_M**2


def _feet(
    person: Character, mesh: SkinnedMesh, posed_m: npt.NDArray[np.float32]
) -> Iterator[_Foot]:
    """Yield both feet of a posed mesh with their trouser legs, from all directions."""
    names = [material.name for material in person.materials]
    corners = mesh.vertices_m[mesh.triangles]
    ankle_m = person.skeleton.rest_m[person.skeleton.index("left_foot")][1]
    low = corners[..., 1].min(axis=1) < ankle_m + _LEG_M
    shoe = (mesh.triangle_material == names.index("shoe")) & low
    trousers = (mesh.triangle_material == names.index("bottom")) & low
    for side in (-1.0, 1.0):
        mine = (shoe | trousers) & (side * corners[..., 0].mean(axis=1) > 0)
        used, index = np.unique(mesh.triangles[mine], return_inverse=True)
        triangles = index.reshape(-1, 3).astype(np.int32)
        points_m = posed_m[used].astype(np.float64)
        a, b, c = (points_m[triangles[:, k]] for k in range(3))
        facing = np.cross(b - a, c - a)
        for yaw_deg, down_deg in _LOOKED_FROM:
            view = view_from(yaw_deg, down_deg)
            tags = np.where(facing @ view[2] < 0, _OUTSIDE, _INSIDE)
            tags[trousers[mine]] = _TROUSERS
            yield _Foot(seen_tags(points_m, triangles, tags.astype(np.uint8), view, _STEP_M))


def worst_mm2(person: Character, level: int, pose: str) -> tuple[float, float]:
    """Return the largest slit in a shoe and the largest speck of one seen through trousers, in mm²,
    of a person at a level of detail in a pose, over some moments and directions.
    """
    mesh = person.levels[level]
    kind, times_s = POSES[pose]
    motion = PeopleMotion((Person(build_of_character(person), kind, 3),))
    slits, specks = [0.0], [0.0]
    for t in times_s:
        people = motion.at(t)
        placed = forward(person.skeleton, people.root_m[0], people.orientation_wxyz[0])
        for foot in _feet(person, mesh, skin_of(person, placed, level).vertices_m):
            slits.append(1e6 * foot.slit_m2())
            specks.append(1e6 * foot.speck_m2())
    return max(slits), max(specks)


def feet_hold(person: Character, level: int) -> bool:
    """Tell whether a level shows neither the inside of a shoe nor one through trousers."""
    limit_mm2 = 1e6 * MAX_SEEN_M2[level]
    return all(max(worst_mm2(person, level, pose)) < limit_mm2 for pose in POSES)
