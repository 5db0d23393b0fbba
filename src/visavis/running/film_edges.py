"""Refuse films in which a moving body leaves the picture: what people rate must be seen whole."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.stimuli.motion.skeleton import Skeleton, forward
from visavis.stimuli.picture import Camera, Picture

MOVES_M: Final = 0.05
"""A part of a body that is never this far from where it was counts as still; a picture may end
above still feet."""
MARGIN_M: Final = 0.03
"""Flesh around joints, and fingertips beyond the last."""
CROWN_ABOVE_HEAD: Final = 0.11
"""Crown above the joint of the head, as a share of stature."""
CROWN: Final = "crown"


@dataclass(frozen=True)
class CutOff:
    """Part of somebody that moves and leaves the picture: where, and in how many pictures."""

    part: str
    side: str
    pictures: int


def cut_off(pictures: Sequence[Picture], camera: Camera) -> list[CutOff]:
    """Return the moving parts of people that a still camera does not show whole, worst first."""
    if not pictures:
        return []
    parts = []
    for person, character in enumerate(pictures[0].cast):
        names = (*character.skeleton.names, CROWN)
        points = np.stack(
            [
                _points(
                    character.skeleton,
                    character.stature_m,
                    picture.people.root_m[person],
                    picture.people.orientation_wxyz[person],
                )
                for picture in pictures
            ]
        )
        moving = np.ptp(points, axis=0).max(axis=1) > MOVES_M
        for side, outside in _outside(points, camera).items():
            counts = np.where(moving, outside.sum(axis=0), 0)
            parts += [CutOff(names[i], side, int(counts[i])) for i in np.flatnonzero(counts)]
    return sorted(parts, key=lambda part: -part.pictures)


def refuse_cut_off(name: str, pictures: Sequence[Picture], camera: Camera) -> None:
    """Refuse a film by name if a moving part of somebody leaves its picture.

    Raises:
        DesignError: naming the parts, the edge of the picture, and how often.
    """
    parts = cut_off(pictures, camera)
    if not parts:
        return
    worst = ", ".join(
        f"{part.part} {part.side} in {part.pictures} of {len(pictures)} pictures"
        for part in parts[:3]
    )
    more = f" and {len(parts) - 3} more parts" if len(parts) > 3 else ""
    raise DesignError(
        f"the film of {name} cuts off a moving body: {worst}{more}. Give its Lens a larger "
        "half_height_01, or another aim_m; where it is meant, Film(…, may_crop=True)"
    )


def _points(skeleton: Skeleton, stature_m: float, root_m: Vector, local_wxyz: Vector) -> Vector:
    joints = forward(skeleton, root_m, local_wxyz)
    head = skeleton.index("head")
    up = np.array([0.0, CROWN_ABOVE_HEAD * stature_m, 0.0])
    crown = joints.position_m[head] + rotate(joints.orientation_wxyz[head], up)
    points: Vector = np.concatenate([joints.position_m, crown[None]])
    return points


def _outside(points: Vector, camera: Camera) -> dict[str, npt.NDArray[np.bool_]]:
    """Return which points (pictures, parts, 3) are beyond each edge of the picture."""
    at = rotate(quat_conjugate(camera.pose.orientation_wxyz), points - camera.pose.position_m)
    depth = -at[..., 2]
    return {
        "above": at[..., 1] + MARGIN_M > camera.top * depth,
        "below": at[..., 1] - MARGIN_M < camera.bottom * depth,
        "to the left": at[..., 0] - MARGIN_M < camera.left * depth,
        "to the right": at[..., 0] + MARGIN_M > camera.right * depth,
    }
