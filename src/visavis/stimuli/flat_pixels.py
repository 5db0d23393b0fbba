"""The pixels of flat stimuli: letters, files, shapes, gratings and dots as sRGB bytes."""

import math
from functools import lru_cache
from pathlib import Path
from typing import Final
from warnings import catch_warnings

import numpy as np
import numpy.typing as npt
from PIL import Image as Files
from PIL import ImageDraw, ImageOps, UnidentifiedImageError

from visavis.lab.errors import DesignError
from visavis.lab.luminance import LuminanceTable
from visavis.lab.plain_files import DAMAGED_ARCHIVE
from visavis.stimuli.dots import places_deg
from visavis.stimuli.film_file import FilmReader
from visavis.stimuli.flat import Dots, Flat, Grating, Image, Shape, Text, Video, rgb_of
from visavis.stimuli.text_font import font_for

Pixels = npt.NDArray[np.uint8]
"""(height, width, 4) sRGB bytes with opacity, top row first."""
SMOOTH: Final = 4
"""Edges of shapes are drawn so many times as large, and shrunk."""
LETTERS_PX: Final = 100
"""Letters less high are drawn at least so high, and shrunk."""
MIDDLE: Final = 127.5
REACHES_EM: Final = 1.2
ORIENTATION: Final = 0x0112
"""The EXIF tag that says how a camera was turned."""
UPRIGHT: Final = 1
FORMATS: Final = ("PNG", "JPEG", "WEBP", "GIF", "BMP", "TIFF", "PPM")
"""What is read, whatever a file is called: of the others some begin a program (EPS)."""
MOVING: Final = ("PNG", "WEBP", "GIF")
"""Of which one file may hold many pictures that follow each other; those of others stand still."""


@lru_cache(maxsize=32)
def pixels_of(
    flat: Flat,
    size_px: tuple[int, int],
    folder: Path,
    luminance: LuminanceTable | None = None,
) -> Pixels:
    """Return what a stimulus looks like in a box of so many pixels; what moves, at its onset.

    With measured luminances its greys and contrasts are of light; pictures and films stay as they
    are.

    Raises:
        DesignError: its picture cannot be read.
    """
    match flat:
        case Text():
            return _letters(flat, size_px, shown_rgb(rgb_of(flat.colour), luminance))
        case Image():
            picture = read_picture(folder / flat.file)
            return np.asarray(picture.resize(size_px, Files.Resampling.LANCZOS))
        case Shape():
            return _shape(flat, size_px, shown_rgb(rgb_of(flat.colour), luminance))
        case Grating():
            return _grating(flat, size_px, luminance)
        case Dots():
            return moving_pixels(flat, size_px, 0, luminance)
        case Video():
            return FilmReader(folder / flat.file, size_px).picture_at(0.0)


def shown_rgb(rgb: tuple[int, int, int], luminance: LuminanceTable | None) -> tuple[int, int, int]:
    """Return what is drawn for a colour on a screen whose luminances were measured, or not."""
    return rgb if luminance is None else luminance.rgb_of(rgb)


@lru_cache(maxsize=4)
def moving_pixels(
    dots: Dots, size_px: tuple[int, int], step: int, luminance: LuminanceTable | None = None
) -> Pixels:
    """Return what dots look like in a box of so many pixels after so many steps.

    Each is the same disc of whole pixels; those that reach over the box are cut off by it.
    """
    wide, high = size_px
    places = places_deg(dots, step)
    x, y = places[np.isfinite(places[:, 0])].T
    disc_px = max(1, int(np.floor(dots.dot_deg / dots.width_deg * wide + 0.5)))
    left = np.floor((x / dots.width_deg + 0.5) * wide - disc_px / 2 + 0.5).astype(np.int64)
    top = np.floor((0.5 - y / dots.width_deg) * high - disc_px / 2 + 0.5).astype(np.int64)
    from_middle = np.arange(disc_px) + 0.5 - disc_px / 2
    down, right = np.nonzero(np.hypot(from_middle[:, None], from_middle) <= disc_px / 2)
    rows, columns = (top[:, None] + down).ravel(), (left[:, None] + right).ravel()
    is_within = (rows >= 0) & (rows < high) & (columns >= 0) & (columns < wide)
    pixels = np.empty((high, wide, 4), np.uint8)
    pixels[...] = (*shown_rgb(rgb_of(dots.colour), luminance), 0)
    pixels[rows[is_within], columns[is_within], 3] = 255
    return pixels


def text_size_em(text: Text) -> tuple[float, float]:
    """Return how wide and how high the box of a text is, in heights of its letters."""
    draw = ImageDraw.Draw(Files.new("L", (1, 1)))
    left, _, right, _ = draw.multiline_textbbox((0, 0), text.text, font_for(text.text, 100))
    lines = text.text.count("\n") + 1
    return (right - left) / _height_px(text.text, 100) + 0.1, lines * REACHES_EM


def read_picture(path: Path, *, may_lie: bool = True) -> Files.Image:
    """Return a picture of a file as RGBA, turned upright as its camera says.

    Raises:
        DesignError: it is missing, no picture, truncated, of a kind whose colours are unclear, or
            it has to be turned and `may_lie` says that it must not.
    """
    if path.is_dir():  # where a table of items has an empty cell
        raise DesignError(f"{path} is a folder; name the file of a picture")
    if not path.is_file():
        near = [p.name for p in path.parent.glob("*")] if path.parent.is_dir() else []
        same = [n for n in near if n.casefold() == path.name.casefold()]
        hint = f"; did you mean {same[0]}?" if same else "; put it beside the study's file"
        raise DesignError(f"there is no picture {path}{hint}")
    try:
        # what Pillow warns of in damaged EXIF changes no pixel
        with (
            catch_warnings(action="ignore", category=UserWarning),
            Files.open(path, formats=FORMATS) as file,
        ):
            # of colours, Pillow reads 16 bits as if they were 8
            is_deep = any("16" in str(tile[3]) for tile in file.tile)
            lies = file.getexif().get(ORIENTATION, UPRIGHT) != UPRIGHT
            file.load()
            picture = ImageOps.exif_transpose(file)
            pictures = getattr(file, "n_frames", 1) if file.format in MOVING else 1
    except UnidentifiedImageError as error:
        raise DesignError(f"{path} is no picture that can be read; save it as PNG") from error
    except Files.DecompressionBombError as error:
        raise DesignError(f"{path} has too many pixels ({error}); make it smaller") from error
    except (OSError, ValueError, *DAMAGED_ARCHIVE) as error:
        raise DesignError(f"{path} is damaged ({error}); copy or save it again") from error
    if pictures > 1:
        raise DesignError(
            f"{path} holds {pictures} pictures, which move; save one of them as PNG, or all as a "
            "film (MP4) for Video"
        )
    if picture.mode == "CMYK":
        raise DesignError(f"{path} has colours for print (CMYK); save it as RGB")
    if is_deep or picture.mode.startswith(("I", "F")):
        raise DesignError(f"{path} has more than 8 bits a channel; save it with 8 bits")
    if lies and not may_lie:
        raise DesignError(
            f"{path} lies on its side and says so (EXIF orientation); turn it upright and save it "
            "without that"
        )
    return picture.convert("RGBA")


@lru_cache(maxsize=512)
def picture_size(path: Path, modified_ns: int) -> tuple[int, int]:
    """Return width and height of a picture in pixels; it is read whole once for each version.

    Raises:
        DesignError: it cannot be read.
    """
    return read_picture(path).size


def _height_px(text: str, font_px: int) -> float:
    """Return the height from the top of an h to the bottom of a g in the font of a text."""
    _, top, _, bottom = font_for(text, font_px).getbbox("hg")
    return float(bottom - top)


def _letters(text: Text, size_px: tuple[int, int], rgb: tuple[int, int, int]) -> Pixels:
    """Draw small letters large and shrink them: fonts widen small letters to whole pixels."""
    lines = text.text.count("\n") + 1
    em_px = min(size_px[0] / text_size_em(text)[0], size_px[1] / (lines * REACHES_EM))
    times = max(1, math.ceil(LETTERS_PX / em_px))
    wide, high = size_px[0] * times, size_px[1] * times
    font_px = max(4, int(100 * em_px * times / _height_px(text.text, 100)))
    font = font_for(text.text, font_px)
    spacing = round(0.2 * font_px)
    mask = Files.new("L", (wide, high), 0)
    draw = ImageDraw.Draw(mask)
    left, top, right, bottom = draw.multiline_textbbox(
        (0, 0), text.text, font, anchor="mm", spacing=spacing, align="center"
    )
    x = max(2 - left, min(wide / 2, wide - 2 - right))
    y = max(2 - top, min(high / 2, high - 2 - bottom))
    draw.multiline_text((x, y), text.text, 255, font, "mm", spacing, "center")
    pixels = np.empty((size_px[1], size_px[0], 4), np.uint8)
    pixels[..., :3] = rgb
    pixels[..., 3] = np.asarray(mask.resize(size_px, Files.Resampling.BOX))
    return pixels


def _shape(shape: Shape, size_px: tuple[int, int], rgb: tuple[int, int, int]) -> Pixels:
    wide, high = size_px[0] * SMOOTH, size_px[1] * SMOOTH
    line = round(shape.line_deg / shape.width_deg * wide)
    mask = Files.new("L", (wide, high), 0)
    draw = ImageDraw.Draw(mask)
    box, fill = (0, 0, wide - 1, high - 1), 0 if line else 255
    match shape.kind:
        case "rectangle":
            draw.rectangle(box, fill, 255, line or 1)
        case "ellipse":
            draw.ellipse(box, fill, 255, line or 1)
        case "triangle":
            corners = [(wide / 2, 0), (wide - 1, high - 1), (0, high - 1)]
            draw.polygon(corners, fill, 255, line or 1)
        case "cross":
            bar = (line or min(wide, high) // 5) / 2
            draw.rectangle((wide / 2 - bar, 0, wide / 2 + bar, high), 255)
            draw.rectangle((0, high / 2 - bar, wide, high / 2 + bar), 255)
    pixels = np.empty((size_px[1], size_px[0], 4), np.uint8)
    pixels[..., :3] = rgb
    pixels[..., 3] = np.asarray(mask.resize(size_px, Files.Resampling.BOX))
    return pixels


def _grating(
    grating: Grating, size_px: tuple[int, int], luminance: LuminanceTable | None
) -> Pixels:
    wide, high = size_px
    deg_per_px = grating.width_deg / wide
    x = (np.arange(wide) + 0.5 - wide / 2) * deg_per_px
    y = (high / 2 - np.arange(high) - 0.5)[:, None] * deg_per_px
    turn = np.radians(grating.orientation_deg)
    across = x * np.cos(turn) + y * np.sin(turn)
    phase = 2 * np.pi * grating.cycles_per_deg * across + np.radians(grating.phase_deg)
    contrast_01 = grating.contrast_01
    if luminance is not None:
        contrast_01 = luminance.swing_01(contrast_01)
    wave = contrast_01 * np.cos(phase)
    radius = np.hypot(x, y)
    pixels = np.empty((high, wide, 4), np.uint8)
    if grating.mask == "gauss":
        wave = wave * np.exp(-0.5 * (radius / (grating.sd_deg or 1.0)) ** 2)
    if luminance is None:
        pixels[..., :3] = np.rint(MIDDLE + MIDDLE * wave)[..., None].clip(0, 255)
    else:
        pixels[..., :3] = luminance.rgb_of_shares(0.5 + 0.5 * wave)
    is_there = radius <= grating.width_deg / 2 if grating.mask == "circle" else True
    pixels[..., 3] = np.where(is_there, 255, 0)
    return pixels
