"""Take eye gaze from an OpenXR runtime (XR_EXT_eye_gaze_interaction).

The extension gives one combined ray, no eyes and no pupils, and runtimes may smooth or predict it
without saying so ("may_be_smoothed" among the capabilities in the manifest): use it for looking-at
measures, not for saccades. A location without its
valid flags is "no data". The sample's own time comes with it where the runtime tells it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import msgpack

from devices.contracts import ClockPair
from devices.drivers.openvr.trackers import PolledPoses
from devices.drivers.openxr.packing import LOCATED
from devices.drivers.openxr.spec import OPENXR_GAZE
from devices.drivers.streaming.gaze_device import GazeDevice
from devices.drivers.streaming.gaze_rays import LOST, NAN, NO_EYE, Sample, gaze_row
from devices.transports import Message, MessageTransport
from lab.clock import Clock
from lab.errors import DeviceNotFound

ORIENTATION_VALID, POSITION_VALID = 1, 2
ORIENTATION_TRACKED = 4


class OpenXrGaze(GazeDevice):
    """Follow the `EyeTracker` contract; calibration is the vendor's affair."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
    ) -> None:
        polled = PolledPoses(transport, clock, rate_hz, ask=b"gaze")
        super().__init__(
            role, polled, clock, OPENXR_GAZE, rate_hz=rate_hz, lost_after_s=lost_after_s
        )
        self._last_sample: int | None = None

    def _connect(self, deadline_ns: int) -> None:
        frames = self._transport.request((b"runtime",), 1.0).frames
        name, offers_gaze = msgpack.unpackb(frames[1]) if len(frames) > 1 else ("", False)
        if not offers_gaze:
            raise DeviceNotFound(
                f"the OpenXR runtime {name!r} offers no eye gaze", remedy=OPENXR_GAZE.remedy
            )
        self._last_sample = None
        self.info = replace(
            self.info,
            model=f"OpenXR eye gaze ({name})",
            is_simulated=self._transport.is_simulated,
        )

    def _decode(self, message: Message) -> Iterable[Sample]:
        _, error, *rest = message.frames
        if error or not rest or len(rest[0]) != LOCATED.size:
            self._malformed += 1
            return ()
        _host_ns, now, sampled, flags, *numbers = LOCATED.unpack(rest[0])
        if message.t_sent_ns is not None:
            self._add_pair(ClockPair(message.t_sent_ns, now, message.t_host_ns))
        stamp = sampled or now
        if stamp == self._last_sample:
            return ()
        self._last_sample = stamp
        return (Sample(stamp, None, _row(int(flags), numbers)),)


def _row(flags: int, numbers: Sequence[float]) -> bytes:
    """Return a row of `GAZE.dtype` from a location in the head's view space."""
    x, y, z, i, j, k, w = numbers
    length = w * w + i * i + j * j + k * k
    if not flags & ORIENTATION_VALID or not 0.9 < length < 1.1:
        return gaze_row(NO_EYE, NO_EYE, ray=LOST, valid=False, used=0)
    ray = (-2 * (i * k + w * j), -2 * (j * k - w * i), -1 + 2 * (i * i + j * j))
    norm = sum(v * v for v in ray) ** 0.5
    at = (x, y, z) if flags & POSITION_VALID else (NAN, NAN, NAN)
    return gaze_row(
        NO_EYE,
        NO_EYE,
        ray=(ray[0] / norm, ray[1] / norm, ray[2] / norm),
        origin=at,
        valid=bool(flags & ORIENTATION_TRACKED),
        used=3,
    )
