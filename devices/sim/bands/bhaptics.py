"""The bHaptics Player as its WebSocket shows it, with one forearm unit connected.

Written against bhaptics/tact-python, version 1. A frame under a key replaces the one before it
and ends after its time. Status goes out on every request and twice a second. Not modelled:
registered patterns, rotation, paths, other positions, the radio between Player and unit.
"""

import json
from typing import Any

from visavis.devices.sim.bands.peer import BandPeer
from visavis.lab.clock import NS_PER_MS

POINTS = 6
STATUS_NS = 500 * NS_PER_MS


class BhapticsPlayerSimulator(BandPeer):
    """The `BytePeer` of a Player; `is_unit_on` may be changed."""

    is_unit_on = True

    def __init__(self, *args: Any, position: str = "ForearmL", **kwargs: Any) -> None:
        super().__init__(*args, motor_count=POINTS, **kwargs)
        self._position = position
        self._frames: dict[str, tuple[int, tuple[float, ...]]] = {}
        self._status_ns = self._origin_ns + STATUS_NS
        self.refusals: list[str] = []

    def due_ns(self) -> int | None:
        """Return the end of the first frame, or the next status."""
        return min([self._status_ns, *(end for end, _ in self._frames.values())])

    def act(self, t_ns: int) -> None:
        """End expired frames; send the status."""
        self._frames = {k: f for k, f in self._frames.items() if f[0] > t_ns}
        self._vibrate(t_ns)
        if t_ns >= self._status_ns:
            self._status_ns = t_ns + STATUS_NS
            self._tell(t_ns)

    def receive(self, data: bytes, t_ns: int) -> None:
        """Take one request; one message is one JSON text."""
        try:
            requests = json.loads(data)["Submit"]
            for request in requests:
                self._submit(request, t_ns)
        except (ValueError, KeyError, TypeError, IndexError) as problem:
            self.refusals.append(f"{type(problem).__name__}: {problem}")
        self._vibrate(t_ns)
        self._tell(t_ns)

    def _submit(self, request: dict[str, Any], t_ns: int) -> None:
        if request["Type"] != "frame":
            return
        frame = request["Frame"]
        if frame["position"] != self._position:
            return
        levels = [0.0] * POINTS
        for point in frame["dotPoints"]:
            if not 0 <= point["intensity"] <= 100:
                raise ValueError(f"intensity {point['intensity']}")
            levels[point["index"]] = point["intensity"] / 100
        self._frames[request["Key"]] = (
            t_ns + round(frame["durationMillis"] * NS_PER_MS),
            tuple(levels),
        )

    def _vibrate(self, t_ns: int) -> None:
        playing = [levels for _, levels in self._frames.values()] if self.is_unit_on else []
        self.set_levels([max((f[i] for f in playing), default=0.0) for i in range(POINTS)], t_ns)

    def _tell(self, t_ns: int) -> None:
        status = {
            "RegisteredKeys": [],
            "ActiveKeys": sorted(self._frames),
            "ConnectedDeviceCount": int(self.is_unit_on),
            "ConnectedPositions": [self._position] if self.is_unit_on else [],
        }
        self.say(json.dumps(status).encode(), t_ns)
