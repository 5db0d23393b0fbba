"""bHaptics' SDK2 for Python as its caller sees it, with one unit at the Player.

Written from the maker's page of the SDK and from what the package 0.2.0 returned. Frames are
numbered, a frame ends after its time or by its number, several add up to the strongest. The units
are told twice a second. Not modelled: events, paths, gloves, several units at a position, keys.
"""

import json
from typing import Any

from visavis.devices.sim.bands.peer import BandPeer
from visavis.lab.clock import NS_PER_MS

POINTS = 6
TELL_NS = 500 * NS_PER_MS
POSITIONS = {"ForearmL": 1, "ForearmR": 2, "HandL": 4, "HandR": 5, "FootL": 6, "FootR": 7}


class BhapticsSdkSimulator(BandPeer):
    """The `BytePeer` of the SDK; `is_unit_on` and `battery_percent` may be changed."""

    is_unit_on = True
    battery_percent = 82

    def __init__(self, *args: Any, position: str = "ForearmL", **kwargs: Any) -> None:
        super().__init__(*args, motor_count=POINTS, **kwargs)
        self._position = POSITIONS[position]
        self._frames: dict[int, tuple[int, tuple[float, ...]]] = {}
        self._number = 0
        self._tell_ns = self._origin_ns + TELL_NS
        self.refusals: list[str] = []

    def due_ns(self) -> int | None:
        """Return the end of the first frame, or when the units are told."""
        return min([self._tell_ns, *(end for end, _ in self._frames.values())])

    def act(self, t_ns: int) -> None:
        """End frames whose time is over; tell the units."""
        self._frames = {k: f for k, f in self._frames.items() if f[0] > t_ns}
        self._vibrate(t_ns)
        if t_ns >= self._tell_ns:
            self._tell_ns = t_ns + TELL_NS
            self._tell_units(t_ns)

    def receive(self, data: bytes, t_ns: int) -> None:
        """Take one call."""
        try:
            request = json.loads(data)
            name, arguments = request["call"], request["arguments"]
            if name == "play_dot":
                self._answer(name, self._play(t_ns, *arguments), t_ns)
            elif name == "stop_by_request_id":
                self._frames.pop(self._number, None)
            elif name == "get_device_info_json":
                self._tell_units(t_ns)
            else:
                raise ValueError(f"no function {name}")
        except (ValueError, KeyError, TypeError, IndexError) as problem:
            self.refusals.append(f"{type(problem).__name__}: {problem}")
        self._vibrate(t_ns)

    def _play(self, t_ns: int, position: int, duration_ms: int, values: list[int], _: int) -> int:
        if not all(0 <= value <= 100 for value in values):
            raise ValueError(f"motor values are 0 to 100, not {values}")
        self._frames.pop(self._number, None)  # the link ends the frame before it
        self._number += 1
        if position == self._position:
            levels = [value / 100 for value in values][:POINTS]
            end_ns = t_ns + round(duration_ms * NS_PER_MS)
            self._frames[self._number] = (end_ns, (*levels, *[0.0] * (POINTS - len(levels))))
        return self._number

    def _vibrate(self, t_ns: int) -> None:
        playing = [levels for _, levels in self._frames.values()] if self.is_unit_on else []
        self.set_levels([max((f[i] for f in playing), default=0.0) for i in range(POINTS)], t_ns)

    def _tell_units(self, t_ns: int) -> None:
        unit = {
            "position": self._position,
            "deviceName": "TactSleeve",
            "address": "c4:d8:00:00:00:01",
            "connected": self.is_unit_on,
            "paired": True,
            "battery": self.battery_percent,
            "audioJackIn": False,
            "vsm": 0,
        }
        self._answer("get_device_info_json", [unit], t_ns)

    def _answer(self, name: str, result: object, t_ns: int) -> None:
        self.say(json.dumps({"call": name, "result": result}).encode(), t_ns)
