"""The font of words in pictures: one that has every character of a text."""

import importlib.util
from functools import cache, lru_cache
from pathlib import Path
from typing import TypeAlias

from PIL import ImageFont

Font: TypeAlias = ImageFont.FreeTypeFont | ImageFont.ImageFont
NO_CHARACTER = "\uffff"
"""Drawn as the box that stands for characters a font lacks."""


@lru_cache(maxsize=256)
def font_for(text: str, size_px: int) -> Font:
    """Return Pillow's own font where it has all characters of a text, else DejaVu Sans.

    Pillow's has neither umlauts nor accents; DejaVu Sans, which comes with Matplotlib, has those of
    all European languages.
    """
    if all(map(_is_drawn, text)):
        return ImageFont.load_default(size_px)
    return ImageFont.truetype(_dejavu(), size_px)


def missing_characters(text: str) -> list[str]:
    """Return the characters of a text that the font for it lacks: boxes stand for them."""
    if all(map(_is_drawn, text)):
        return []
    return [c for c in dict.fromkeys(text) if not _is_in_dejavu(c)]


@cache
def _is_drawn(character: str) -> bool:
    return _has(ImageFont.load_default(24), character)


@cache
def _is_in_dejavu(character: str) -> bool:
    return _has(ImageFont.truetype(_dejavu(), 24), character)


def _has(font: Font, character: str) -> bool:
    if character.isspace():
        return True
    return bytes(font.getmask(character)) != bytes(font.getmask(NO_CHARACTER))


@cache
def _dejavu() -> str:
    spec = importlib.util.find_spec("matplotlib")  # looked for, not imported: that takes a second
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError("matplotlib, which comes with visavis, is not installed")
    return str(Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf")
