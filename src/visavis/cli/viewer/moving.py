"""Stimuli that move as a page holds them: films and dots, a small picture for each sample."""

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.models import Models, webp
from visavis.stimuli.film_file import FilmReader
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
WHOLE: Final[Box] = (0.0, 0.0, 1.0, 1.0)
NO_PIXELS: Final[Pixels] = np.zeros((1, 1, 4), np.uint8)


@dataclass(frozen=True, eq=False)
class MovingFiles:
    """Files of the small pictures of what moves at one moment: `sheets`, one each, b"" of those
    that stand still or are not seen, and what is `around`, b"" where nothing moves there.
    """

    sheets: tuple[bytes, ...] = ()
    around: bytes = b""


NOTHING_MOVES: Final = MovingFiles()


class PictureFiles:
    """Own the files of the small pictures of a trial, the same picture's once."""

    def __init__(self) -> None:
        self._files: dict[bytes, bytes] = {}

    def of(self, picture: Picture, boxes: Sequence[Box | None]) -> tuple[Picture, MovingFiles]:
        """Return a picture without the pixels of what moves, and the files that a page holds of
        them, of each sheet the part in its box: the pixels of a long film would fill the memory.
        """
        sheets, surround = picture.sheets, picture.surround
        if all(one is None or one.course is None for one in (*sheets, surround)):
            return picture, NOTHING_MOVES
        files = tuple(
            b""
            if sheet.course is None or box is None
            else self._file(
                sheet.pixels, MOVING_SIDE_PX, box, is_film=isinstance(sheet.course, FilmReader)
            )
            for sheet, box in zip(sheets, boxes, strict=True)
        )
        sheets = tuple(
            sheet if sheet.course is None else replace(sheet, pixels=NO_PIXELS) for sheet in sheets
        )
        around = b""
        if surround is not None and surround.course is not None:
            pixels = surround.eyes[0][..., :3]
            around = self._file(pixels, AROUND_SIDE_PX, WHOLE, is_film=True)
            surround = replace(surround, eyes=(NO_PIXELS,))
        return replace(picture, sheets=sheets, surround=surround), MovingFiles(files, around)

    def _file(self, pixels: Pixels, side_px: int, box: Box, *, is_film: bool) -> bytes:
        image = Image.fromarray(pixels)
        image.thumbnail((side_px, side_px))
        key = hashlib.sha256(repr((image.size, box, is_film)).encode() + image.tobytes()).digest()
        if key not in self._files:
            # Few colours with sharp edges are smallest, and soonest packed, as they are.
            how = {"quality": QUALITY} if is_film else {"lossless": True}
            self._files[key] = webp(_part_of(image, box), method=METHOD, **how)
        return self._files[key]


def pixels_of(file: bytes) -> Pixels:
    """Return the pixels of the file of a small picture."""
    return np.asarray(Image.open(io.BytesIO(file)))


def moving_content(
    samples: Sequence[bytes], models: Models, bundle: Bundle, *, is_film: bool, name: str
) -> Mapping[str, Any]:
    """Return what a page says of what moves, by the file of its picture at each sample: files, each
    once, which of them a sample shows, and what it is called. Those of a film are the page's, as
    other trials show them, too; those of dots are the trial's own.
    """
    add = models.picture_file if is_film else bundle.add_bytes
    numbers = {file: number for number, file in enumerate(dict.fromkeys(samples))}
    return {
        "name": name,
        "files": [add(file) for file in numbers],
        "at": bundle.add(np.array([numbers[file] for file in samples], np.int32)),
        "isShared": is_film,
    }


def _part_of(image: Image.Image, box: Box) -> Image.Image:
    if box == WHOLE:
        return image
    (wide, high), (left, top, right, bottom) = image.size, box
    sides = max(1, round(wide * (right - left))), max(1, round(high * (bottom - top)))
    return image.resize(sides, box=(left * wide, top * high, right * wide, bottom * high))
