"""Stimuli that move as a page holds them: films and dots, a small picture for each sample."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.models import Models, webp
from visavis.stimuli.picture import Picture

MOVING_SIDE_PX: Final = 320
AROUND_SIDE_PX: Final = 640
"""The longer sides of pictures of which there are many."""
QUALITY: Final = 72
METHOD: Final = 2
"""Of packing: sooner than best."""

Pixels = npt.NDArray[np.uint8]
Box = tuple[float, float, float, float]
"""Left, top, right, bottom of a part of a picture, in shares of its sides."""


def with_small_pictures(picture: Picture) -> Picture:
    """Return a picture in which what moves has as many pixels as a page holds of it: those of a
    long film, all at once, would fill the memory.
    """
    sheets, surround = picture.sheets, picture.surround
    if any(sheet.course is not None for sheet in sheets):
        sheets = tuple(
            sheet
            if sheet.course is None
            else replace(sheet, pixels=_small(sheet.pixels, MOVING_SIDE_PX))
            for sheet in sheets
        )
    if surround is not None and surround.course is not None:
        surround = replace(surround, eyes=(_small(surround.eyes[0][..., :3], AROUND_SIDE_PX),))
    return replace(picture, sheets=sheets, surround=surround)


def moving_content(
    pixels: Sequence[Pixels],
    models: Models,
    bundle: Bundle,
    *,
    is_film: bool,
    box: Box | None = None,
) -> Mapping[str, Any]:
    """Return what a page says of what moves, by its pixels at each sample: files of its pictures,
    each once, and which of them a sample shows. Those of a film are the page's, as other trials
    show them, too; those of dots are the trial's own. With a box, that part of them alone.
    """
    add = models.picture_file if is_film else bundle.add_bytes
    numbers: dict[bytes, int] = {}
    files, sequence = list[dict[str, Any]](), list[int]()
    for one in pixels:
        key = one.tobytes()
        if key not in numbers:
            numbers[key] = len(files)
            # Few colours with sharp edges are smallest, and soonest packed, as they are.
            image = _part_of(one, box)
            how = {"quality": QUALITY} if is_film else {"lossless": True}
            files.append(add(webp(image, method=METHOD, **how)))
        sequence.append(numbers[key])
    return {"files": files, "at": bundle.add(np.array(sequence, np.int32)), "isShared": is_film}


def _part_of(pixels: Pixels, box: Box | None) -> Image.Image:
    image = Image.fromarray(pixels)
    if box is None:
        return image
    (wide, high), (left, top, right, bottom) = image.size, box
    sides = max(1, round(wide * (right - left))), max(1, round(high * (bottom - top)))
    return image.resize(sides, box=(left * wide, top * high, right * wide, bottom * high))


def _small(pixels: Pixels, side_px: int) -> Pixels:
    image = Image.fromarray(pixels)
    image.thumbnail((side_px, side_px))
    return np.asarray(image)
