"""Take the joints of both hands from an OpenXR runtime, as a stream like a body's.

A joint that is inferred or not located is missing. Orientations are turned so that a flat hand of a
T-pose is the identity, as with segments of a body: the extension's joints look along the finger
(−z) with the back of the hand upwards (+y). A thumb keeps the runtime's angle to the palm.
`t_device_ns` is the session's time of the instant that was asked for.
"""

from collections.abc import Iterable
from dataclasses import replace

import msgpack
import numpy as np

from visavis.devices.drivers.openvr.trackers import PolledPoses
from visavis.devices.drivers.openxr.joints import ANSWER_BYTES, JOINT, JOINTS, SIDES
from visavis.devices.drivers.openxr.packing import INSTANT, TRACKED, VALID
from visavis.devices.drivers.openxr.spec import OPENXR_HANDS
from visavis.devices.drivers.streaming.body_device import BodyDevice, BodySample
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceNotFound
from visavis.lab.geometry import Vector, quat_conjugate, quat_from_yaw_pitch_deg, quat_multiply

IN_T_POSE = np.repeat(
    [quat_from_yaw_pitch_deg(90.0), quat_from_yaw_pitch_deg(-90.0)], len(JOINTS), axis=0
)
"""How the extension's axes are turned in a T-pose that faces −z, of every joint."""
ALL = VALID | TRACKED


class OpenXrHands(BodyDevice):
    """Follow the `BodyTracker` contract; segments are `left_palm` … `right_little_tip`."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 90.0,
        lost_after_s: float = 2.0,
    ) -> None:
        super().__init__(
            role,
            PolledPoses(transport, clock, rate_hz, ask=b"joints"),
            clock,
            OPENXR_HANDS,
            segments=tuple(f"{side}_{joint}" for side in SIDES for joint in JOINTS),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        frames = self._transport.request((b"runtime",), 1.0).frames
        name, *offers = msgpack.unpackb(frames[1]) if len(frames) > 1 else ("",)
        if len(offers) < 4 or not offers[3]:
            raise DeviceNotFound(
                f"the OpenXR runtime {name!r} tracks no hands", remedy=OPENXR_HANDS.remedy
            )
        self.info = replace(
            self.info,
            model=f"OpenXR hand joints ({name})",
            is_simulated=self._transport.is_simulated,
        )

    def _decode(self, message: Message) -> Iterable[BodySample]:
        _question, error, *rest = message.frames
        if error or not rest or len(rest[0]) != ANSWER_BYTES:
            self._malformed += 1
            return ()
        host_ns, _ = INSTANT.unpack_from(rest[0])
        joints = np.frombuffer(rest[0], JOINT, offset=INSTANT.size)
        with np.errstate(over="ignore", invalid="ignore"):  # refused just below, or by their place
            xyzw = joints["turn_xyzw"].astype(np.float64)
            places_m = joints["place_m"].astype(np.float64)
            lengths = np.linalg.norm(xyzw, axis=1)
        valid = (joints["flags"] & ALL == ALL) & (lengths > 0.9) & (lengths < 1.1)
        position = np.full((len(joints), 3), np.nan)
        turn = np.full((len(joints), 4), np.nan)
        position[valid] = places_m[valid]
        turn[valid] = _turned(xyzw[valid] / lengths[valid, None], IN_T_POSE[valid])
        return (BodySample(None, host_ns, position, turn, valid),)


def _turned(xyzw: Vector, in_t_pose: Vector) -> Vector:
    """Return orientations (w, x, y, z) that are the identity in a T-pose."""
    return quat_multiply(np.roll(xyzw, 1, axis=1), quat_conjugate(in_t_pose))
