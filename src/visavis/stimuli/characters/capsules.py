"""Capsules round the pieces of a body, fitted to its surface at rest."""

from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.character import BodyCapsule, SkinnedMesh
from visavis.stimuli.motion.skeleton import Skeleton

_TRUNK = (
    ("face", "head", ("face", "scalp", "left_eye", "right_eye")),
    ("neck", "neck", ("neck",)),
    ("torso", "chest", ("torso",)),
    ("pelvis", "hips", ("pelvis",)),
)
_LIMBS = (
    ("upper_arm", "upper_arm"),
    ("forearm", "lower_arm"),
    ("hand", "hand"),
    ("thigh", "upper_leg"),
    ("shin", "lower_leg"),
    ("foot", "foot"),
)
PIECES: Final[tuple[tuple[str, str, tuple[str, ...]], ...]] = (
    *_TRUNK,
    *(
        (f"{side}_{part}", f"{side}_{joint}", (f"{side}_{part}",))
        for side in ("left", "right")
        for part, joint in _LIMBS
    ),
)
"""Part a capsule bears, joint it hangs from, parts it covers."""
OUTSIDE_SHARE = 0.1
"""Share of the surface of a piece that may stick out of its capsules."""


def fit_capsules(skeleton: Skeleton, mesh: SkinnedMesh) -> tuple[BodyCapsule, ...]:
    """Return capsules that hold at least nine tenths of each part's surface.

    Trunk and head, which are wider than deep, get two or three capsules side by side.
    """
    capsules: list[BodyCapsule] = []
    for part, joint, covers in PIECES:
        tags = [PART_INDEX[name] for name in covers]
        corners = np.unique(mesh.triangles[np.isin(mesh.triangle_part, tags)])
        if len(corners) < 8:
            continue
        at = skeleton.rest_m[skeleton.index(joint)]
        points = mesh.vertices_m[corners].astype(np.float64) - at
        # Wide pieces are split into a left and a right half.
        if part == "torso":
            waist = np.quantile(points[:, 1], 0.3)
            above = points[points[:, 1] > waist - 0.02]
            halves = [above[above[:, 0] < 0.01], above[above[:, 0] > -0.01]]
            capsules += [
                _around(some, part, joint) for some in (*halves, points[points[:, 1] < waist])
            ]
        elif part == "pelvis":
            halves = [points[points[:, 0] < 0.01], points[points[:, 0] > -0.01]]
            capsules += [_around(half, part, joint) for half in halves]
        else:
            capsules.append(_around(points, part, joint))
    return tuple(capsules)


def _around(points_m: Vector, part: str, joint: str) -> BodyCapsule:
    """Return the capsule along the longest direction of points that holds nine tenths of them."""
    centre = (points_m.max(axis=0) + points_m.min(axis=0)) / 2
    _, _, axes = np.linalg.svd(points_m - points_m.mean(axis=0), full_matrices=False)
    along = axes[0]
    s = (points_m - centre) @ along
    across = np.linalg.norm(points_m - centre - s[:, None] * along, axis=1)
    radius = float(np.quantile(across, 0.9))
    for _ in range(60):
        low, high = s.min() + radius, s.max() - radius
        if low > high:
            low = high = (low + high) / 2
        start, end = centre + low * along, centre + high * along
        reach = np.linalg.norm(points_m - centre - np.clip(s, low, high)[:, None] * along, axis=1)
        if np.mean(reach > radius) <= OUTSIDE_SHARE / 2:
            break
        radius *= 1.02
    return BodyCapsule(part, joint, start, end, radius)
