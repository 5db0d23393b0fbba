"""The pixels of panoramas, of each eye its own."""

import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.stimuli.flat import Panorama, Stereo, picture_path
from visavis.stimuli.flat_pixels import read_picture

MIN_WIDE_PX: Final = 2048
"""An eye's picture with fewer is below six pixels a degree, and blurred on any display."""
MAX_WIDE_PX: Final = 8192
"""With more some graphics cards fail, and no headset shows them."""
HALVES: Final[dict[Stereo, tuple[int, int]]] = {
    "none": (1, 1),
    "top-bottom": (1, 2),
    "left-right": (2, 1),
}
"""How many eyes' pictures lie beside each other, and one above the other."""


@dataclass(frozen=True, eq=False)
class PanoramaPixels:
    """The pictures of one eye (of both) or two, left first: sRGB (h, 2 h, 3), top row first, and a
    checksum of all.
    """

    eyes: tuple[npt.NDArray[np.uint8], ...]
    crc32: int


def panorama_pixels(panorama: Panorama, folder: Path) -> PanoramaPixels:
    """Return the pixels of a panorama; a file is decoded once for all trials that show it in turn.

    Raises:
        DesignError: it cannot be read, or is no panorama.
    """
    path = picture_path(panorama, folder)
    return _decoded(path, path.stat().st_mtime_ns if path.is_file() else 0, panorama.stereo)


def eye_size_px(panorama: Panorama, folder: Path) -> tuple[int, int]:
    """Return width and height of what one eye sees of it.

    Raises:
        DesignError: it cannot be read, or is no panorama.
    """
    path = picture_path(panorama, folder)
    return _size(path, path.stat().st_mtime_ns if path.is_file() else 0, panorama.stereo)


@lru_cache(maxsize=512)
def _size(path: Path, modified_ns: int, stereo: Stereo) -> tuple[int, int]:
    high, wide = _decoded(path, modified_ns, stereo).eyes[0].shape[:2]
    return wide, high


@lru_cache(maxsize=3)
def _decoded(path: Path, modified_ns: int, stereo: Stereo) -> PanoramaPixels:
    picture = read_picture(path, may_lie=False).convert("RGB")
    across, down = HALVES[stereo]
    wide, high = picture.width // across, picture.height // down
    if picture.width % across or picture.height % down or wide != 2 * high:
        shape = picture.width / picture.height
        fits = [name for name, (x, y) in HALVES.items() if shape == 2 * x / y]
        raise DesignError(
            f"{path} has {picture.width} × {picture.height} pixels"
            + ("" if stereo == "none" else f", {wide} × {high} for each eye")
            + "; a panorama is twice as wide as it is high: all of 360 by 180 degrees"
            + (f'. With stereo="{fits[0]}" it would be' if fits else "")
        )
    if not MIN_WIDE_PX <= wide <= MAX_WIDE_PX:
        raise DesignError(
            f"{path} is {wide} pixels wide for an eye; a panorama has {MIN_WIDE_PX} at least, as "
            f"with fewer it is blurred, and {MAX_WIDE_PX} at most, as displays show no more"
        )
    pixels = np.asarray(picture)
    eyes = tuple(
        np.ascontiguousarray(pixels[y * high : (y + 1) * high, x * wide : (x + 1) * wide])
        for y in range(down)
        for x in range(across)
    )
    return PanoramaPixels(eyes, zlib.crc32(pixels.tobytes()))
