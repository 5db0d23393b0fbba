"""The common part of both runtimes' headsets: frames, frame timing, a lost runtime."""

import math
from abc import abstractmethod

import numpy as np

from visavis.devices.contracts import DeviceState, Fault, Health
from visavis.devices.drivers.streaming.message_device import MessageDevice, legible
from visavis.devices.frame_streams import HEAD_ROW, FrameStreams
from visavis.devices.plausible import is_place
from visavis.devices.spec import AnySpec
from visavis.devices.transports import MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceTimeout, ProtocolViolation
from visavis.lab.frame import EyeView, FrameInfo
from visavis.lab.schema import StreamSchema

CALL_TIMEOUT_S = 5.0
RECONNECT_S = 0.1
"""How long a look for a lost runtime may keep frames waiting; the next goes on where it ended."""

_LOST_ROW = HEAD_ROW.pack(*[math.nan] * 7, False)

EYES_MOVED_MM = 0.1
"""Runtimes repeat the distance of the eyes with small differences."""
ROUNDING = 1e-5
"""Runtimes turn the eyes' views back from the head's place: in the last digits they differ in every
frame (Monado by 0.4 µm)."""
HeadPose = tuple[tuple[float, float, float], tuple[float, float, float, float]] | None
"""Position (m) and orientation (w, x, y, z) in the world; None: not tracked."""


class RuntimeHeadset(MessageDevice):
    """Follow the `Headset` contract over a runtime that is asked for frames.

    Streams: the head foreseen for each frame's light (`HEAD`), the timing of every frame
    (`FRAME_TIMING`) and the head as the runtime tracked it when the frame began (`HEAD_MEASURED`;
    no rows from captures that do not hold it). While the runtime is gone `wait_frame` keeps the
    pace by the clock with invalid poses, and `poll` raises DeviceDisconnected until it is back.
    `display_rate_hz` and the views are known once open.
    """

    runtime = "runtime"

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        spec: AnySpec,
        *,
        display_rate_hz: float,
        render_size_px: tuple[int, int],
    ) -> None:
        super().__init__(role, transport, clock, spec)
        self.display_rate_hz = display_rate_hz
        self.render_size_px = render_size_px
        self._views: tuple[EyeView, EyeView] | None = None
        self._eyes_apart_mm: float | None = None
        self._eyes_now_mm = 0.0
        self._loss = ""
        self._frame: FrameInfo | None = None
        self._turn_alone: tuple[float, float, float, float] | None = None
        self._reset(clock.now_ns())

    # ---- what a driver adds -----------------------------------------------------------------

    @abstractmethod
    def _connect_again(self) -> None:
        """Connect to a runtime that was lost; the frame count goes on."""

    def _take_events(self) -> None:
        """Take the events that the runtime sends by itself."""
        return

    # ---- the contract -----------------------------------------------------------------------

    def open(self, deadline_s: float) -> None:
        """Connect to the runtime; read its headset, display and views."""
        super().open(deadline_s)
        self._reset(self._clock.now_ns())

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the head foreseen, the frame timing and the head measured, at the display's
        rate.
        """
        return (self._streams.head, self._streams.timing, self._streams.measured)

    def eye_views(self) -> tuple[EyeView, EyeView]:
        """Return how the left and the right eye look through the display; known once open."""
        if self._views is None:
            raise DeviceError(
                "the views are known once it is open", role=self.info.role, remedy="call open()"
            )
        return self._views

    def poll(self, timeout_s: float) -> int:
        """Hand over the frames since the last call; while the runtime is gone, try again.

        `timeout_s` is not used: the frames come from `wait_frame` in this same thread.
        """
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
        row_count = self._streams.deliver(self._sink)
        if self.state is DeviceState.FAULT and self._attempt_is_due():
            self._reconnect()
        self._take_events()
        if self.state is DeviceState.FAULT and not row_count:
            raise DeviceDisconnected(self._loss, role=self.info.role, remedy=self._spec.remedy)
        return row_count

    def close(self) -> None:
        """Leave the runtime; idempotent."""
        self._streams.pending.clear()
        super().close()

    def health(self) -> Health:
        """Report the rows of all streams; rate and gaps are the head's."""
        return self._streams.health(self.state, self._clock.now_ns())

    # ---- for drivers ------------------------------------------------------------------------

    def _answer(self, name: str) -> bytes:
        """Return what the runtime answers to a call; raises ProtocolViolation."""
        frames = self._transport.request((name.encode(),), CALL_TIMEOUT_S).frames
        if frames[0] or len(frames) < 2:
            reason = frames[0].decode("ascii", "replace") or "an empty answer"
            raise ProtocolViolation(
                f"the runtime refused {name!r}: {reason}", remedy=self._spec.remedy
            )
        return frames[1]

    def _late_answer(self, frames: tuple[bytes, ...]) -> bytes:
        """Return the runtime's answer about a frame that has begun.

        Empty where it cannot answer, as on older captures; the frame's own pose is then used.
        """
        if self._life.state is not DeviceState.STREAMING:
            return b""
        try:
            answer = self._transport.request(frames, CALL_TIMEOUT_S).frames
        except DeviceTimeout:
            return b""
        return answer[1] if not answer[0] and len(answer) > 1 else b""

    def _lose(self, reason: str) -> None:
        self._loss = f"lost the {self.runtime}: {reason}"
        self._turn_alone = None
        self._life.state = DeviceState.FAULT

    def _wait_alone(self) -> FrameInfo:
        """Keep the frame rate by the clock, so that the session can pause and the loop goes on."""
        self._close_frame()
        t_ns = self._last_t_ns + self._period_ns
        skipped_count = max(0, (self._clock.now_ns() - t_ns) // self._period_ns)
        t_ns += skipped_count * self._period_ns
        self._clock.sleep_until_ns(t_ns)
        return self._begin_frame(t_ns, t_ns + self._period_ns, skipped_count, None)

    def _begin_frame(
        self, t_ns: int, predicted_ns: int, skipped_count: int, pose: HeadPose
    ) -> FrameInfo:
        if pose is None or not is_place(*pose[0]):
            turn, self._untracked = self._turn_alone, True
            row = _LOST_ROW if turn is None else HEAD_ROW.pack(*[math.nan] * 3, *turn, False)
        else:
            row, self._untracked = HEAD_ROW.pack(*pose[0], *pose[1], True), False
        self._index += 1 + skipped_count
        self._last_t_ns = t_ns
        self._submitted_ns = -1
        self._streams.add_head(row, predicted_ns, t_ns)
        self._frame = FrameInfo(self._index, t_ns, predicted_ns, skipped_count)
        return self._frame

    def _change_views(self, views: tuple[EyeView, EyeView]) -> None:
        """Draw for other views from now on; where the eyes are farther apart or closer, say so."""
        before = self._views
        if before is not None and _are_alike(before, views):
            return
        self._views = views
        if before is None:
            return
        old_mm, new_mm = (_apart_mm(two) for two in (before, views))
        if self._eyes_apart_mm is None:
            self._eyes_apart_mm = old_mm
        self._eyes_now_mm = new_mm

    def _eyes_moved(self) -> tuple[Fault, ...]:
        """Return a warning while the eyes are not as far apart as when the headset was opened."""
        first_mm, now_mm = self._eyes_apart_mm, self._eyes_now_mm
        if first_mm is None or abs(now_mm - first_mm) < EYES_MOVED_MM:
            return ()
        text = f"the distance between the eyes was set from {first_mm:.1f} to {now_mm:.1f} mm"
        remedy = "pictures follow it; if nobody meant to, set the headset back"
        return (Fault(self.info.role, "warning", text, remedy),)

    def _add_measured(self, pose: HeadPose, t_ns: int, t_host_ns: int) -> None:
        """Record where the runtime tracked the head at a session time; None: it did not."""
        is_tracked = pose is not None and is_place(*pose[0])
        row = HEAD_ROW.pack(*pose[0], *pose[1], True) if pose and is_tracked else _LOST_ROW
        self._streams.add_measured(row, t_ns, t_host_ns)

    def _close_frame(self) -> None:
        """Record the timing of the previous frame."""
        frame = self._frame
        if frame is None:
            return
        values = self._streams.timing_of(frame, self._submitted_ns)
        self._add_timing(values[0])
        self._streams.add_timing(values, frame.predicted_display_ns, self._clock.now_ns())

    def _add_timing(self, row: np.void) -> None:
        """Write the runtime's own timing of the frame into its row, where it gives one."""
        return

    def _set_rate(self, rate_hz: float) -> None:
        if not 1 <= rate_hz <= 1000:
            raise ProtocolViolation(
                f"the runtime says the display runs at {rate_hz:g} Hz", remedy=self._spec.remedy
            )
        self.display_rate_hz = rate_hz
        self._period_ns = round(NS_PER_S / rate_hz)

    # ---- inside -----------------------------------------------------------------------------

    def _reset(self, now_ns: int) -> None:
        self._set_rate(self.display_rate_hz)
        self._streams = FrameStreams(self.display_rate_hz)
        self._index = -1
        self._last_t_ns = now_ns - 1
        self._frame = None
        self._submitted_ns = -1
        self._untracked = False
        self._eyes_apart_mm = None
        self._eyes_now_mm = 0.0

    def _reconnect(self) -> None:
        try:
            self._transport.open(RECONNECT_S)
            with legible("what it answered when it came back", self._spec.remedy):
                self._connect_again()
        except DeviceError as problem:
            reason = str(problem).removesuffix(f"; {problem.remedy}")  # the fault has its own
            self._loss = f"lost the {self.runtime}: {reason}"
            return
        self._life.state = DeviceState.STREAMING


def _apart_mm(views: tuple[EyeView, EyeView]) -> float:
    return 1000 * math.dist(views[0].offset_m, views[1].offset_m)


def _are_alike(first: tuple[EyeView, EyeView], second: tuple[EyeView, EyeView]) -> bool:
    """Tell whether views differ by no more than rounding: metres, parts of a turn, tangents."""
    return all(
        math.isclose(a, b, rel_tol=0.0, abs_tol=ROUNDING)
        for one, other in zip(first, second, strict=True)
        for a, b in zip(_numbers(one), _numbers(other), strict=True)
    )


def _numbers(view: EyeView) -> tuple[float, ...]:
    tangents = (
        view.tangent_left,
        view.tangent_right,
        view.tangent_bottom,
        view.tangent_top,
    )
    return (*view.offset_m, *view.orientation_wxyz, *tangents)
