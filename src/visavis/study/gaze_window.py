"""A window that follows gaze while something is shown: where it is, and how late it comes."""

from typing import Final

import numpy as np

from visavis.analysis.gaze.looks import DEFAULT_LOOK_PARAMETERS
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import FrameView, Scalar
from visavis.stimuli.gaze_window import NO_WINDOW, WindowPlace

BRIDGE_NS: Final = round(DEFAULT_LOOK_PARAMETERS.bridge_ms * NS_PER_MS)
"""A loss of gaze up to this, in a blink that is short, does not end a look; as in measures."""
ENDINGS: Final = (
    (
        "_window_delay_ms",
        "ms",
        "from a sample of gaze to the first frame of {} whose window was there, median: the delay "
        "of the whole loop",
    ),
    ("_window_delay_p95_ms", "ms", "the same, 95th percentile"),
    ("_window_lost_frames", "1", "frames of {} in which all was covered, as gaze was lost"),
)
"""Endings of the columns that a window adds which follows gaze, their units and words."""


class WindowCourse:
    """Follow the newest usable sample of gaze, frame by frame.

    While gaze is lost the window stays for as long as a loss does not end a look, and then all is
    covered.
    """

    def __init__(self) -> None:
        self._place = NO_WINDOW
        self._came_ns = 0
        self._is_unlit = False
        self._delays_ms: list[float] = []
        self._lost_frames = 0

    def take(self, view: FrameView) -> WindowPlace:
        """Take the gaze of a frame; return where the window is from the next one on."""
        if self._is_unlit and self._place.t_sample_ns is not None:
            self._delays_ms.append((view.t_ns - self._place.t_sample_ns) / NS_PER_MS)
        self._is_unlit = False
        gaze = view.gaze
        usable = np.flatnonzero(gaze.valid) if gaze.sample_count else np.empty(0, np.int64)
        if len(usable):
            i = usable[np.argmax(gaze.t_ns[usable])]
            self._came_ns = view.t_ns
            if self._place.t_sample_ns is None or gaze.t_ns[i] > self._place.t_sample_ns:
                self._place = WindowPlace.of(
                    int(gaze.t_ns[i]), gaze.origin_world_m[i], gaze.direction_world[i]
                )
                self._is_unlit = True
        elif view.t_ns - self._came_ns > BRIDGE_NS:
            self._place = NO_WINDOW
        self._lost_frames += self._place is NO_WINDOW
        return self._place

    def columns(self, name: str) -> dict[str, Scalar | None]:
        """Return the columns of what was shown up to now."""
        delays_ms = self._delays_ms
        median, p95 = np.percentile(delays_ms, (50, 95)).tolist() if delays_ms else (None, None)
        values = (median, p95, self._lost_frames)
        return {f"{name}{ending}": v for (ending, _, _), v in zip(ENDINGS, values, strict=True)}
