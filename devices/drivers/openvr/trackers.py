"""Track a body with OpenVR trackers worn on its segments, identified by serial number.

Poses are asked for as they are now (prediction 0) at `rate_hz`; they carry no time of capture, so
`t_device_ns` is the host's time just before the call. A tracker sits on a strap, not in a joint:
`mounts` give the pose of its segment in the tracker's frame, see `mount_of`.
"""

from collections.abc import Iterable, Mapping, Sequence

import msgpack
import numpy as np

from visavis.devices.drivers.openvr import codec
from visavis.devices.drivers.openvr.spec import OPENVR_TRACKERS
from visavis.devices.drivers.streaming.body_device import BodyDevice, BodySample
from visavis.devices.transports import Exchange, Frames, Message, MessageTransport, NoTopics
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import ConfigError, DeviceError, ProtocolViolation
from visavis.lab.geometry import Pose, quat_conjugate, quat_multiply, rotate

LEARN_EVERY_NS = 5 * NS_PER_S
NOWHERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def mount_of(tracker: Pose, segment: Pose) -> Pose:
    """Return a segment's pose in its tracker's frame, from both poses in world (in a T-pose)."""
    back = quat_conjugate(tracker.orientation_wxyz)
    return Pose(
        rotate(back, segment.position_m - tracker.position_m),
        quat_multiply(back, segment.orientation_wxyz),
    )


class OpenVrTrackers(BodyDevice):
    """Follow the `BodyTracker` contract over trackers; `worn` maps serial numbers to segments."""

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        worn: Mapping[str, str],
        mounts: Mapping[str, Pose] | None = None,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
    ) -> None:
        if not worn or len(set(worn.values())) != len(worn):
            raise ConfigError(f"{role}: map each tracker's serial number to a segment of its own")
        self._segment_of = dict(worn)
        self._mounts = dict(mounts or {})
        self._slot_of: dict[str, int] = {}
        self._learn_ns = 0
        super().__init__(
            role,
            PolledPoses(transport, clock, rate_hz),
            clock,
            OPENVR_TRACKERS,
            segments=tuple(self._segment_of.values()),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        self._learn()

    def _resume(self) -> None:
        self._learn()

    def _tick(self, now_ns: int) -> None:
        if now_ns >= self._learn_ns and len(self._slot_of) < len(self._segment_of):
            self._learn()

    def _learn(self) -> None:
        self._learn_ns = self._clock.now_ns() + LEARN_EVERY_NS
        frames = self._transport.request((b"devices",), 1.0).frames
        if frames[0] or len(frames) < 2:
            raise ProtocolViolation("the runtime lists no devices", remedy=OPENVR_TRACKERS.remedy)
        slots = {row[3]: row[0] for row in msgpack.unpackb(frames[1])}
        self._slot_of = {serial: slots[serial] for serial in self._segment_of if serial in slots}
        missing = [s for s in self._segment_of if s not in slots]
        others = ", ".join(sorted(set(slots) - set(self._segment_of))) or "nothing else"
        text = f"trackers not there: {', '.join(missing)}; the runtime has {others}"
        fault = self._warning(text, OPENVR_TRACKERS.remedy)
        self._note("missing", fault if missing else None)

    def _decode(self, message: Message) -> Iterable[BodySample]:
        kind, error, *rest = message.frames
        if kind != b"poses" or error or not rest:
            self._malformed += 1
            return ()
        poses = codec.decode_poses(rest[0])
        n = len(self._segment_of)
        position, turn = np.full((n, 3), np.nan), np.full((n, 4), np.nan)
        valid = np.zeros(n, np.bool_)
        for row, serial in enumerate(self._segment_of):
            slot = self._slot_of.get(serial)
            pose = (
                codec.decode_pose(poses[slot]) if slot is not None and slot < len(poses) else None
            )
            if pose is None:
                continue
            at, q = np.array(pose[0]), np.array(pose[1])
            mount = self._mounts.get(serial, NOWHERE)
            position[row] = at + rotate(q, mount.position_m)
            turn[row] = quat_multiply(q, mount.orientation_wxyz)
            valid[row] = True
        sent_ns = message.t_sent_ns if message.t_sent_ns is not None else message.t_host_ns
        return (BodySample(None, sent_ns, position, turn, valid),)


class PolledPoses(NoTopics):
    """Make a stream from a runtime that only answers: one request `ask` per period."""

    def __init__(
        self, inner: MessageTransport, clock: Clock, rate_hz: float, *, ask: bytes = b"poses"
    ) -> None:
        self.ask = ask
        self._inner = inner
        self._clock = clock
        self._period_ns = round(NS_PER_S / rate_hz)
        self._due_ns = clock.now_ns()

    @property
    def kind(self) -> str:
        """Name the wire itself."""
        return self._inner.kind

    @property
    def is_simulated(self) -> bool:
        """Tell whether the wire itself is simulated."""
        return self._inner.is_simulated

    def open(self, deadline_s: float) -> None:
        """Open the wire."""
        self._inner.open(deadline_s)
        self._due_ns = self._clock.now_ns()

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Pass on."""
        return self._inner.request(frames, timeout_s)

    def post(self, frames: Frames) -> None:
        """Pass on."""
        self._inner.post(frames)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Wait for the next due time if the timeout allows, and ask."""
        now_ns = self._clock.now_ns()
        if now_ns < self._due_ns:
            until_ns = min(self._due_ns, now_ns + round(timeout_s * NS_PER_S))
            self._clock.sleep_until_ns(until_ns)
            now_ns = self._clock.now_ns()
            if now_ns < self._due_ns:
                return []
        behind = (now_ns - self._due_ns) // self._period_ns
        self._due_ns += (behind + 1) * self._period_ns
        self._inner.receive(0.0)
        try:
            exchange = self._inner.request((self.ask,), 1.0)
        except DeviceError:
            return []  # the body device reports a silence that lasts
        if exchange.frames[0]:
            return []
        frames = (self.ask, *exchange.frames)
        return [Message(exchange.t_receive_ns, frames, exchange.t_send_ns)]

    def send(self, port: int, frames: Frames) -> None:
        """Pass on."""
        self._inner.send(port, frames)

    def close(self) -> None:
        """Close the wire; idempotent."""
        self._inner.close()
