"""Point at a choice on a board: with a tracked hand, or with the head where no hand is tracked."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from lab.geometry import Pose, Vector, quat_conjugate, rotate
from protocol.steps import FrameView
from stage.panel_image import choice_boxes_01
from stimuli.picture import Panel

HAND: Final = "right_hand"
ALONG_FINGERS: Final = np.array([1.0, 0.0, 0.0])
"""Of a right hand in the frame that trackers of bodies use: with the arm held out, to the right."""
AHEAD: Final = np.array([0.0, 0.0, -1.0])
REACH_01: Final = 0.04
"""How far beside a button still counts, of the board's width."""


@dataclass(frozen=True, eq=False)
class Ray:
    """From where and along which −z somebody points; `is_hand` tells what with."""

    pose: Pose
    is_hand: bool


def newer_ray(before: Ray | None, view: FrameView) -> Ray | None:
    """Return how the participant points now; a hand once tracked is not replaced by the head."""
    body = view.body
    if body is not None and HAND in body.segments:
        k = body.segments.index(HAND)
        if body.valid[-1, k]:
            turn = body.orientation_wxyz[-1, k]
            towards = turn_towards(rotate(turn, ALONG_FINGERS))
            return Ray(Pose(body.position_m[-1, k], towards), is_hand=True)
    if before is not None and before.is_hand:
        return before
    return Ray(view.head, is_hand=False) if view.head_valid else before


def turn_towards(direction: Vector) -> Vector:
    """Return some turn (4,) that leads −z to a unit direction (3,)."""
    axis = np.cross(AHEAD, direction)
    found = np.array([1.0 + float(AHEAD @ direction), *axis])
    length = float(np.linalg.norm(found))
    return np.array([0.0, 0.0, 1.0, 0.0]) if length < 1e-9 else found / length


def chosen_by(ray: Pose | None, panel: Panel) -> int | None:
    """Return which choice a ray meets, None for none."""
    if ray is None:
        return None
    inverse = quat_conjugate(panel.pose.orientation_wxyz)
    origin = rotate(inverse, ray.position_m - panel.pose.position_m)
    along = rotate(inverse, rotate(ray.orientation_wxyz, AHEAD))
    if not (origin[2] > 0 > along[2]):
        return None
    met = origin + along * (-origin[2] / along[2])
    across, down = met[0] / panel.size_m[0] + 0.5, 0.5 - met[1] / panel.size_m[1]
    boxes = choice_boxes_01(panel)
    inside = (
        (boxes[:, 0] <= across)
        & (across <= boxes[:, 2])
        & (boxes[:, 1] - REACH_01 <= down)
        & (down <= boxes[:, 3] + REACH_01)
    )
    hits: npt.NDArray[np.int64] = np.flatnonzero(inside)
    return int(hits[0]) if hits.size else None


def middle_of(panel: Panel, choice: int) -> Vector:
    """Return the middle (3,) of a choice in world."""
    left, top, right, bottom = choice_boxes_01(panel)[choice]
    width, height = panel.size_m
    own = np.array([((left + right) / 2 - 0.5) * width, (0.5 - (top + bottom) / 2) * height, 0.0])
    middle: Vector = panel.pose.position_m + rotate(panel.pose.orientation_wxyz, own)
    return middle
