"""Receive objects from Vicon Tracker's UDP object stream.

Codec: `visavis.devices.drivers.vicon.codec`. Frames bear a number and no time: `t_device_ns` is the
number over `rate_hz`, and `health` fits it to the host's clock by the lower envelope of the
arrivals. Tracker's world has z up (or y, with `up`) and is turned about ours by `yaw_deg`.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from visavis.devices.contracts import Fault
from visavis.devices.drivers.streaming.body_device import (
    BodyDevice,
    BodySample,
    turn_world,
    upright,
)
from visavis.devices.drivers.vicon import codec
from visavis.devices.drivers.vicon.spec import VICON
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import ConfigError, DataError, DeviceTimeout

Objects = dict[str, tuple[codec.Numbers, codec.Numbers]]


class Vicon(BodyDevice):
    """Follow the `BodyTracker` contract; `bodies` maps Tracker's objects to segments.

    `check` reports an object that Tracker has not sent yet, and its segment is not valid.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        bodies: Mapping[str, str],
        rate_hz: float = 100.0,
        up: str = "+Z",
        yaw_deg: float = 0.0,
        lost_after_s: float = 2.0,
    ) -> None:
        if not bodies or len(set(bodies.values())) != len(bodies):
            raise ConfigError(f"{role}: map each object of Tracker to a segment of its own")
        self._names = dict(bodies)
        self._world = upright(up, yaw_deg)
        self._rate_hz = rate_hz
        self._frame: tuple[int, Objects] | None = None
        self._seen_names: set[str] = set()
        super().__init__(
            role,
            transport,
            clock,
            VICON,
            segments=tuple(self._names.values()),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        """Wait for the first frame: Tracker streams whether or not we ask."""
        self._frame, self._seen_names = None, set()
        while (now_ns := self._clock.now_ns()) < deadline_ns:
            for message in self._transport.receive(min(0.05, (deadline_ns - now_ns) / NS_PER_S)):
                if tuple(self._decode(message)):
                    return
        raise DeviceTimeout("heard nothing from Tracker in time", remedy=VICON.remedy)

    def _decode(self, message: Message) -> Iterable[BodySample]:
        try:
            packet = codec.decode(message.frames[0])
        except DataError:
            self._malformed += 1
            return
        self._look_for_names(packet.objects)
        waiting, self._frame = self._frame, None
        objects = packet.objects
        if waiting is not None and waiting[0] == packet.number:
            objects = {**waiting[1], **objects}
        elif waiting is not None:
            yield self._sample(*waiting)  # its last packet was full, or lost
        if packet.is_last:
            yield self._sample(packet.number, objects)
        else:
            self._frame = packet.number, objects

    def _look_for_names(self, objects: Objects) -> None:
        before = len(self._seen_names)
        self._seen_names |= objects.keys()
        if len(self._seen_names) == before and self._seen_names:
            return
        missing = [name for name in self._names if name not in self._seen_names]
        others = ", ".join(sorted(self._seen_names)) or "none"
        fault = self._warning(
            f"Tracker has sent no object {', '.join(missing)}; it sends {others}",
            "enable it in Tracker, or name the objects as they are there",
        )
        self._note("names", fault if missing else None)

    def _pace_fault(self) -> Fault | None:
        pace = self._pace.wrong()
        if pace is None:
            return None
        return self._blocking(
            f"Tracker sends {pace * self._rate_hz:.0f} frames a second, lab_config.yaml says "
            f"{self._rate_hz:g}: times cannot be counted from them",
            f"write rate_hz: {pace * self._rate_hz:.0f}, or set that rate in Tracker",
        )

    def _sample(self, number: int, objects: Objects) -> BodySample:
        n = len(self.segments)
        position, turn = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
        valid = np.zeros(n, np.bool_)
        for row, name in enumerate(self._names):
            at = objects.get(name)
            if at is not None and codec.is_seen(*at):
                position[row] = np.array(at[0]) / 1000
                turn[row] = codec.quaternion(at[1])
                valid[row] = True
        turn_world(self._world, position, turn, valid)
        t_ns = round(number * NS_PER_S / self._rate_hz)
        return BodySample(number, t_ns, position, turn, valid)
