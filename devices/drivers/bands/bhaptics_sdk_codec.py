"""Translate between a bHaptics unit's points and calls of the maker's SDK2 for Python; pure.

Sources: the maker's page of its Python SDK (docs.bhaptics.com/sdk/python/references), the package
bhaptics-python 0.2.0, and what that package was seen to send to a Player's port. A call is a text
`{"call": NAME, "arguments": [...]}`, an answer `{"call": NAME, "result": ...}`. Points are 0..100.
A frame ends by itself after 100 ms, so nothing vibrates longer when the computer fails.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from visavis.devices.drivers.bands.bhaptics_codec import FRAME_MS, BhapticsUnit
from visavis.devices.drivers.bands.language import (
    Condition,
    Notice,
    Ready,
    Refusal,
    level,
)

FULL = 100
UNIT_POINTS = 6
EVERY_UNIT = -1
"""The index that means every unit at a position."""
POSITIONS: Mapping[str, int] = {
    "Vest": 0,
    "ForearmL": 1,
    "ForearmR": 2,
    "Head": 3,
    "HandL": 4,
    "HandR": 5,
    "FootL": 6,
    "FootR": 7,
    "GloveL": 8,
    "GloveR": 9,
}
"""Places on the body by the numbers of the SDK."""
PLAY, STOP, DEVICES = "play_dot", "stop_by_request_id", "get_device_info_json"


def call(name: str, *arguments: object) -> bytes:
    """Return one call of a function of the SDK."""
    text = json.dumps({"call": name, "arguments": arguments}, separators=(",", ":"))
    return text.encode("utf-8")


def answer(name: str, result: object) -> bytes:
    """Return what a function of the SDK gave back."""
    return json.dumps({"call": name, "result": result}, separators=(",", ":")).encode("utf-8")


class BhapticsSdkLanguage(BhapticsUnit):
    """Speak to the SDK about one unit; see `BandLanguage`.

    A stop without an argument is for the frame that was played last: the link knows its number.
    """

    def __init__(self, position: str = "ForearmL", points: Sequence[int] = (0, 2, 3, 5)) -> None:
        super().__init__(points)
        self._position = POSITIONS[position]

    def opening(self) -> Sequence[bytes]:
        """Ask which units the Player sees."""
        return (call(DEVICES),)

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one frame of at most 100 ms."""
        values = [0] * UNIT_POINTS
        for point, amplitude in zip(self._points, amplitudes_01, strict=True):
            values[point] = level(amplitude, FULL)
        return (call(PLAY, self._position, min(FRAME_MS, ttl_ms), values, EVERY_UNIT),)

    def silence(self) -> Sequence[bytes]:
        """Return the end of the frame that plays; it ends within 100 ms anyway."""
        return (call(STOP),)

    def closing(self) -> Sequence[bytes]:
        """Return nothing: the Player frees the unit when the connection ends."""
        return ()

    def inquiry(self) -> Sequence[bytes]:
        """Return nothing: the link tells the units twice a second."""
        return ()

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return what the Player sees of the unit, and frames that it does not take."""
        notices: list[Notice] = []
        for _, message in self._reader.feed(data):
            name, result = message.get("call"), message.get("result")
            if name == DEVICES and isinstance(result, list):
                notices += self._about_units(result)
            elif name == PLAY and isinstance(result, int) and result < 0:
                remedy = "look at the Player: is the unit connected, the application allowed?"
                notices.append(Refusal("the bHaptics Player did not take a frame", remedy))
        return notices

    def reset(self) -> None:
        """Discard an answer that is only partly received."""
        self._reader.reset()

    def _about_units(self, units: Sequence[Any]) -> list[Notice]:
        for unit in units:
            if not isinstance(unit, dict) or unit.get("position") != self._position:
                continue
            if unit.get("connected") is not True:
                continue
            percent = unit.get("battery")
            battery_01 = None
            if isinstance(percent, (int, float)) and 0 <= percent <= FULL:
                battery_01 = percent / FULL
            name, address = unit.get("deviceName"), unit.get("address")
            return [
                Ready(
                    name if isinstance(name, str) else "",
                    address if isinstance(address, str) else "",
                ),
                Condition(battery_01=battery_01, is_worn=True),
            ]
        return [Ready(), Condition(is_worn=False)]
