"""The open bands that only this computer can stop; all are silenced when Python exits."""

import atexit
import weakref
from typing import Any

open_bands: "weakref.WeakSet[Any]" = weakref.WeakSet()
"""Bands that are open now."""


def silence_every_open_band() -> None:
    """Silence every open band; registered to run when the interpreter exits."""
    for band in list(open_bands):
        band.silence()


atexit.register(silence_every_open_band)
