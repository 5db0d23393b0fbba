"""Panels of text and choices as geometry: their place, their choices, and ray tests."""

import unicodedata
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, rotate, rotate_one
from visavis.lab.screen import PlacedScreen
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame

MARGIN_01 = 0.04
BUTTONS_01 = 0.24
"""Height of the row of choices, of the board's height."""
TEXT_01 = 0.2
"""Height of the text of a board with rows, of the board's height."""
NAMES_01 = 0.52
"""Width of the names of rows, of the board's width; their tracks are on the right."""
MAX_BUTTONS_01 = 0.58
"""Height of all rows of choices together, of the board's height."""
BELOW_01 = 0.09
"""Height of the words for the ends, and of the hint, of the board's height."""
DISTANCE_M = 1.8
SIZE_M = (1.8, 0.9)
"""Size of a board in a headset: 53° by 28°."""
SHARE_OF_SCREEN = 0.92
"""A board on a screen leaves a margin around it."""
MIN_X_HEIGHT_DEG: Final = 0.4
X_HEIGHT_EM: Final = 0.52
"""Height of an x, and below it the usual width of a character, in sizes of the letters."""
CHARACTER_EM: Final = 0.58
LINE_EM: Final = 1.3
Boxes: TypeAlias = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True, slots=True)
class PanelFrame(SceneFrame):
    """A scene with boards that ask something."""

    panels: tuple[Panel, ...] = ()


@dataclass(frozen=True, eq=False)
class Surface:
    """What participants look at, and what they have to answer with.

    `screen` is the monitor before them, None in a headset; `controls` are those of the response
    device; `rate_hz` is how many frames a second it shows.
    """

    screen: PlacedScreen | None = None
    controls: tuple[str, ...] = ()
    rate_hz: float = 60.0

    @property
    def frame_ns(self) -> int:
        """How long a frame lasts."""
        return round(1e9 / self.rate_hz)

    def keys_of(self, choices: int) -> tuple[str, ...]:
        """Return the keys that take so many choices; () where something points, or none do."""
        digits = tuple(str(n + 1) for n in range(choices))
        is_by_keys = self.screen is not None and set(digits) <= set(self.controls)
        return digits if is_by_keys else ()


IN_HEADSET: Final = Surface()


def choice_boxes_01(panel: Panel) -> npt.NDArray[np.float64]:
    """Return where the choices lie: (n, 4) left, top, right, bottom of the board, 0 to 1.

    They fill their rows from left to right, the first row on top.
    """
    return np.array(_boxes_01_of(panel)).reshape(-1, 4)


def _boxes_01_of(panel: Panel) -> Boxes:
    below = BELOW_01 * (any(panel.ends) + bool(panel.hint))
    return _boxes_01(len(panel.choices), panel.rows, *panel.size_m, below)


@lru_cache(maxsize=100)
def _boxes_01(n: int, rows: int, width: float, height: float, below: float) -> Boxes:
    """Return the boxes of `n` choices on a board; rays ask for them in every frame."""
    columns = -(-n // rows) if n else 1
    gap_x = MARGIN_01 * min(width, height) / width
    gap_y = MARGIN_01 * min(width, height) / height
    share = (1.0 - gap_x * (columns + 1)) / columns
    high = min(BUTTONS_01, (MAX_BUTTONS_01 - gap_y * (rows - 1)) / rows)
    boxes = []
    for number in range(n):
        row, column = divmod(number, columns)
        left = gap_x + column * (share + gap_x)
        bottom = 1.0 - gap_y - below - (rows - 1 - row) * (high + gap_y)
        boxes.append((left, bottom - high, left + share, bottom))
    return tuple(boxes)


def track_boxes_01(panel: Panel) -> npt.NDArray[np.float64]:
    """Return where the tracks lie: (n, 4) left, top, right, bottom of the board, 0 to 1."""
    end = 1.0 - (BUTTONS_01 + 2 * MARGIN_01 if panel.choices else MARGIN_01)
    edges = np.linspace(TEXT_01, end, len(panel.tracks) + 1)
    across = np.full(len(panel.tracks), MARGIN_01)
    return np.stack([across, edges[:-1], 1.0 - across, edges[1:]], axis=1)


def rows_of_choices(panel: Panel, distance_m: float) -> int:
    """Return in how many rows the choices are legible at a distance: one, if that is enough.

    Letters are as small as they may be (`MIN_X_HEIGHT_DEG`) and as wide as they usually are.
    """
    em_m = distance_m * np.tan(np.radians(MIN_X_HEIGHT_DEG)) / X_HEIGHT_EM
    n = len(panel.choices)
    for rows in range(1, max(n, 1)):
        box = choice_boxes_01(replace(panel, rows=rows))[0]
        wide_em = (box[2] - box[0]) * panel.size_m[0] / em_m - 1.0
        high_em = (box[3] - box[1]) * panel.size_m[1] / em_m - 0.5
        if all(_fits(choice, wide_em, high_em) for choice in panel.choices):
            return rows
    return max(n, 1)


def _fits(text: str, wide_em: float, high_em: float) -> bool:
    """Tell whether a text fits into a box, its lines broken between words."""
    lines, at_em, space_em = 1, 0.0, CHARACTER_EM / 2
    for word in text.split():
        word_em = sum(
            1.0 if unicodedata.east_asian_width(c) in "FW" else CHARACTER_EM for c in word
        )
        if word_em > wide_em:
            return False
        if at_em and at_em + space_em + word_em > wide_em:
            lines, at_em = lines + 1, word_em
        else:
            at_em += word_em + (space_em if at_em else 0.0)
    return lines * LINE_EM <= high_em


def board_before(
    head: Pose,
    surface: Surface,
    text: str,
    choices: tuple[str, ...],
    *,
    ends: tuple[str, str] = ("", ""),
    hint: str = "",
) -> Panel:
    """Return a board to be read: straight ahead of a head in a headset, or on a screen.

    On a screen it lies in the screen's plane and is as large as the screen, with a margin, but not
    larger than in a headset; keys are shown there, and the `hint`. Choices stand in as many rows
    as they need to be legible.
    """
    screen = surface.screen
    if screen is None:
        panel = Panel(text, choices, board_pose(head), SIZE_M, ends=ends)
        return replace(panel, rows=rows_of_choices(panel, DISTANCE_M))
    flat = screen.flat
    width_m, height_m = (
        min(SHARE_OF_SCREEN * of_screen, flat.distance_m * usual / DISTANCE_M)
        for of_screen, usual in zip((flat.width_m, flat.height_m), SIZE_M, strict=True)
    )
    panel = Panel(
        text,
        choices,
        screen.pose_at(flat.center_right_m, flat.center_up_m),
        (width_m, height_m),
        keys=surface.keys_of(len(choices)),
        ends=ends,
        hint=hint,
    )
    return replace(panel, rows=rows_of_choices(panel, flat.distance_m))


def track_01(panel: Panel, row: int) -> tuple[float, float, float]:
    """Return where a row's track begins and ends, and how far down it is, on the board, 0 to 1."""
    _, top, right, bottom = track_boxes_01(panel)[row].tolist()
    return NAMES_01, right - MARGIN_01, (top + bottom) / 2


def place_met_01(panel: Panel, origin_m: Vector, direction: Vector) -> tuple[float, float] | None:
    """Return where a ray (both (3,), world) meets the board's plane from the front.

    That is how far across and down the board, 0 to 1 on it; None where it never does.
    """
    w, i, j, k = panel.pose.orientation_wxyz.tolist()
    back = w, -i, -j, -k
    from_board = zip(origin_m.tolist(), panel.pose.position_m.tolist(), strict=True)
    start = rotate_one(back, [own - of_board for own, of_board in from_board])
    ray = rotate_one(back, direction.tolist())
    if not (start[2] > 0.0 and ray[2] < 0.0):
        return None
    steps = start[2] / ray[2]
    x, y = start[0] - ray[0] * steps, start[1] - ray[1] * steps
    return x / panel.size_m[0] + 0.5, 0.5 - y / panel.size_m[1]


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
    for i, (left, top, right, bottom) in enumerate(_boxes_01_of(panel)):
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
