"""Take eye gaze from an OpenXR runtime.

XR_EXT_eye_gaze_interaction gives one combined ray, no single eyes and no pupils. If a runtime gives
each eye (`visavis.devices.drivers.openxr.eyes`), these are taken: two rays, and with HTC's
extension also pupils and openness. Runtimes may smooth or predict gaze without saying so
("may_be_smoothed" among the capabilities in the manifest): use it for looking-at measures, not for
saccades. A location without its valid flags is "no data". A sample has its own time if the runtime
gives it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

import msgpack

from visavis.devices.contracts import ClockPair
from visavis.devices.drivers.openvr.trackers import PolledPoses
from visavis.devices.drivers.openxr.eyes import EYES, FB, HTC
from visavis.devices.drivers.openxr.packing import LOCATION
from visavis.devices.drivers.openxr.spec import OPENXR_GAZE
from visavis.devices.drivers.streaming.gaze_rays import (
    NO_EYE,
    NO_VECTOR,
    Eye,
    Sample,
    diameter_mm,
    gaze_row,
)
from visavis.devices.drivers.streaming.openness import GazeAndOpenness
from visavis.devices.drivers.streaming.screen import NAN, Triple
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceNotFound

ORIENTATION_VALID, POSITION_VALID = 1, 2
ORIENTATION_TRACKED = 4
EYE_VALUES = 11
CAPABILITIES = {
    HTC: frozenset({"per_eye", "pupil", "openness"}),
    FB: frozenset({"per_eye"}),
}
"""Capabilities besides the combined ray, by the extension with rays per eye."""


class OpenXrGaze(GazeAndOpenness):
    """Follow the `EyeTracker` contract; it is calibrated in the vendor's program."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
        eyes: Literal["auto", "combined"] = "auto",
    ) -> None:
        self._poses = PolledPoses(transport, clock, rate_hz, ask=b"gaze")
        self._takes_each = eyes == "auto"
        self.tells_openness = False
        super().__init__(
            role, self._poses, clock, OPENXR_GAZE, rate_hz=rate_hz, lost_after_s=lost_after_s
        )
        self._last_sample: int | None = None

    def _connect(self, deadline_ns: int) -> None:
        frames = self._transport.request((b"runtime",), 1.0).frames
        name, offers_gaze, *more = msgpack.unpackb(frames[1]) if len(frames) > 1 else ("", False)
        per_eye = str(more[0]) if more and self._takes_each else ""
        if not offers_gaze and not per_eye:
            raise DeviceNotFound(
                f"the OpenXR runtime {name!r} offers no eye gaze", remedy=OPENXR_GAZE.remedy
            )
        self._last_sample = None
        self._poses.ask = b"eyes" if per_eye else b"gaze"
        self.tells_openness = per_eye == HTC
        self.info = replace(
            self.info,
            model=f"OpenXR eye gaze ({', '.join(filter(None, (name, per_eye)))})",
            capabilities=OPENXR_GAZE.product.capabilities | CAPABILITIES.get(per_eye, frozenset()),
            is_simulated=self._transport.is_simulated,
        )

    def _decode(self, message: Message) -> Iterable[Sample]:
        question, error, *rest = message.frames
        layout = EYES if question == b"eyes" else LOCATION
        if error or not rest or len(rest[0]) != layout.size:
            self._malformed += 1
            return ()
        _host_ns, now, sample_time, *values = layout.unpack(rest[0])
        if message.t_sent_ns is not None:
            self._add_pair(ClockPair(message.t_sent_ns, now, message.t_host_ns))
        stamp = sample_time or now
        if stamp == self._last_sample:
            return ()
        self._last_sample = stamp
        if layout is LOCATION:
            return (Sample(stamp, None, _row(int(values[0]), values[1:])),)
        return (_sample(stamp, values[:EYE_VALUES], values[EYE_VALUES:]),)


def _sample(stamp: int, left: Sequence[float], right: Sequence[float]) -> Sample:
    """Return the sample of two eyes, each valid, pose, confidence, pupil and openness."""
    sure = [eye[8] for eye in (left, right) if eye[0] and eye[8] == eye[8]]
    row = gaze_row(_eye(left), _eye(right), confidence_01=min(sure, default=NAN))
    return Sample(stamp, None, row, (_open_01(left), _open_01(right)))


def _eye(reading: Sequence[float]) -> Eye:
    ray = _ray(reading[4:8])
    at: Triple = (reading[1], reading[2], reading[3])
    has_gaze = bool(reading[0]) and ray[0] == ray[0]
    return (
        Eye(ray, at, True, diameter_mm(reading[9]))
        if has_gaze
        else Eye(pupil_mm=diameter_mm(reading[9]))
    )


def _open_01(reading: Sequence[float]) -> float:
    return reading[10] if 0 <= reading[10] <= 1 else NAN


def _ray(turn: Sequence[float]) -> Triple:
    """Return the direction of −z after a rotation (x, y, z, w); NaN if it is no rotation."""
    i, j, k, w = turn
    if not 0.9 < w * w + i * i + j * j + k * k < 1.1:
        return NO_VECTOR
    ray = (-2 * (i * k + w * j), -2 * (j * k - w * i), -1 + 2 * (i * i + j * j))
    norm = sum(v * v for v in ray) ** 0.5
    return ray[0] / norm, ray[1] / norm, ray[2] / norm


def _row(flags: int, numbers: Sequence[float]) -> bytes:
    """Return a row of `GAZE.dtype` from a location in the head's view space."""
    x, y, z, *turn = numbers
    ray = _ray(turn)
    if not flags & ORIENTATION_VALID or ray[0] != ray[0]:
        return gaze_row(NO_EYE, NO_EYE, ray=NO_VECTOR, valid=False, used_eyes=0)
    at = (x, y, z) if flags & POSITION_VALID else (NAN, NAN, NAN)
    return gaze_row(
        NO_EYE,
        NO_EYE,
        ray=ray,
        origin=at,
        valid=bool(flags & ORIENTATION_TRACKED),
        used_eyes=3,
    )
