"""Panels of text and choices as geometry: their place, their choices, and ray tests."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Pose, Vector, quat_conjugate, quat_from_yaw_pitch_deg, rotate
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame

MARGIN_01 = 0.04
BUTTONS_01 = 0.24
"""Height of the row of choices, of the board's height."""
DISTANCE_M = 1.8
SIZE_M = (1.8, 0.9)


@dataclass(frozen=True, slots=True)
class PanelFrame(SceneFrame):
    """A scene with boards that ask something."""

    panels: tuple[Panel, ...] = ()


def choice_boxes_01(panel: Panel) -> npt.NDArray[np.float64]:
    """Return where the choices lie: (n, 4) left, top, right, bottom of the board, 0 to 1."""
    n = len(panel.choices)
    width, height = panel.size_m
    gap_x = MARGIN_01 * min(width, height) / width
    gap_y = MARGIN_01 * min(width, height) / height
    share = (1.0 - gap_x * (n + 1)) / max(n, 1)
    left = gap_x + np.arange(n) * (share + gap_x)
    boxes = np.empty((n, 4))
    boxes[:, 0], boxes[:, 2] = left, left + share
    boxes[:, 1], boxes[:, 3] = 1.0 - gap_y - BUTTONS_01, 1.0 - gap_y
    return boxes


def choice_met(
    panel: Panel, origin_m: Vector, direction: Vector, *, beside_01: float = 0.0
) -> int | None:
    """Return the choice a ray (both (3,), world) meets from the front; None: none of them.

    `beside_01` above or below a button, of the board's height, still counts.
    """
    back = quat_conjugate(panel.pose.orientation_wxyz)
    start = rotate(back, np.asarray(origin_m, np.float64) - panel.pose.position_m)
    ray = rotate(back, np.asarray(direction, np.float64))
    if not (start[2] > 0.0 and ray[2] < 0.0):
        return None
    x, y, _ = start - ray * (start[2] / ray[2])
    across, down = x / panel.size_m[0] + 0.5, 0.5 - y / panel.size_m[1]
    for i, (left, top, right, bottom) in enumerate(choice_boxes_01(panel).tolist()):
        if left <= across <= right and top - beside_01 <= down <= bottom + beside_01:
            return i
    return None


def choice_centre_m(panel: Panel, choice: int) -> Vector:
    """Return the middle (3,) of a choice in world."""
    left, top, right, bottom = choice_boxes_01(panel)[choice]
    width, height = panel.size_m
    own = np.array([((left + right) / 2 - 0.5) * width, (0.5 - (top + bottom) / 2) * height, 0.0])
    middle: Vector = panel.pose.position_m + rotate(panel.pose.orientation_wxyz, own)
    return middle


def board_pose(head: Pose) -> Pose:
    """Return the pose of a board to be read from this head: upright, straight ahead."""
    forward = rotate(head.orientation_wxyz, np.array([0.0, 0.0, -1.0]))
    yaw_deg = float(np.degrees(np.arctan2(-forward[0], -forward[2])))
    turn = quat_from_yaw_pitch_deg(yaw_deg, 0.0)
    ahead = rotate(turn, np.array([0.0, 0.0, -DISTANCE_M]))
    return Pose(head.position_m + ahead, turn)
