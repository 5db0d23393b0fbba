"""Pace a session by a monitor that participants look at, and say where their eyes are.

It follows the `Headset` contract: a frame begins when the monitor has taken the picture of the one
before. There is no wire: a window of this computer, its `Surface`, is attached once it is open;
without one (nobody looks: rehearsals on a virtual clock, pictures for tests) the clock paces.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from visavis.devices.contracts import (
    MAX_FRAMES_HELD,
    MIN_FRAMES_TOGETHER,
    Body,
    DeviceInfo,
    DeviceState,
    Fault,
    FramesAhead,
    Health,
    PlanningBody,
    Sink,
)
from visavis.devices.frame_streams import HEAD_ROW, FrameStreams
from visavis.devices.lifecycle import Lifecycle, OnSessionClock
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose, Vector
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.lab.screen import FlatScreen

ROLE = "screen"
BEFORE_FLIP_NS = 2 * NS_PER_MS
"""How long before a refresh the window stops taking events and the picture is handed over."""
EARLY_NS = NS_PER_MS // 2
"""A picture taken this much before its refresh means that the graphics driver does not wait."""
MAX_EYES_AGE_NS = NS_PER_S // 2
"""Eyes not found for this long may be elsewhere; their last place is no longer used."""
MAX_EYES_OFF_M = 1.0
"""A tracked eye farther than this from the viewing place is a tracker's mistake."""
REMEDY = "resume the session; it opens the window anew"


class Surface(Protocol):
    """What shows a picture to the participant: a window that fills the monitor."""

    @property
    def closed(self) -> bool:
        """Whether somebody closed it."""
        ...

    def attend(self, until_ns: int) -> None:
        """Take what happens to the window (keys) until a session time; returns then."""
        ...

    def flip(self, image: Any) -> int:
        """Show an image from the next refresh on; return when the monitor took it."""
        ...


class ScreenDisplay(OnSessionClock):
    """Follow the `Headset` contract on a monitor.

    `place` is the viewing place in the world, facing the screen. With `is_tracked` the head is
    where the eye tracker last found both eyes (`watch`), upright and facing the screen; otherwise
    it rests there. Picture `k` is shown from the start of frame `k + 1` on, which is what its row
    of `FRAME_TIMING` is stamped with.
    """

    def __init__(
        self,
        screen: FlatScreen,
        place: Pose,
        clock: Clock,
        *,
        rate_hz: float,
        is_tracked: bool = False,
    ) -> None:
        self.screen = screen
        self.place = place
        self.is_tracked = is_tracked
        self.display_rate_hz = float(rate_hz)
        self._rate_milli_hz = round(self.display_rate_hz * 1000)
        self._period_ns = round(NS_PER_S / rate_hz)
        self._clock = clock
        self._surface: Surface | None = None
        self._life = Lifecycle(ROLE)
        self._streams = FrameStreams(self.display_rate_hz)
        self.info = DeviceInfo(
            role=ROLE,
            driver="screen",
            driver_version="1",
            vendor="",
            model=f"monitor {screen.width_m:g} m × {screen.height_m:g} m, "
            f"{screen.width_px} × {screen.height_px} px, {screen.distance_m:g} m away",
            serial="",
            transport="window",
            # on a virtual clock nobody looks at it
            is_simulated=clock.is_virtual,
            capabilities=frozenset({"tracked head" if is_tracked else "fixed head"}),
        )
        self._body: PlanningBody | None = None
        self._rest = np.concatenate([place.position_m, place.orientation_wxyz]).astype(np.float32)
        self._rest_pose = Pose(self._rest[:3].astype(np.float64), self._rest[3:].astype(np.float64))
        self._eyes: tuple[int, Vector] | None = None
        self._sink: Sink | None = None
        self._frame: FrameInfo | None = None
        self._image: object | None = None
        self._submitted_ns = -1
        self._frames_held = 0
        self._begin()

    def attach(self, surface: Surface) -> None:
        """Show pictures on this from now on, and keep its pace."""
        self._surface = surface

    def seat(self, body: Body) -> None:
        """Let a simulated body rest before it: if it has plans, coming frames can be told."""
        self._body = body if isinstance(body, PlanningBody) else None

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the head stream and the frame timing, at the display's rate."""
        return (self._streams.head, self._streams.timing)

    def start(self, sink: Sink) -> None:
        """Begin counting frames anew."""
        self._life.require("start", DeviceState.OPEN)
        self._begin()
        self._sink = sink
        self._life.state = DeviceState.STREAMING

    def poll(self, timeout_s: float) -> int:
        """Hand over poses and timing of the frames waited for since the last call."""
        self._life.require("poll", DeviceState.STREAMING)
        self._frames_held = 0
        return self._streams.deliver(self._sink)

    def wait_frame(self) -> FrameInfo:
        """Show the picture handed over last and return the frame that begins with its light."""
        self._life.require("wait_frame", DeviceState.STREAMING)
        before, image = self._frame, self._image
        self._image = None
        if self._surface is None or image is None or self._surface.closed:
            t_ns = self._by_clock()
        else:
            due_ns = self._due_ns(self._clock.now_ns())
            self._surface.attend(due_ns - BEFORE_FLIP_NS)
            t_ns = self._surface.flip(image)
            if t_ns < due_ns - EARLY_NS:  # no refresh was waited for
                self._surface.attend(due_ns)
                t_ns = self._clock.now_ns()
        if before is None:
            number, dropped_count = 0, 0
        else:
            steps = max(1, round((t_ns - before.t_ns) / self._period_ns))
            number, dropped_count = before.index + steps, steps - 1
            self._tell_timing(before, t_ns, late_by=dropped_count)
        self._frame = FrameInfo(number, t_ns, t_ns + self._period_ns, dropped_count)
        self._tell_head(t_ns)
        if self._body is not None:
            self._body.head(t_ns)  # what it decides up to now, it decides before it sees more
        self._frames_held += 1
        return self._frame

    def head_foreseen(self) -> Pose | None:
        """Return the head that rests, as in its sample; None where it is tracked."""
        return None if self.is_tracked else self._rest_pose

    def head_measured(self) -> Pose | None:
        """Return the head that rests, as in its sample; None where it is tracked."""
        return self.head_foreseen()

    def put_off(self) -> bool:
        """Tell whether poses and timing may be delivered later; see
        `visavis.devices.pump.Postponing`.
        """
        return self._is_unseen and self._frames_held < MAX_FRAMES_HELD

    def put_off_until_ns(self) -> int:
        """Return when the frame begins with which no more may be put off; 0 before the first."""
        if not self._is_unseen or self._frame is None:
            return 0
        frames = MAX_FRAMES_HELD - self._frames_held
        return self._frame_ns(self._frame_number(self._frame.t_ns) + frames)

    def frames_ahead(self, until_ns: int, most: int) -> FramesAhead | None:
        """Return the coming frames before a time; see `visavis.devices.contracts.FramesAtOnce`.

        None where the body has no plans, and where frames are paced by a window.
        """
        body, frame = self._body, self._frame
        if body is None or frame is None or not self._is_unseen:
            return None
        first = self._frame_number(frame.t_ns) + 1
        if self._clock.now_ns() > self._frame_ns(first):
            return None
        end = first + min(most, MAX_FRAMES_HELD - self._frames_held)
        while end > first and self._frame_ns(end - 1) >= until_ns:
            end -= 1
        if end - first < MIN_FRAMES_TOGETHER:
            return None
        t_ns = [self._frame_ns(number) for number in range(first, end)]
        poses = np.tile(self._rest, (len(t_ns), 2, 1))
        light_ns = [t + self._period_ns for t in t_ns]
        heads = body.heads_ahead(np.array(t_ns))
        return FramesAhead(t_ns, light_ns, t_ns, poses, heads, body.plan_number)

    def holds(self, ahead: FramesAhead) -> bool:
        """Tell whether the body's plans are still those by which frames were told."""
        return self._body is not None and self._body.plan_number == ahead.plan_number

    def pass_frames(self, ahead: FramesAhead, n: int) -> FrameInfo:
        """Do what `wait_frame` does for each of the first n frames; return the last."""
        frame, body = self._frame, self._body
        if frame is None or body is None:
            raise RuntimeError("frames can be passed only after the first, of a body with plans")
        first = frame.index + 1
        frames = [
            frame,
            *(FrameInfo(first + i, ahead.t_ns[i], ahead.light_ns[i]) for i in range(n)),
        ]
        t_ns = np.array(ahead.t_ns[:n])
        timing = self._streams.timings_of(frames[:-1], self._submitted_ns)
        timing["presents"] = 1
        self._streams.add_timings(timing, t_ns)
        self._submitted_ns = -1
        row = HEAD_ROW.pack(*self._rest.tolist(), True)
        self._streams.add_heads(row * n, t_ns)
        self._frames_held += n
        self._frame = frames[-1]
        self._clock.sleep_until_ns(ahead.t_ns[n - 1])
        body.head(ahead.t_ns[n - 1])
        return self._frame

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Take the picture of a frame; it is shown when the next one begins."""
        self._life.require("submit", DeviceState.STREAMING)
        if images:
            self._image = images[0]
            self._submitted_ns = self._clock.now_ns()

    def watch(self, batch: SampleBatch) -> None:
        """Take gaze samples in the frame of the viewing place: where the eyes are."""
        if not self.is_tracked:
            return
        values = batch.values[batch.values["valid"]]
        eyes_m = values["origin_m"].astype(np.float64)
        eyes_m = eyes_m[np.isfinite(eyes_m).all(axis=1)]
        eyes_m = eyes_m[np.linalg.norm(eyes_m, axis=1) <= MAX_EYES_OFF_M]
        if len(eyes_m):
            self._eyes = (int(batch.t_host_ns[-1]), eyes_m[-1])

    def close(self) -> None:
        """Let go of the window, which the renderer closes. Idempotent."""
        self._surface = None
        self._streams.pending.clear()
        super().close()

    def health(self) -> Health:
        """Report the rows of both streams; rate and gaps are the head's (dropped frames: holes)."""
        return self._streams.health(self.state, self._clock.now_ns())

    def check(self) -> tuple[Fault, ...]:
        """Tell that the participant's window was closed."""
        if self._surface is not None and self._surface.closed:
            return (Fault(ROLE, "blocking", "the participant's window was closed", REMEDY),)
        return ()

    # ---- inside -----------------------------------------------------------------------------

    def _begin(self) -> None:
        self._sink = self._frame = self._image = None
        self._submitted_ns = -1
        self._frames_held = 0
        self._streams.begin()

    @property
    def _is_unseen(self) -> bool:
        """Whether frames follow a virtual clock and nobody else, with a head that rests."""
        return self._clock.is_virtual and self._surface is None and not self.is_tracked

    def _frame_number(self, t_ns: int) -> int:
        """Return the number, on the grid `k / rate`, of the frame that begins at a time or next."""
        return -(-t_ns * self._rate_milli_hz // (NS_PER_S * 1000))

    def _frame_ns(self, number: int) -> int:
        return number * NS_PER_S * 1000 // self._rate_milli_hz

    def _due_ns(self, now_ns: int) -> int:
        """Return the refresh that is next, one period after the last that was kept."""
        if self._frame is None:
            return now_ns
        late = max(0, now_ns - self._frame.t_ns - self._period_ns)
        return self._frame.t_ns + self._period_ns * (1 + -(-late // self._period_ns))

    def _by_clock(self) -> int:
        """Wait for the next frame of the grid `k / rate`, which does not drift."""
        now_ns = self._clock.now_ns()
        last_ns = now_ns if self._frame is None else max(now_ns, self._frame.t_ns + 1)
        number = self._frame_number(last_ns)
        t_ns = self._frame_ns(number)
        if t_ns < last_ns:
            t_ns = self._frame_ns(number + 1)
        if self._surface is not None and not self._surface.closed:
            self._surface.attend(t_ns)
        else:
            self._clock.sleep_until_ns(t_ns)
        return t_ns

    def _tell_head(self, t_ns: int) -> None:
        offset, is_found = np.zeros(3), True
        if self.is_tracked:
            is_found = self._eyes is not None and t_ns - self._eyes[0] <= MAX_EYES_AGE_NS
            offset = offset if self._eyes is None else self._eyes[1]
        position = self.place.position_m + offset
        row = HEAD_ROW.pack(*position.tolist(), *self.place.orientation_wxyz.tolist(), is_found)
        self._streams.add_head(row, t_ns, t_ns)

    def _tell_timing(self, frame: FrameInfo, shown_ns: int, *, late_by: int) -> None:
        values = self._streams.timing_of(frame, self._submitted_ns)
        row = values[0]
        row["timing_known"] = self._surface is not None
        row["presents"], row["mispresented"] = 1, int(late_by > 0)
        row["runtime_dropped"] = late_by
        self._streams.add_timing(values, shown_ns, max(shown_ns, self._clock.now_ns()))
        self._submitted_ns = -1
