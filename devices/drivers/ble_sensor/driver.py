"""Record a sensor that notifies over Bluetooth LE, one packet per notification.

Codec: `ble_sensor.codec`. Wire: a byte link whose chunks are notifications (`links.ble.BleLink`).
The stream is named for the role. Where the sensor sends no time of its own, `t_device_ns` is the
arrival, which Bluetooth delays by up to its connection interval.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import Fault
from visavis.devices.drivers.ble_sensor.codec import Profile
from visavis.devices.drivers.ble_sensor.spec import BLE_SENSOR
from visavis.devices.drivers.streaming.line_device import LinkMessages
from visavis.devices.drivers.streaming.stream_device import StreamDevice
from visavis.devices.transports import Message
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DataError, DeviceTimeout
from visavis.lab.schema import StreamSchema


class _Sample(NamedTuple):
    t_device_ns: int
    numbers: tuple[float, ...]


class BleSensor(StreamDevice[_Sample]):
    """Follow the `Device` contract over notifications of a described layout."""

    def __init__(
        self,
        role: str,
        link: ByteLink,
        clock: Clock,
        *,
        profile: Profile,
        lost_after_s: float = 10.0,
    ) -> None:
        self._profile = profile
        self._seq = -1
        super().__init__(
            role,
            LinkMessages(link),
            clock,
            BLE_SENSOR,
            StreamSchema(role, profile.columns, profile.rate_hz),
            lost_after_s=lost_after_s,
        )

    def check(self) -> tuple[Fault, ...]:
        """Return the faults of the notifications since start."""
        faults = list(self._notes.values())
        for count, text, remedy in (
            (self._malformed, "notifications could not be read", "keep the .wire log, report it"),
            (self._meter.gaps, "gaps in the stream", "come nearer; wet the electrodes"),
            (len(self._one_way.jumps_ms), "jumps of the sensor's clock", "was it taken off?"),
        ):
            if count:
                faults.append(self._warning(f"{count} {text}", remedy))
        return tuple(faults)

    # ---- inside -----------------------------------------------------------------------------

    def _connect(self, deadline_ns: int) -> None:
        self._resume()
        reason = "it sends nothing"
        while (now_ns := self._clock.now_ns()) < deadline_ns:
            for message in self._transport.receive((deadline_ns - now_ns) / NS_PER_S):
                try:
                    if self._profile.read(message.frames[0]):
                        return
                except DataError as problem:
                    reason = str(problem)
        raise DeviceTimeout(reason, role=self.info.role, remedy=BLE_SENSOR.remedy)

    def _resume(self) -> None:
        if self._profile.hello:
            self._transport.post((self._profile.hello,))

    def _decode(self, message: Message) -> Iterable[_Sample]:
        try:
            rows = self._profile.read(message.frames[0])
        except DataError:
            self._malformed += 1
            return
        for row in rows:
            stamp_ns = message.t_host_ns - row.before_ns
            if row.t_device_ns is not None:
                stamp_ns = row.t_device_ns
            yield _Sample(stamp_ns, row.numbers)

    def _number(self, sample: _Sample) -> int:
        self._seq += 1
        return self._seq

    def _values(self, samples: Sequence[_Sample]) -> npt.NDArray[np.void]:
        rows = [sample.numbers for sample in samples]
        values: npt.NDArray[np.void] = np.array(rows, self._schema.dtype)
        return values

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._seq = -1
