"""The headset of a simulated participant at a page: what it measures while they take part."""

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.running.page.streams import CONTROLS, MAX_ROWS

RATE_HZ: Final = 72.0
FRAME_MS: Final = 1000 / RATE_HZ
AHEAD_MS: Final = 18.0
"""How far ahead a frame's display is predicted."""
OWN_MS: Final = 2.0
HEAD_M: Final = (0.0, 1.6, 0.0)
HAND_M: Final = (0.2, 1.2, -0.2)
SWAY_M: Final = 0.004
SWAY_MS: Final = (570.0, 730.0, 910.0)
"""Nobody holds their head still: how far it sways along each axis, and how slowly."""
PRESS: Final = ((0.0, 1.0), (90.0, 0.0))
"""A press of the trigger and its release: milliseconds after the answer, and the value."""
TRIGGER: Final = CONTROLS.index("right_trigger")
ENTERED: Final[Mapping[str, Any]] = {
    "entered": True,
    "rate_hz": RATE_HZ,
    "space": "local-floor",
    "controllers": ["left", "right"],
    "renderer": "simulated",
    "profiles": ["simulated"],
}
"""What a page says of it once it was entered."""


@dataclass
class SimulatedHeadset:
    """Measure head, right hand, frames and presses; numbers go on from stretch to stretch."""

    _next_rows: dict[str, int] = field(default_factory=dict)
    _frames: int = 0
    """Frames since the page's clock began."""

    def batches(
        self, from_ms: float, to_ms: float, presses_ms: Sequence[float]
    ) -> Iterator[dict[str, Any]]:
        """Yield the events of a stretch of the page's clock, without their numbers."""
        first = max(self._frames, math.ceil(from_ms / FRAME_MS))
        end = self._frames = max(first, math.ceil(to_ms / FRAME_MS))
        at_ms = np.arange(first, end, dtype=np.float64) * FRAME_MS
        sway = SWAY_M * np.sin(at_ms[:, None] / np.array(SWAY_MS))
        upright = np.tile((1.0, 0.0, 0.0, 0.0, 1.0), (len(at_ms), 1))
        one = np.ones((len(at_ms), 1))
        yield from self._cut("head", at_ms, to_ms, np.hstack([HEAD_M + sway, upright]))
        xr_ms = at_ms[:, None]
        timing = np.hstack([xr_ms, xr_ms + AHEAD_MS, OWN_MS * one, 0 * one, one])
        yield from self._cut("frame_timing", at_ms, to_ms, timing)
        hand = np.hstack([one, HAND_M + sway, upright])
        yield from self._cut("pointer", at_ms, to_ms, hand)
        pressed = [(ms + after, value) for ms in presses_ms for after, value in PRESS]
        times = np.array([min(ms, to_ms) for ms, _ in sorted(pressed)])
        values = np.array([(TRIGGER, value) for _, value in sorted(pressed)], np.float64)
        yield from self._cut("responses", times, to_ms, values)

    def _cut(self, stream: str, at_ms: Vector, closed_ms: float, rows: Vector) -> Iterator[Any]:
        for begin in range(0, len(at_ms), MAX_ROWS):
            times, part = at_ms[begin : begin + MAX_ROWS], rows[begin : begin + MAX_ROWS].copy()
            t0_ms = float(times[0])
            seq0 = self._next_rows.get(stream, 0)
            self._next_rows[stream] = seq0 + len(times)
            more: dict[str, Any] = {}
            if stream == "frame_timing":
                part[:, :2] -= t0_ms
                more = {"xr0_ms": t0_ms}
            data = np.hstack([(times - t0_ms)[:, None], part]).astype("<f4")
            yield {
                "kind": "stream",
                "at_ms": closed_ms,
                "stream": stream,
                "seq0": seq0,
                "rows": len(times),
                "t0_ms": t0_ms,
                "rate_hz": RATE_HZ,
                "data": base64.b64encode(data.tobytes()).decode(),
                **more,
            }
