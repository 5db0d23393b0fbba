"""The pixels of panoramas, pictures and films, of each eye its own."""

import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.stimuli.film_file import PictureReader, Pixels, facts_of
from visavis.stimuli.flat import Panorama, Stereo, picture_path
from visavis.stimuli.flat_pixels import read_picture

MIN_WIDE_PX: Final = 2048
"""An eye's picture with fewer is below six pixels a degree, and blurred on any display."""
MAX_WIDE_PX: Final = 8192
"""With more some graphics cards fail, and no headset shows them."""
FILM_WIDE_PX: Final = (1920, 4096)
"""How wide an eye's picture in a film is, from least to most: few computers decode more in time."""
CHECKED_EVERY: Final = 16
"""Of so many rows of a film's picture one goes into the checksum, which each picture needs."""
HALVES: Final[dict[Stereo, tuple[int, int]]] = {
    "none": (1, 1),
    "top-bottom": (1, 2),
    "left-right": (2, 1),
}
"""How many eyes' pictures lie beside each other, and one above the other."""


@dataclass(frozen=True, eq=False)
class PanoramaPixels:
    """The pictures of one eye (of both) or two, left first: sRGB (h, 2 h, 3 or 4), top row first,
    and a checksum of them. Those of one `course` are pictures of one film.
    """

    eyes: tuple[npt.NDArray[np.uint8], ...]
    crc32: int
    course: object = None


def panorama_pixels(panorama: Panorama, folder: Path, t_s: float = 0.0) -> PanoramaPixels:
    """Return the pixels of a panorama, of a film those at a time of it; a picture is decoded once
    for all trials that show it in turn.

    Raises:
        DesignError: it cannot be read, or is no panorama.
    """
    path = picture_path(panorama, folder)
    if panorama.is_film:
        eye_size_px(panorama, folder)
        return _film(path, facts_of(panorama, folder).size_px, panorama.stereo).picture_at(t_s)
    return _decoded(path, path.stat().st_mtime_ns if path.is_file() else 0, panorama.stereo)


def eye_size_px(panorama: Panorama, folder: Path) -> tuple[int, int]:
    """Return width and height of what one eye sees of it.

    Raises:
        DesignError: it cannot be read, or is no panorama.
    """
    path = picture_path(panorama, folder)
    if panorama.is_film:
        size_px = facts_of(panorama, folder).size_px
        return _eye_size(path, size_px, panorama.stereo, FILM_WIDE_PX)
    return _size(path, path.stat().st_mtime_ns if path.is_file() else 0, panorama.stereo)


@lru_cache(maxsize=4)
def _film(path: Path, size_px: tuple[int, int], stereo: Stereo) -> PictureReader[PanoramaPixels]:
    """Return one reader of a film: it stays open from one showing to the next."""
    course = object()

    def split_eyes(pixels: Pixels) -> PanoramaPixels:
        crc32 = zlib.crc32(pixels[::CHECKED_EVERY].tobytes())
        return PanoramaPixels(_eyes(pixels, stereo), crc32, course)

    return PictureReader(path, size_px, split_eyes, is_around=True)


@lru_cache(maxsize=512)
def _size(path: Path, modified_ns: int, stereo: Stereo) -> tuple[int, int]:
    high, wide = _decoded(path, modified_ns, stereo).eyes[0].shape[:2]
    return wide, high


@lru_cache(maxsize=3)
def _decoded(path: Path, modified_ns: int, stereo: Stereo) -> PanoramaPixels:
    picture = read_picture(path, may_lie=False).convert("RGB")
    _eye_size(path, picture.size, stereo, (MIN_WIDE_PX, MAX_WIDE_PX))
    pixels = np.asarray(picture)
    return PanoramaPixels(_eyes(pixels, stereo), zlib.crc32(pixels.tobytes()))


def _eye_size(
    path: Path, size_px: tuple[int, int], stereo: Stereo, wide_px: tuple[int, int]
) -> tuple[int, int]:
    """Return width and height of what an eye sees of a picture, `wide_px` wide from least to most.

    Raises:
        DesignError: it is no panorama, too small, or too large.
    """
    across, down = HALVES[stereo]
    wide, high = size_px[0] // across, size_px[1] // down
    if size_px[0] % across or size_px[1] % down or wide != 2 * high:
        shape = size_px[0] / size_px[1]
        fits = [name for name, (x, y) in HALVES.items() if shape == 2 * x / y]
        raise DesignError(
            f"{path} has {size_px[0]} × {size_px[1]} pixels"
            + ("" if stereo == "none" else f", {wide} × {high} for each eye")
            + "; a panorama is twice as wide as it is high: all of 360 by 180 degrees"
            + (f'. With stereo="{fits[0]}" it would be' if fits else "")
        )
    least_px, most_px = wide_px
    if not least_px <= wide <= most_px:
        raise DesignError(
            f"{path} is {wide} pixels wide for an eye; a panorama has {least_px} at least, as "
            f"with fewer it is blurred, and {most_px} at most"
        )
    return wide, high


def _eyes(pixels: Pixels, stereo: Stereo) -> tuple[Pixels, ...]:
    """Return what each eye sees of a picture (h, w, n), left first."""
    across, down = HALVES[stereo]
    wide, high = pixels.shape[1] // across, pixels.shape[0] // down
    return tuple(
        np.ascontiguousarray(pixels[y * high : (y + 1) * high, x * wide : (x + 1) * wide])
        for y in range(down)
        for x in range(across)
    )
