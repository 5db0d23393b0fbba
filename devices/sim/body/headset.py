"""A headset without optics: paces frames on the clock and measures a body's head.

Not modelled: lens distortion, tracking noise and drift, reprojection, base stations. As from a real
headset, the pose of a frame is foreseen for its light (`visavis.devices.sim.foresight`); the body's
own pose at the frame's start is the measured one. Frame timing is reported as by a runtime:
while a frame is late, the previous one is shown again.
"""

import struct
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from visavis.devices.body_contract import has_plans_of
from visavis.devices.contracts import (
    FRAME_TIMING,
    HEAD,
    HEAD_MEASURED,
    MAX_FRAMES_HELD,
    MIN_FRAMES_TOGETHER,
    Body,
    DeviceState,
    Fault,
    FramesAhead,
    Health,
    PlanningBody,
    Sink,
)
from visavis.devices.faults import FaultSchedule
from visavis.devices.lifecycle import Lifecycle, OnSessionClock
from visavis.devices.meter import StreamMeter
from visavis.devices.sim.body.spec import SIMULATED_HEADSET
from visavis.devices.sim.foresight import Foresight
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import ConfigError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch, StreamSchema

MILLI_HZ = 1000

_LOST_ROWS = np.full((2, 7), np.nan, np.float32)
_POSE_BYTES = 28
"""Of place and orientation in rows of `HEAD` and `HEAD_MEASURED`; one byte of validity follows."""
_TIMING_ROW = struct.Struct("<4qI?4If")
"""A row of `FRAME_TIMING.dtype`."""


class SimulatedHeadset(OnSessionClock):
    """Follow the `Headset` contract over a simulated body.

    Frame k begins at `k * 10**9 // display_rate_hz` ns on the session clock; a frame whose
    start has passed when it is asked for is dropped. Light leaves `look_ahead_ms` later, or
    with the next frame (None). Faults of kind "standby" make poses invalid, as when the headset is
    taken off.
    """

    def __init__(
        self,
        role: str,
        body: Body,
        clock: Clock,
        *,
        display_rate_hz: float = 90,
        look_ahead_ms: float | None = None,
        faults: FaultSchedule | None = None,
    ) -> None:
        if display_rate_hz <= 0 or (look_ahead_ms is not None and look_ahead_ms < 0):
            raise ConfigError(
                f"{role}: display_rate_hz must be above 0 and look_ahead_ms at least 0, "
                f"not {display_rate_hz} and {look_ahead_ms}"
            )
        self.display_rate_hz = float(display_rate_hz)
        self._rate_milli_hz = round(display_rate_hz * MILLI_HZ)
        self._ahead_ns = None if look_ahead_ms is None else round(look_ahead_ms * NS_PER_MS)
        self._body = body if isinstance(body, PlanningBody) and has_plans_of(type(body)) else None
        self._foresight = Foresight(body)
        self._clock = clock
        self._faults = faults if faults is not None else FaultSchedule()
        self._origin_ns = clock.now_ns()
        self._life = Lifecycle(role)
        self._schema = replace(HEAD, nominal_rate_hz=self.display_rate_hz)
        self._measured_schema = replace(HEAD_MEASURED, nominal_rate_hz=self.display_rate_hz)
        self._timing_schema = replace(FRAME_TIMING, nominal_rate_hz=self.display_rate_hz)
        self._timing_held = round(self.display_rate_hz) if clock.is_virtual else 1
        self.info = SIMULATED_HEADSET.info(role, None)
        self._meter = StreamMeter(self.display_rate_hz)
        self._pending: deque[tuple[int, int, int, npt.NDArray[np.float32], bool]] = deque()
        self._foreseen: Pose | None = None
        self._measured: Pose | None = None
        self._ready = threading.Event()
        self._sink: Sink | None = None
        self._first: int | None = None
        self._last: int | None = None
        self._frame: FrameInfo | None = None
        self._submitted_ns = -1
        self._timing: list[tuple[FrameInfo, int, int]] = []
        self._timing_ns: list[tuple[int, int]] = []
        self._timing_rows = 0
        self._valid = True
        self.submitted_images = 0

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the head foreseen, the frame timing and the head measured, at the display's
        rate.
        """
        return (self._schema, self._timing_schema, self._measured_schema)

    def start(self, sink: Sink) -> None:
        """Begin counting frames anew."""
        self._life.require("start", DeviceState.OPEN)
        self._sink = sink
        self._forget_frames()
        self._pending.clear()
        self._meter = StreamMeter(self.display_rate_hz)
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Hand over the poses of the frames waited for since the last call."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING)
        if not self._clock.is_virtual:
            if not self._pending and timeout_s > 0:
                self._ready.wait(timeout_s)
            self._ready.clear()
        row_count = self._deliver_heads() if self._pending else 0
        if len(self._timing) >= self._timing_held:
            row_count += self._deliver_timing()
        return row_count

    def put_off(self) -> bool:
        """Tell whether poses and timing may be delivered later; see
        `visavis.devices.pump.Postponing`.
        """
        return self._clock.is_virtual and len(self._pending) < MAX_FRAMES_HELD

    def put_off_until_ns(self) -> int:
        """Return when the frame begins with which no more may be put off; 0 before the first."""
        if not self._clock.is_virtual or self._last is None:
            return 0
        return self._frame_ns(self._last + MAX_FRAMES_HELD - len(self._pending))

    def head_foreseen(self) -> Pose | None:
        """Return the head foreseen for the last frame's light, as in its sample; None if lost."""
        return self._foreseen

    def head_measured(self) -> Pose | None:
        """Return the head at the start of the last frame, as in its sample; None if lost."""
        return self._measured

    def wait_frame(self) -> FrameInfo:
        """Sleep until the next frame that has not begun yet, and measure the head at that time."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("wait_frame", DeviceState.STREAMING)
        now_ns = self._clock.now_ns()
        due = -(-now_ns * self._rate_milli_hz // (NS_PER_S * MILLI_HZ))
        following = due if self._last is None else self._last + 1
        index = max(due, following)
        dropped_count = index - following
        t_ns = self._frame_ns(index)
        self._clock.sleep_until_ns(t_ns)
        if self._first is None:
            self._first = index
        self._last = index
        self._close_frame(late_by=dropped_count)
        ahead_ns = self._ahead_ns
        predicted_ns = self._frame_ns(index + 1) if ahead_ns is None else t_ns + ahead_ns
        self._measure(index - self._first, t_ns, predicted_ns)
        self._frame = FrameInfo(index - self._first, t_ns, predicted_ns, dropped_count)
        return self._frame

    def frames_ahead(self, until_ns: int, most: int) -> FramesAhead | None:
        """Return the coming frames before a time, with the head in each; see
        `visavis.devices.contracts.FramesAtOnce`. None where the body has no plans, and with faults.
        """
        body, last = self._body, self._last
        most = min(most, MAX_FRAMES_HELD - len(self._pending))
        if body is None or last is None or self._faults.faults or not self._clock.is_virtual:
            return None
        first_ns, end_ns = self._frame_ns(last + 1), self._frame_ns(last + 1 + most)
        if self._clock.now_ns() > first_ns or not self._foresight.is_before(first_ns):
            return None
        if until_ns < end_ns:
            # the least index whose frame begins at this time or later
            most = -(-until_ns * self._rate_milli_hz // (NS_PER_S * MILLI_HZ)) - last - 1
        if most < MIN_FRAMES_TOGETHER:
            return None
        scale, rate, ahead_ns = NS_PER_S * MILLI_HZ, self._rate_milli_hz, self._ahead_ns
        starts = [index * scale // rate for index in range(last + 1, last + 2 + most)]
        t_ns = starts[:-1]
        light_ns = starts[1:] if ahead_ns is None else [start + ahead_ns for start in t_ns]
        times = np.array(t_ns)
        heads = body.heads_ahead(times)
        poses = self._foresight.ahead(times, np.array(light_ns), heads)
        return FramesAhead(t_ns, light_ns, light_ns, poses, heads, body.plan_number)

    def holds(self, ahead: FramesAhead) -> bool:
        """Tell whether the body's plans are still those by which frames were told."""
        return self._body is not None and self._body.plan_number == ahead.plan_number

    def pass_frames(self, ahead: FramesAhead, n: int) -> FrameInfo:
        """Do what `wait_frame` does for each of the first n frames; return the last."""
        if self._last is None or self._first is None or self._body is None:
            raise RuntimeError("frames can be passed only after the first, of a body with plans")
        seq = self._last + 1 - self._first
        frame = self._frame
        for i, (t_ns, light_ns) in enumerate(
            zip(ahead.t_ns[:n], ahead.light_ns[:n], strict=True), seq
        ):
            if frame is not None:
                self._timing.append((frame, self._submitted_ns, 0))
                self._timing_ns.append((frame.predicted_display_ns, t_ns))
                self._submitted_ns = -1
            frame = FrameInfo(i, t_ns, light_ns)
            self._pending.append((i, t_ns, light_ns, ahead.poses[i - seq], True))
        self._frame = frame
        self._last += n
        end_ns = ahead.t_ns[n - 1]
        self._clock.sleep_until_ns(end_ns)
        self._body.head(end_ns)
        heads_m, heads_wxyz = ahead.heads
        self._foresight.pass_times(np.array(ahead.t_ns[:n]), (heads_m[:n], heads_wxyz[:n]))
        self._valid = True
        self._measured, self._foreseen = _poses_of(ahead.poses[n - 1])
        return FrameInfo(seq + n - 1, end_ns, ahead.light_ns[n - 1])

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Count the images and store the time of their arrival; they are not looked at."""
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("submit", DeviceState.STREAMING)
        self.submitted_images += len(images)
        if images:
            self._submitted_ns = self._clock.now_ns()

    def stop(self) -> None:
        """Stop measuring; deliver poses and timing of the last frames."""
        self._life.require("stop", DeviceState.STREAMING)
        self._close_frame(late_by=0)
        self._deliver_heads()
        self._deliver_timing()
        super().stop()

    def close(self) -> None:
        """Forget everything; idempotent."""
        self._pending.clear()
        super().close()

    def health(self) -> Health:
        """Report the rows of all streams; rate and gaps are the head's (dropped frames: holes)."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, received=2 * health.received + self._timing_rows)

    def check(self) -> tuple[Fault, ...]:
        """Report a headset in standby."""
        if self._valid:
            return ()
        remedy = "ask the participant to put the headset on; wake it by moving it"
        return (Fault(self.info.role, "blocking", "no head tracking: in standby", remedy),)

    def _frame_ns(self, index: int) -> int:
        return index * NS_PER_S * MILLI_HZ // self._rate_milli_hz

    def _forget_frames(self) -> None:
        self._first = self._last = self._frame = None
        self._submitted_ns = -1
        self._timing, self._timing_ns = [], []
        self._timing_rows = 0

    def _close_frame(self, *, late_by: int) -> None:
        """Store the timing of the last frame, which delayed the next one by `late_by` frames."""
        frame = self._frame
        if frame is None:
            return
        self._frame = None
        self._timing.append((frame, self._submitted_ns, late_by))
        self._timing_ns.append((frame.predicted_display_ns, self._clock.now_ns()))
        self._submitted_ns = -1

    def _deliver_timing(self) -> int:
        n, sink = len(self._timing), self._sink
        if not n or sink is None:
            return 0
        rows = [
            _TIMING_ROW.pack(
                frame.index,
                frame.index,
                frame.predicted_display_ns,
                submitted_ns,
                frame.dropped,
                True,
                1,
                int(late_by > 0),
                late_by,
                0,
                np.nan,
            )
            for frame, submitted_ns, late_by in self._timing
        ]
        values = np.frombuffer(b"".join(rows), self._timing_schema.dtype)
        seq = np.arange(self._timing_rows, self._timing_rows + n)
        t_device_ns, t_host_ns = np.array(self._timing_ns, np.int64).T.copy()
        self._timing_rows += n
        self._timing, self._timing_ns = [], []
        sink(SampleBatch(self._timing_schema, seq, t_device_ns, t_host_ns, values))
        return n

    def _deliver_heads(self) -> int:
        n, sink = len(self._pending), self._sink
        if not n or sink is None:
            return 0
        # another thread that waits for frames may append meanwhile
        frames = [self._pending.popleft() for _ in range(n)]
        seqs, t_list, light_list, poses, is_valid = zip(*frames, strict=True)
        seq, t_ns, light_ns = np.array(seqs), np.array(t_list), np.array(light_list)
        self._meter.update(t_list, t_list[-1])
        values = _head_rows([rows[1] for rows in poses], is_valid, HEAD.dtype)
        sink(SampleBatch(self._schema, seq, light_ns, t_ns, values))
        values = _head_rows([rows[0] for rows in poses], is_valid, HEAD_MEASURED.dtype)
        sink(SampleBatch(self._measured_schema, seq, t_ns, t_ns, values))
        return 2 * n

    def _measure(self, seq: int, t_ns: int, light_ns: int) -> None:
        faults = self._faults
        self._valid = not faults.faults or faults.active("standby", t_ns - self._origin_ns) is None
        if self._valid:
            # Poses are what their rows in the recording say.
            rows = self._foresight.at_once(t_ns, light_ns)
            self._measured, self._foreseen = _poses_of(rows)
        else:
            rows = _LOST_ROWS
            self._measured = self._foreseen = None
        self._pending.append((seq, t_ns, light_ns, rows, self._valid))
        if not self._clock.is_virtual:
            self._ready.set()


def _poses_of(rows: npt.NDArray[np.float32]) -> tuple[Pose, Pose]:
    """Return the poses of two rows (2, 7), as numbers of a recording."""
    numbers = rows.astype(np.float64)
    return Pose(numbers[0, :3], numbers[0, 3:]), Pose(numbers[1, :3], numbers[1, 3:])


def _head_rows(
    poses: Sequence[npt.NDArray[np.float32]], is_valid: Sequence[bool], dtype: np.dtype[np.void]
) -> npt.NDArray[np.void]:
    """Return rows of a head's stream from poses (n, 7)."""
    packed = np.empty((len(poses), dtype.itemsize), np.uint8)
    packed[:, :_POSE_BYTES] = np.array(poses).view(np.uint8)
    packed[:, _POSE_BYTES] = is_valid
    rows: npt.NDArray[np.void] = packed.view(dtype)[:, 0]
    return rows
