"""Fade a scene that ends to black, and one that begins out of it."""

from dataclasses import dataclass, replace

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.stimuli.picture import Picture


@dataclass(frozen=True)
class FadeTimes:
    """Durations of fading out and in; 0 switches within one frame.

    Light that comes slowly has no onset: leave `in_ms` at 0 where a study times from it.
    """

    out_ms: float = 0.0
    in_ms: float = 0.0


class Fades:
    """Change the brightness of pictures over time; the fixation mark stays as it is.

    What fades out is the last lit picture, still.
    """

    def __init__(self, times: FadeTimes) -> None:
        self._out_ns = round(times.out_ms * NS_PER_MS)
        self._in_ns = round(times.in_ms * NS_PER_MS)
        self._lit: Picture | None = None
        self._dark_since_ns: int | None = None
        self._lit_since_ns: int | None = None

    def apply(self, picture: Picture) -> Picture:
        """Return the picture at its moment, as bright as the fade has it; called in order."""
        if picture.brightness_01 > 0.0:
            began = self._lit is None or self._dark_since_ns is not None
            if began:
                self._lit_since_ns = picture.t_ns if self._dark_since_ns is not None else None
            self._lit, self._dark_since_ns = picture, None
            if self._lit_since_ns is None:
                return picture
            share = _share(picture.t_ns - self._lit_since_ns, self._in_ns)
            return with_brightness(picture, picture.brightness_01 * share)
        if self._dark_since_ns is None:
            self._dark_since_ns = picture.t_ns
        left = 1.0 - _share(picture.t_ns - self._dark_since_ns, self._out_ns)
        # Sheets and panoramas end within one frame: their time is what a study measures.
        if self._lit is None or left <= 0.0 or self._lit.sheets or self._lit.surround:
            return picture
        return fading_out(self._lit, picture, self._lit.brightness_01 * left)


def with_brightness(picture: Picture, brightness_01: float) -> Picture:
    """Return a picture at another brightness, exactly as it is recorded."""
    return replace(picture, brightness_01=float(np.float32(brightness_01)))


def fading_out(lit: Picture, dark: Picture, brightness_01: float) -> Picture:
    """Return a fading lit picture with the mark and panels of the dark one that follows."""
    still = replace(lit, t_ns=dark.t_ns, mark_m=dark.mark_m, panels=dark.panels)
    return with_brightness(still, brightness_01)


def _share(passed_ns: int, whole_ns: int) -> float:
    """Return the share of a fade that is over; the first frame is a step already."""
    return 1.0 if whole_ns <= 0 else min(1.0, (passed_ns + 1) / whole_ns)
