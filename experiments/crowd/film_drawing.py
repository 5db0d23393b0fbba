"""Draw one frame of a walk's film with Pillow: the floor from above, the body, the time line."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from experiments.crowd.haptics import BAND_ROLES
from experiments.crowd.replay import Walk
from lab.geometry import Vector
from stimuli.contact.body import BODY_JOINTS
from stimuli.scenes.station_crowd import BOARD_M, READ_WITHIN_M, ROOM_SIDE_M, SIDE_M, START_M

PAPER: Final = (250, 250, 248)
INK: Final = (29, 36, 48)
FAINT: Final = (205, 211, 219)
PERSON: Final = (150, 158, 169)
BODY: Final = (0, 114, 178)
LIT: Final = (213, 94, 0)
TOUCHED: Final = (230, 159, 0)
MARK: Final = (138, 28, 28)

_LIMBS: Final = (
    ("left_upper_arm", "left_lower_arm", 0.095),
    ("left_lower_arm", "left_hand", 0.08),
    ("right_upper_arm", "right_lower_arm", 0.095),
    ("right_lower_arm", "right_hand", 0.08),
    ("left_upper_leg", "left_lower_leg", 0.15),
    ("left_lower_leg", "left_foot", 0.11),
    ("right_upper_leg", "right_lower_leg", 0.15),
    ("right_lower_leg", "right_foot", 0.11),
    ("hips", "upper_chest", 0.25),
    ("left_upper_arm", "right_upper_arm", 0.15),
    ("neck", "head", 0.1),
)
"""Lines of a body: between which joints, how wide in metres."""
_ABOVE: Final = (9, 0, 1, 2, 3)
"""The limbs seen from above, shoulders first."""
_J: Final = {name: i for i, name in enumerate(BODY_JOINTS)}
BAND_NAMES: Final = {
    "armband_left_upper_arm": "left upper arm",
    "armband_left_forearm": "left forearm",
    "armband_right_upper_arm": "right upper arm",
    "armband_right_forearm": "right forearm",
}
_CROWD_HZ: Final = 5
_FINE: Final = 2
"""Everything is drawn twice as large and reduced, which smooths edges."""


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """What one frame shows: joints (22, 3) of the participant, (people, 22, 3) of the crowd.

    `parts` names the participant's capsules in contact, `touched` the people, `vibrating` bands.
    """

    step: int
    t_s: float
    position_m: Vector
    is_tracked: bool
    people_m: Vector
    parts: frozenset[str]
    touched: frozenset[int]
    vibrating: frozenset[str]


class FilmPainter:
    """Paint frames of one walk; what does not change is drawn once."""

    def __init__(
        self,
        size_px: tuple[int, int],
        walk: Walk,
        spans: Sequence[tuple[str, float, float, bool]],
        *,
        title: str,
        is_simulated: bool,
    ) -> None:
        self.size_px = size_px[0] - size_px[0] % 2, size_px[1] - size_px[1] % 2
        self._width, self._height = self.size_px[0] * _FINE, self.size_px[1] * _FINE
        self._spans = spans
        self._place_m = walk.place_m
        since_s = walk.crowd_t_s
        self._length_s = max(float(since_s[-1]), 1e-3)
        unit = self._height / 36
        self._font = ImageFont.load_default(int(unit * 0.95))
        self._small = ImageFont.load_default(int(unit * 0.75))
        self._unit = unit
        foot = self._height - 7.6 * unit
        self._floor_px = min(foot - 2.4 * unit, self._width * 0.6)
        self._floor_at = (unit, 2.0 * unit)
        self._scale = self._floor_px / ROOM_SIDE_M
        left = self._floor_at[0] + self._floor_px + unit
        self._body_box = (left, 2.0 * unit, self._width - unit, 2.0 * unit + self._floor_px)
        self._line_left = 8.0 * unit
        self._line_right = self._width - unit
        self._line_top = foot + 0.4 * unit
        self._background = self._drawn_background(title, is_simulated)
        self._crowd: Image.Image = self._background
        self._crowd_drawn_at = -1

    def paint(self, frame: FilmFrame) -> npt.NDArray[np.uint8]:
        """Return a frame as (h, w, 3) bytes."""
        image = self._crowd_layer(frame).copy()
        draw = ImageDraw.Draw(image)
        self._floor(draw, frame)
        self._body(draw, frame)
        self._bands(draw, frame)
        return np.asarray(image.reduce(_FINE))

    def _xy(self, x: float, z: float) -> tuple[float, float]:
        half = ROOM_SIDE_M / 2
        return (
            self._floor_at[0] + (x + half) * self._scale,
            self._floor_at[1] + (z + half) * self._scale,
        )

    def _drawn_background(self, title: str, is_simulated: bool) -> Image.Image:
        image = Image.new("RGB", (self._width, self._height), PAPER)
        draw = ImageDraw.Draw(image)
        unit = self._unit
        draw.text((unit, 0.4 * unit), title, INK, self._font)
        if is_simulated:
            text = "SIMULATED"
            wide = draw.textlength(text, self._font)
            draw.text((self._width - unit - wide, 0.4 * unit), text, MARK, self._font)
        x0, y0 = self._floor_at
        room = (x0, y0, x0 + self._floor_px, y0 + self._floor_px)
        draw.rectangle(room, fill=(255, 255, 255), outline=FAINT, width=2)
        a, b = self._xy(-SIDE_M / 2, -SIDE_M / 2), self._xy(SIDE_M / 2, SIDE_M / 2)
        draw.rectangle((*a, *b), outline=(232, 235, 239), width=2)
        bx, by = self._xy(BOARD_M[0], BOARD_M[2])
        reach = READ_WITHIN_M * self._scale
        draw.arc((bx - reach, by - reach, bx + reach, by + reach), 94, 176, (44, 138, 87), 3)
        sx, sy = self._xy(*START_M)
        draw.line((sx - unit / 2, sy, sx + unit / 2, sy), LIT, 4)
        draw.line((sx, sy - unit / 2, sx, sy + unit / 2), LIT, 4)
        draw.rectangle(self._body_box, fill=(255, 255, 255), outline=FAINT, width=2)
        draw.text(
            (self._body_box[0] + unit / 2, self._body_box[1] + 0.3 * unit),
            "from behind", PERSON, self._small,
        )  # fmt: skip
        for k, role in enumerate(BAND_ROLES):
            y = self._row(k)
            draw.text((unit, y - 0.45 * unit), BAND_NAMES.get(role, role), INK, self._small)
            draw.line((self._line_left, y, self._line_right, y), FAINT, 2)
        for role, begin_s, end_s, vibrated in self._spans:
            y = self._row(BAND_ROLES.index(role))
            x0, x1 = self._at(begin_s), self._at(end_s)
            box = (x0, y - 0.32 * unit, max(x1, x0 + 2), y + 0.32 * unit)
            draw.rectangle(box, fill=LIT if vibrated else (244, 208, 183))
        bottom = self._row(len(BAND_ROLES)) - 0.3 * unit
        step = 10 if self._length_s > 25 else 2
        for second in range(0, int(self._length_s) + 1, step):
            x = self._at(second)
            draw.line((x, bottom - 0.2 * unit, x, bottom), PERSON, 2)
            draw.text((x - 0.4 * unit, bottom), f"{second} s", PERSON, self._small)
        draw.text((unit, bottom), "dark: vibrated", PERSON, self._small)
        return image

    def _row(self, k: int) -> float:
        return self._line_top + (0.7 + 1.25 * k) * self._unit

    def _at(self, t_s: float) -> float:
        share = min(max(t_s / self._length_s, 0.0), 1.0)
        return self._line_left + share * (self._line_right - self._line_left)

    def _crowd_layer(self, frame: FilmFrame) -> Image.Image:
        """Return the background with everybody on it; people sway by millimetres in a fifth of a
        second, so it is drawn that often.
        """
        at = int(frame.t_s * _CROWD_HZ)
        if at != self._crowd_drawn_at:
            self._crowd_drawn_at = at
            self._crowd = self._background.copy()
            draw = ImageDraw.Draw(self._crowd)
            for joints in frame.people_m:
                self._from_above(draw, joints, PERSON, PERSON, frozenset())
        return self._crowd

    def _floor(self, draw: ImageDraw.ImageDraw, frame: FilmFrame) -> None:
        for number in sorted(frame.touched):
            self._from_above(draw, frame.people_m[number], TOUCHED, TOUCHED, frozenset())
        way = self._place_m[: frame.step + 1 : 10]
        way = way[np.isfinite(way).all(axis=1)]
        if len(way) > 1:
            draw.line([self._xy(x, z) for x, z in way.tolist()], BODY, 2)
        if frame.is_tracked:
            self._from_above(draw, frame.position_m, BODY, INK, frame.parts)

    def _from_above(
        self,
        draw: ImageDraw.ImageDraw,
        joints: Vector,
        colour: tuple[int, int, int],
        head: tuple[int, int, int],
        lit: frozenset[str],
    ) -> None:
        for k in _ABOVE:
            a, b, wide = _LIMBS[k]
            ends = [self._xy(joints[_J[n], 0], joints[_J[n], 2]) for n in (a, b)]
            _stroke(draw, ends[0], ends[1], wide * self._scale, LIT if a in lit else colour)
        for hand in ("left_hand", "right_hand"):
            x, y = self._xy(joints[_J[hand], 0], joints[_J[hand], 2])
            _disc(draw, x, y, 0.05 * self._scale, LIT if hand in lit else colour)
        x, y = self._xy(joints[_J["head"], 0], joints[_J["head"], 2])
        _disc(draw, x, y, 0.1 * self._scale, head)

    def _body(self, draw: ImageDraw.ImageDraw, frame: FilmFrame) -> None:
        x0, y0, x1, y1 = self._body_box
        unit = self._unit
        draw.text((x0 + unit / 2, y1 - 1.4 * unit), f"{frame.t_s:5.1f} s", INK, self._font)
        if not frame.is_tracked:
            draw.text((x0 + unit / 2, (y0 + y1) / 2), "body not tracked", MARK, self._font)
            return
        joints = frame.position_m
        across = joints[_J["right_upper_arm"]] - joints[_J["left_upper_arm"]]
        flat = np.array([across[0], across[2]])
        flat /= max(float(np.linalg.norm(flat)), 1e-9)
        hips = joints[_J["hips"]]
        scale = (y1 - y0) / 2.25
        middle = (x0 + x1) / 2

        def seen(points: Vector) -> Vector:
            aside = (points[:, [0, 2]] - hips[[0, 2]]) @ flat
            return np.stack([middle + aside * scale, y1 - (points[:, 1] + 0.12) * scale], axis=1)

        half_m = (x1 - x0) / 2 / scale - 0.3
        for number in sorted(frame.touched):
            other = seen(frame.people_m[number])
            if abs(float(other[_J["hips"], 0]) - middle) < half_m * scale:
                self._upright(draw, other, scale, (246, 222, 178), (246, 222, 178), frozenset())
        self._upright(draw, seen(joints), scale, BODY, INK, frame.parts)

    def _upright(
        self,
        draw: ImageDraw.ImageDraw,
        at: Vector,
        scale: float,
        colour: tuple[int, int, int],
        head: tuple[int, int, int],
        lit: frozenset[str],
    ) -> None:
        for a, b, wide in _LIMBS:
            _stroke(
                draw, tuple(at[_J[a]]), tuple(at[_J[b]]), wide * scale, LIT if a in lit else colour
            )
        for name, radius, own in (
            ("left_hand", 0.055, colour),
            ("right_hand", 0.055, colour),
            ("left_foot", 0.06, colour),
            ("right_foot", 0.06, colour),
            ("head", 0.11, head),
        ):
            x, y = at[_J[name]].tolist()
            if name == "head":
                y -= 0.08 * scale
            _disc(draw, x, y, radius * scale, LIT if name in lit else own)

    def _bands(self, draw: ImageDraw.ImageDraw, frame: FilmFrame) -> None:
        x = self._at(frame.t_s)
        unit = self._unit
        draw.line((x, self._row(0) - 0.6 * unit, x, self._row(3) + 0.6 * unit), INK, 3)
        for k, role in enumerate(BAND_ROLES):
            if role in frame.vibrating:
                _disc(draw, self._line_left - 0.7 * unit, self._row(k), 0.34 * unit, LIT)


def _stroke(
    draw: ImageDraw.ImageDraw,
    a: tuple[float, ...],
    b: tuple[float, ...],
    wide: float,
    colour: tuple[int, int, int],
) -> None:
    """Draw a line with round ends."""
    draw.line((a[0], a[1], b[0], b[1]), colour, max(round(wide), 1))
    for x, y in (a, b):
        _disc(draw, x, y, wide / 2, colour)


def _disc(
    draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: tuple[int, int, int]
) -> None:
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)
