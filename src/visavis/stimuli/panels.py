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
TEXT_01 = 0.2
"""Height of the text of a board with rows, of the board's height."""
NAMES_01 = 0.52
"""Width of the names of rows, of the board's width; their tracks are on the right."""
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


def row_boxes_01(panel: Panel) -> npt.NDArray[np.float64]:
    """Return where the rows lie: (n, 4) left, top, right, bottom of the board, 0 to 1."""
    end = 1.0 - (BUTTONS_01 + 2 * MARGIN_01 if panel.choices else MARGIN_01)
    edges = np.linspace(TEXT_01, end, len(panel.rows) + 1)
    across = np.full(len(panel.rows), MARGIN_01)
    return np.stack([across, edges[:-1], 1.0 - across, edges[1:]], axis=1)


def track_01(panel: Panel, row: int) -> tuple[float, float, float]:
    """Return where a row's track begins and ends, and how far down it is, on the board, 0 to 1."""
    _, top, right, bottom = row_boxes_01(panel)[row].tolist()
    return NAMES_01, right - MARGIN_01, (top + bottom) / 2


def place_met_01(panel: Panel, origin_m: Vector, direction: Vector) -> tuple[float, float] | None:
    """Return where a ray (both (3,), world) meets the board's plane from the front.

    That is how far across and down the board, 0 to 1 on it; None where it never does.
    """
    back = quat_conjugate(panel.pose.orientation_wxyz)
    start = rotate(back, np.asarray(origin_m, np.float64) - panel.pose.position_m)
    ray = rotate(back, np.asarray(direction, np.float64))
    if not (start[2] > 0.0 and ray[2] < 0.0):
        return None
    x, y, _ = start - ray * (start[2] / ray[2])
    return float(x / panel.size_m[0] + 0.5), float(0.5 - y / panel.size_m[1])


def choice_met(
    panel: Panel, origin_m: Vector, direction: Vector, *, beside_01: float = 0.0
) -> int | None:
    """Return the choice a ray (both (3,), world) meets from the front; None: none of them.

    `beside_01` above or below a button, of the board's height, still counts.
    """
    place = place_met_01(panel, origin_m, direction)
    if place is None:
        return None
    across, down = place
    for i, (left, top, right, bottom) in enumerate(choice_boxes_01(panel).tolist()):
        if left <= across <= right and top - beside_01 <= down <= bottom + beside_01:
            return i
    return None


def choice_centre_m(panel: Panel, choice: int) -> Vector:
    """Return the middle (3,) of a choice in world."""
    left, top, right, bottom = choice_boxes_01(panel)[choice]
    return place_m(panel, (left + right) / 2, (top + bottom) / 2)


def place_m(panel: Panel, across_01: float, down_01: float) -> Vector:
    """Return a place (3,) of the board in world."""
    width, height = panel.size_m
    own = np.array([(across_01 - 0.5) * width, (0.5 - down_01) * height, 0.0])
    place: Vector = panel.pose.position_m + rotate(panel.pose.orientation_wxyz, own)
    return place


def board_pose(head: Pose) -> Pose:
    """Return the pose of a board to be read from this head: upright, straight ahead."""
    forward = rotate(head.orientation_wxyz, np.array([0.0, 0.0, -1.0]))
    yaw_deg = float(np.degrees(np.arctan2(-forward[0], -forward[2])))
    turn = quat_from_yaw_pitch_deg(yaw_deg, 0.0)
    ahead = rotate(turn, np.array([0.0, 0.0, -DISTANCE_M]))
    return Pose(head.position_m + ahead, turn)
