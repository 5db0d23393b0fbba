"""Draw a panel of text with its choices, crisp at reading distance."""

from typing import Literal

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.stimuli.panels import (
    BELOW_01,
    MARGIN_01,
    TEXT_01,
    choice_boxes_01,
    track_01,
    track_boxes_01,
)
from visavis.stimuli.picture import Panel
from visavis.stimuli.text_font import font_for

__all__ = ["choice_boxes_01", "panel_image"]

WIDTH_PX = 1400
SMALL_M, SMALL_PX = 0.1, 96
"""A board so small is a mark on another."""
BOARD = (28, 31, 36, 245)
EDGE = (96, 102, 112, 255)
TEXT = (238, 240, 242, 255)
HINT = (170, 176, 186, 255)
BUTTON = (52, 57, 65, 255)
LIT = (54, 110, 190, 255)
CHOSEN = (232, 170, 60, 255)


def panel_image(panel: Panel) -> npt.NDArray[np.uint8]:
    """Return the board as (h, w, 4) bytes, top row first."""
    width = WIDTH_PX if panel.size_m[0] > SMALL_M else SMALL_PX
    height = max(64, round(width * panel.size_m[1] / panel.size_m[0]))
    image = Image.new("RGBA", (width, height), (0, 0, 0, 0))
    draw = ImageDraw.Draw(image)
    radius = min(width, height) // 24
    fill = BOARD
    if width == SMALL_PX:
        fill = TEXT if panel.highlighted is None else LIT
    draw.rounded_rectangle((2, 2, width - 3, height - 3), radius, fill, EDGE, 3)
    bottom = 1.0 - MARGIN_01
    boxes = choice_boxes_01(panel)
    if len(boxes):
        bottom = float(boxes[0, 1]) - MARGIN_01 / 2
    if panel.tracks:
        bottom = TEXT_01
    elif panel.hint and not len(boxes):
        bottom -= BELOW_01
    margin = round(MARGIN_01 * min(width, height)) + radius // 2
    largest = height // 9 if 3 * height > width else height // 2
    _fit(draw, panel.text, (margin, margin, width - margin, round(bottom * height)), largest)
    _draw_rows(draw, panel, width, height)
    common = min(
        (
            _largest(draw, choice, _pixels(box, width, height, 12), height // 10)
            for choice, box in zip(panel.choices, boxes, strict=True)
        ),
        default=12,
    )
    for i, (choice, box) in enumerate(zip(panel.choices, boxes, strict=True)):
        place = _pixels(box, width, height, 0)
        fill = LIT if i == panel.highlighted else BUTTON
        edge, thick = (CHOSEN, 9) if i == panel.chosen else (EDGE, 3)
        draw.rounded_rectangle(place, radius // 2, fill, edge, thick)
        _fit(draw, choice, _pixels(box, width, height, 12), common)
    small = height // 20
    for key, choice, box in zip(panel.keys, panel.choices, boxes, strict=False):
        if key != choice:
            left, top, *_ = _pixels(box, width, height, 8)
            draw.text((left + 4, top), key, HINT, font_for(key, small))
    edge_px = round((1.0 - MARGIN_01 / 2) * height)
    if panel.hint:
        edge_px -= round(BELOW_01 * height)
        line = (margin, edge_px, width - margin, round((1.0 - MARGIN_01 / 2) * height))
        _fit(draw, panel.hint, line, small, HINT)
    if any(panel.ends):
        top_px = edge_px - round(BELOW_01 * height)
        half = width // 2
        _fit(draw, panel.ends[0], (margin, top_px, half, edge_px), height // 16, side="left")
        _fit(
            draw, panel.ends[1], (half, top_px, width - margin, edge_px), height // 16, side="right"
        )
    return np.array(image)


def _draw_rows(draw: ImageDraw.ImageDraw, panel: Panel, width: int, height: int) -> None:
    """Draw every row's name, all of one size, and its track."""
    places = []
    for row, (left, top, _, bottom) in enumerate(track_boxes_01(panel)):
        begin, end, down = track_01(panel, row)
        places.append(_pixels(np.array([left, top, begin, bottom]), width, height, 6))
        track = (round(begin * width), round(down * height) - 4, round(end * width))
        draw.rounded_rectangle((*track, track[1] + 8), 4, EDGE)
    names = list(zip(panel.tracks, places, strict=True))
    common = min((_largest(draw, name, at, height // 10) for name, at in names), default=12)
    for name, at in names:
        _fit(draw, name, at, common)


def _pixels(
    box: npt.NDArray[np.float64], width: int, height: int, inset: int
) -> tuple[int, int, int, int]:
    left, top, right, bottom = box * (width, height, width, height)
    return (round(left) + inset, round(top) + inset, round(right) - inset, round(bottom) - inset)


def _largest(
    draw: ImageDraw.ImageDraw, text: str, box: tuple[int, int, int, int], largest_px: int
) -> int:
    size = largest_px
    while size > 14 and not _fits(draw, _wrap(draw, text, box[2] - box[0], size), box, size):
        size -= max(1, size // 12)
    return size


def _fits(
    draw: ImageDraw.ImageDraw, text: str, box: tuple[int, int, int, int], size_px: int
) -> bool:
    left, top, right, bottom = draw.multiline_textbbox(
        (0, 0), text, font_for(text, size_px), spacing=6
    )
    return right - left <= box[2] - box[0] and bottom - top <= box[3] - box[1]


def _wrap(draw: ImageDraw.ImageDraw, text: str, width_px: int, size_px: int) -> str:
    """Break lines between words where they would be wider than the box."""
    font, lines = font_for(text, size_px), []
    for paragraph in text.split("\n"):
        line = ""
        for word in paragraph.split():
            longer = f"{line} {word}".strip()
            if line and draw.textlength(longer, font) > width_px:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    return "\n".join(lines)


def _fit(
    draw: ImageDraw.ImageDraw,
    text: str,
    box: tuple[int, int, int, int],
    largest_px: int,
    fill: tuple[int, int, int, int] = TEXT,
    *,
    side: Literal["left", "middle", "right"] = "middle",
) -> None:
    size = _largest(draw, text, box, largest_px)
    x = {"left": box[0], "middle": (box[0] + box[2]) / 2, "right": box[2]}[side]
    draw.multiline_text(
        (x, (box[1] + box[3]) / 2),
        _wrap(draw, text, box[2] - box[0], size),
        fill,
        font_for(text, size),
        anchor=f"{side[0]}m",
        align="center" if side == "middle" else side,
        spacing=6,
    )
