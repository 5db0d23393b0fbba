"""Which bands are open that only this computer can stop; all fall silent when it ends."""

import atexit
import weakref
from typing import Any

open_bands: "weakref.WeakSet[Any]" = weakref.WeakSet()
"""Bands that are open now."""


def silence_every_open_band() -> None:
    """Silence whatever band is open; registered to run when the interpreter ends."""
    for band in list(open_bands):
        band.silence()


atexit.register(silence_every_open_band)
