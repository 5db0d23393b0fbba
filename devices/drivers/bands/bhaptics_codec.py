"""Translate between a bHaptics forearm unit's points and its Player's JSON; pure.

Source: bhaptics/tact-python, version 1 (the Player's WebSocket; `Submit` of type `frame` with
position, dotPoints 0..100 and durationMillis; answers with `ConnectedPositions`). The unit has
six points; `points` says which of them are our motors. A frame ends by itself after 100 ms, so
nothing vibrates longer when the computer fails. The Player reports no battery and no receipt.
"""

import json
import math
from collections.abc import Sequence

from visavis.devices.drivers.bands.language import Condition, JsonReader, Notice, Ready, level

FRAME_MS = 100
FULL = 100
PORT = 15881
PATH = "/v2/feedbacks"


def submit_frame(
    key: str, position: str, points: Sequence[tuple[int, int]], duration_ms: int
) -> bytes:
    """Return the request that plays (index, intensity 0..100) for a time."""
    frame = {
        "position": position,
        "dotPoints": [{"index": index, "intensity": intensity} for index, intensity in points],
        "durationMillis": duration_ms,
    }
    request = {"Submit": [{"Type": "frame", "Key": key, "Frame": frame}]}
    return json.dumps(request, separators=(",", ":")).encode("utf-8")


class BhapticsUnit:
    """What a unit is, over whichever interface its Player is reached; see `BandLanguage`."""

    answers = True
    rate_range_hz = (math.nan, math.nan)

    def __init__(self, points: Sequence[int]) -> None:
        self._points = tuple(points)
        self._reader = JsonReader()
        self.motor_count = len(self._points)

    @property
    def unreadable_count(self) -> int:
        """Messages that could not be read."""
        return self._reader.unreadable_count

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return the length of a frame, or less."""
        return min(FRAME_MS, ttl_ms)


class BhapticsLanguage(BhapticsUnit):
    """Speak to the Player about one forearm unit; see `BandLanguage`."""

    def __init__(self, position: str = "ForearmL", points: Sequence[int] = (0, 2, 3, 5)) -> None:
        super().__init__(points)
        self._position = position
        self._key = f"visavis {position}"

    def opening(self) -> Sequence[bytes]:
        """Play nothing, so that the Player answers with what is connected."""
        return self.silence()

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one frame of at most 100 ms."""
        levels = [level(a, FULL) for a in amplitudes_01]
        points = list(zip(self._points, levels, strict=True))
        return (submit_frame(self._key, self._position, points, min(FRAME_MS, ttl_ms)),)

    def silence(self) -> Sequence[bytes]:
        """Return a frame of zeros under the same key; the frame before it ends anyway."""
        points = [(index, 0) for index in self._points]
        return (submit_frame(self._key, self._position, points, FRAME_MS),)

    def closing(self) -> Sequence[bytes]:
        """Return nothing: the Player frees the unit when the connection ends."""
        return ()

    def inquiry(self) -> Sequence[bytes]:
        """Return nothing: the Player reports by itself."""
        return ()

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return whether the unit is connected to the Player."""
        notices: list[Notice] = []
        for _, message in self._reader.feed(data):
            positions = message.get("ConnectedPositions")
            if isinstance(positions, list):
                notices += [Ready(), Condition(is_worn=self._position in positions)]
        return notices

    def reset(self) -> None:
        """Discard a message that is only partly received."""
        self._reader.reset()
