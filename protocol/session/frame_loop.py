"""One frame after another: draw, wait, take samples, evaluate gaze, record."""

import threading
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol, TypeAlias, cast

import numpy as np

from visavis.devices.contracts import (
    GAZE,
    HEAD,
    HEAD_MEASURED,
    POINTER,
    SOUND_EVENTS,
    Fault,
    FramesAhead,
    FramesAtOnce,
    GazeAhead,
    OnScreen,
    PoseAtOnce,
)
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch
from visavis.lab.screen import PlacedScreen
from visavis.protocol.plan.experiment import Experiment, FollowingGaze
from visavis.protocol.plan.steps import (
    BodyView,
    FrameView,
    GazeView,
    Pictures,
    Play,
    PlaySound,
    Silence,
    SoundOnset,
    UpdateAhead,
    comes_back,
)
from visavis.protocol.session.head_history import MAX_WAITING
from visavis.protocol.session.observation import GazeObserver
from visavis.protocol.session.rig import RunningRig
from visavis.protocol.session.row_buffer import RowBuffer
from visavis.protocol.session.scene_log import SceneLog
from visavis.protocol.session.screen_gaze import gaze_through_screen
from visavis.protocol.session.states import SessionState, StateMachine
from visavis.protocol.session.streams import (
    FRAMES,
    GAZE_WINDOWS,
    gaze_targets_schema,
    scene_states_schema,
)
from visavis.recording.writer import Recorder
from visavis.stage.contracts import GeometryStage, Glance, Stage
from visavis.stimuli.panels import Surface
from visavis.stimuli.scene import Scene, SceneFrame

STATE_CODES = {state: code for code, state in enumerate(SessionState)}
HOLD_REAL_NS = 50 * NS_PER_MS
HOLD_VIRTUAL_NS = 4 * NS_PER_S
BEFORE_FRAME_NS = NS_PER_MS // 10
"""A frame does not wait for a body sample that arrives with it."""
Answer: TypeAlias = Callable[[BodyView], Sequence[Play | Silence]]
BEGAN = SOUND_EVENTS.index("began")
UPRIGHT = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))


def without_ended_steps(steps: Sequence[Play | Silence]) -> list[Play | Silence]:
    """Leave out steps that the same answer ends again.

    Samples that arrive together after a pause can hold contacts that began and ended within it; no
    motor is started for these.
    """
    last_end = {step.role: i for i, step in enumerate(steps) if isinstance(step, Silence)}
    return [
        step
        for i, step in enumerate(steps)
        if isinstance(step, Silence) or max(last_end.get(step.role, -1), last_end.get("", -1)) < i
    ]


class FaultWatch(Protocol):
    """Looks for faults of devices at some frames, also at those that are passed."""

    check_due_ns: int
    """When it looks next: in the first frame that begins then or later."""

    def is_calm(self) -> bool:
        """Tell whether nothing is wrong nor was, so that frames after a look can be told before."""
        ...

    def check(self) -> bool:
        """Look for faults if that is due in the present frame; tell whether there are none."""
        ...


class FrameLoop:
    """Drive the display frame by frame; everything a frame brings passes through here."""

    def __init__(
        self,
        experiment: Experiment,
        rig: RunningRig,
        headset_rate_hz: float,
        gaze_rate_hz: float | None,
        controls: tuple[str, ...],
        stage: Stage,
        recorder: Recorder,
        clock: Clock,
        states: StateMachine,
    ) -> None:
        hold_ns = HOLD_VIRTUAL_NS if clock.is_virtual else HOLD_REAL_NS
        m = experiment.agent_count
        frames = replace(FRAMES, nominal_rate_hz=headset_rate_hz)
        targets = gaze_targets_schema(m, gaze_rate_hz or 0.0)
        scene_states = scene_states_schema(m)
        # Streams are declared before their first row; the stage may append as soon as it starts.
        for schema in (frames, scene_states):
            recorder.declare(schema)
        if gaze_rate_hz is not None:
            recorder.declare(targets)
        if isinstance(experiment, FollowingGaze) and experiment.has_gaze_windows:
            recorder.declare(GAZE_WINDOWS)
        for schema in stage.schemas:
            recorder.declare(schema)
        stage.start(recorder.append)
        self._frames = RowBuffer(frames, recorder.append, hold_ns=hold_ns)
        self._targets = RowBuffer(targets, recorder.append, hold_ns=hold_ns)
        self._scenes = SceneLog(scene_states, recorder, m, hold_ns, self._begin_scene)
        tracker = rig.eye_tracker
        delay_ms = None if tracker is None else tracker.info.gaze_delay_ms
        self.observer = GazeObserver(self._targets, delay_ns=round((delay_ms or 0.0) * NS_PER_MS))
        self._rig = rig
        self.screen = rig.headset if isinstance(rig.headset, OnScreen) else None
        """The display, where participants sit before a screen."""
        placed = (
            None if self.screen is None else PlacedScreen(self.screen.screen, self.screen.place)
        )
        self.surface = Surface(placed, controls, headset_rate_hz)
        """What the participant looks at and answers with."""
        self._stage = stage
        self._recorder = recorder
        self._clock = clock
        self._states = states
        self._controls = controls
        # Devices put batches here from their own threads; the loop takes them out once per frame.
        self._head_inbox: deque[SampleBatch] = deque()
        self._measured_inbox: deque[SampleBatch] = deque()
        self._press_inbox: deque[SampleBatch] = deque()
        self._body_inbox: deque[SampleBatch] = deque()
        self._sound_keys: dict[int, str] = {}
        self._sound_onsets: list[SoundOnset] = []
        self._reflex_input: tuple[SampleBatch, BodyView] | None = None
        self._reflex: Answer | None = None
        self._reflex_lock = threading.Lock()
        self._body_period_ns: int | None = None
        self._levels_01: dict[int, float] = {}
        self._rays: dict[int, Pose] = {}
        self._view: SceneFrame | None = None
        self._frame = FrameInfo(-1, clock.now_ns(), clock.now_ns())
        self.before_ns = 0
        """Session time of the frame before the present one."""
        self.display_fault: Fault | None = None
        self.head = UPRIGHT
        """The head foreseen for the light of the present frame, from which it is drawn."""
        self.head_valid = False
        self.head_seen = False
        self.gaze_tap: list[SampleBatch] | None = None
        # A frame itself needs gaze only to find the head before a screen or to show it in a mirror.
        rests = self.screen is None or not self.screen.is_tracked
        self._can_wait = clock.is_virtual and rests and not stage.schemas
        headset = rig.headset
        self._at_once: PoseAtOnce | None = None
        if self._can_wait and isinstance(headset, PoseAtOnce):
            self._at_once = headset
        # Sounds are heard from where the head is in every frame.
        can_pass = self._at_once is not None and not rig.has_sound
        self._ahead = headset if can_pass and isinstance(headset, FramesAtOnce) else None
        # One that draws, or looks on, is asked for every frame.
        self._geometry = stage if type(stage) is GeometryStage else None
        self._waiting: list[tuple[tuple[object, ...], int]] = []
        self._gaze_may_wait = False
        self.trial_number = -1
        self.frames_done = 0
        self.frames_dropped = 0

    def sink(self, role: str, batch: SampleBatch) -> None:
        """Accept what a device delivers: record it, and keep what the loop needs."""
        self._recorder.append(batch)
        if role == "eye_tracker" and batch.schema.name == GAZE.name:
            if self.screen is not None:
                self.screen.watch(batch)
                batch = self._through_screen(batch)
            self.observer.take(batch)
            self._stage.watch(role, batch)
            if self.gaze_tap is not None:
                self.gaze_tap.append(batch)
        elif role == self._rig.display_role:
            if self._at_once is None and batch.schema.name == HEAD.name:
                self._head_inbox.append(batch)
            elif self._at_once is None and batch.schema.name == HEAD_MEASURED.name:
                self._measured_inbox.append(batch)
        elif role == "responses":
            if batch.schema.name == POINTER.name:
                self._take_rays(batch)
            else:
                self._press_inbox.append(batch)
        elif role == "sound":
            self._take_sounds(batch)
        elif role == "body_tracker":
            self._stage.watch(role, batch)
            self._body_inbox.append(batch)

    def _through_screen(self, batch: SampleBatch) -> SampleBatch:
        """Return gaze into the scene that a screen shows; gaze itself where there is none."""
        if self.screen is None:
            return batch
        return gaze_through_screen(batch, self.screen.screen, self.screen.place, self.head)

    @property
    def t_ns(self) -> int:
        """Session time of the present frame."""
        return self._frame.t_ns

    @property
    def current_view(self) -> SceneFrame | None:
        """What the participant is shown now."""
        return self._view

    def glance(self) -> Glance | None:
        """Return a small picture of what the participant saw; None without a new one."""
        return self._stage.glance()

    def play_sound(self, step: PlaySound) -> None:
        """Play a sound and note in the recording which it is."""
        number = self._rig.play_sound(step)
        x_m, y_m, z_m = step.at_m or (None, None, None)
        self._recorder.event(
            "sound",
            self.t_ns,
            number=number,
            sound=step.sound.name,
            sound_sha256=step.sound.sha256,
            seconds=step.sound.duration_s,
            gain_db=step.gain_db,
            loops=step.loops,
            x_m=x_m,
            y_m=y_m,
            z_m=z_m,
        )
        if number is None:
            self._sound_onsets.append(SoundOnset(step.key, None))
        else:
            self._sound_keys[number] = step.key

    def show(self, view: SceneFrame) -> None:
        """Show this from the coming frame on."""
        self._view = view

    def show_scene(self, scene: Scene) -> None:
        """Show a scene whose agents, if any, are still."""
        n = len(scene.agents)
        facing = np.array([a.facing for a in scene.agents]).reshape(n, 3)
        self._view = SceneFrame(scene, self.t_ns, facing, np.ones(n))

    def next(
        self,
        quiet_until_ns: int = 0,
        update: Callable[[FrameView], SceneFrame | None] | None = None,
        watch: FaultWatch | None = None,
    ) -> FrameView:
        """Draw the present view, wait for the next frame and return what it brought.

        On a virtual clock, with a `watch`, frames before `quiet_until_ns` are passed that bring
        nothing but head and gaze that can wait; each is recorded as if it had been returned, and
        `update` says what to show after it. One in which the watch is due is returned, unless it is
        known that it finds nothing.
        """
        if watch is None or self._at_once is None or not self._gaze_may_wait:
            return self._frame_view(self._begin_frame())
        idle_until_ns = 0
        has_news = bool(self._press_inbox or self._sound_onsets)
        while True:
            if not has_news:
                self._pass_together(quiet_until_ns, update, watch)
                until_ns = min(quiet_until_ns, watch.check_due_ns)
                idle_until_ns = min(until_ns, self._rig.idle_until_ns())
            frame = self._begin_frame()
            if frame.t_ns < idle_until_ns and self._rig.is_idle(frame.t_ns):
                view = self._idle_frame_view(frame)
                is_over = False
            else:
                view = self._frame_view(frame)
                is_over = frame.t_ns >= min(quiet_until_ns, watch.check_due_ns)
            if is_over or comes_back(view, update):
                return view
            has_news = False
            shown = None if update is None else update(view)
            if shown is not None:
                self._view = shown

    def _pass_together(
        self,
        until_ns: int,
        update: Callable[[FrameView], SceneFrame | None] | None,
        watch: FaultWatch,
    ) -> None:
        """Pass frames in which no device but the eye tracker has anything to do all at once, where
        headset and plan can tell them ahead; what is recorded is what each would have recorded.
        """
        headset, stage, view = self._ahead, self._geometry, self._view
        if headset is None or stage is None or view is None or not self._rig.gaze_waits_until_ns():
            return
        last_view = self._scenes.view
        if last_view is None or last_view.scene is not view.scene:
            return
        if update is not None and not isinstance(update, UpdateAhead):
            return
        stop = None if update is None else update.stop
        tracker: object = self._rig.eye_tracker
        if stop is not None and not isinstance(tracker, GazeAhead):
            return
        until_ns = min(until_ns, self._rig.display_waits_until_ns())
        until_ns = min(until_ns, self._rig.others_idle_until_ns())
        ahead = headset.frames_ahead(until_ns, MAX_WAITING - len(self._waiting))
        if ahead is None:
            return
        pictures: Pictures | None = None
        if update is not None:
            pictures = update.ahead(ahead.t_ns, ahead.poses[:, 1, :3].astype(np.float64))
            if pictures is None:
                return
        n = len(ahead.t_ns)
        if stop is not None and isinstance(tracker, GazeAhead):
            n = self._frames_before_stop(tracker, ahead, stop)
        if n and watch.check_due_ns <= ahead.t_ns[n - 1] and not watch.is_calm():
            n = bisect_left(ahead.t_ns, watch.check_due_ns, 0, n)
        if n:
            n = self._see_together(headset, stage, ahead, pictures, n)
        if not n:
            return
        before = self._frame
        if view is not last_view:
            self._scenes.add(view, self.t_ns)
        n = self._wait_together(headset, ahead, n, watch)
        last = self._frame
        self._rig.is_idle(last.t_ns)
        if pictures is None:
            states = [self._scenes.state] * n
        else:
            states = self._scenes.add_together(ahead.t_ns, pictures, n)
            if pictures.is_new[: n - 1].any():
                self._view = self._scenes.view
            if pictures.is_new[n - 1]:
                self._view = pictures.after(n - 1)
        self.before_ns = ahead.t_ns[n - 2] if n > 1 else before.t_ns
        self.frames_done += n
        foreseen = headset.head_foreseen()
        assert foreseen is not None  # noqa: S101 - frames ahead are those of a tracked head
        self.head, self.head_valid, self.head_seen = foreseen, True, True
        extents = self.observer.heads.add_together(
            ahead.t_ns[:n], ahead.foreseen_ns[:n], ahead.poses[:n]
        )
        gazes = self._record_together(last.index + 1 - n, ahead, states, extents)
        if pictures is not None and update is not None:
            update.pass_frames(pictures, gazes)
        if len(self._waiting) == MAX_WAITING:
            self.catch_up()

    def _wait_together(
        self, headset: FramesAtOnce, ahead: FramesAhead, n: int, watch: FaultWatch
    ) -> int:
        """Wait for n frames, with what the eye tracker and the watch have to do in some of them;
        return for how many: fewer, where something was found.
        """
        end = 0
        while end < n:
            due_ns = min(self._rig.gaze_waits_until_ns(), watch.check_due_ns)
            first, end = end, min(bisect_left(ahead.t_ns, due_ns, end, n) + 1, n)
            self._frame = headset.pass_frames(ahead.part(first, end), end - first)
            if self._frame.t_ns < due_ns:
                continue
            self._rig.step_gaze()
            if not watch.check():
                break
        return end

    def _frames_before_stop(
        self, tracker: GazeAhead, ahead: FramesAhead, stop: Callable[[GazeView], int | None]
    ) -> int:
        """Return how many coming frames bring no gaze for which a plan waits; 0: not known."""
        self.catch_up()
        batch = tracker.gaze_ahead(ahead.t_ns[-1])
        if batch is None:
            return 0
        batch = self._through_screen(batch)
        gaze_and_frames = self.observer.ahead(batch, ahead.t_ns, ahead.foreseen_ns, ahead.poses)
        if gaze_and_frames is None:
            return 0
        gaze, frame_of = gaze_and_frames
        first = stop(gaze)
        return len(ahead.t_ns) if first is None else int(frame_of[first])

    def _see_together(
        self,
        headset: FramesAtOnce,
        stage: GeometryStage,
        ahead: FramesAhead,
        pictures: Pictures | None,
        n: int,
    ) -> int:
        """Let viewers see what n coming frames show; return how many follow as they were told.

        A frame shows what was new after the one before. As soon as that changes where the head
        goes, or what the hands do, the frames from then on are not those that were told.
        """
        view, light_ns = self._view, self._frame.predicted_display_ns
        last = n - 1
        is_new = [False] * n if pictures is None else pictures.is_new.tolist()
        must_tell = True
        for i, t_ns in enumerate(ahead.t_ns[:n]):
            if pictures is not None and i and is_new[i - 1]:
                view = pictures.after(i - 1)
                must_tell = True
            if must_tell or i == last:
                assert view is not None  # noqa: S101 - the caller looked
                stage.tell(view, light_ns)
                if not headset.holds(ahead) or self._rig.others_idle_until_ns() <= t_ns:
                    return i
            must_tell = False
            light_ns = ahead.light_ns[i]
        return n

    def _record_together(
        self,
        index: int,
        ahead: FramesAhead,
        states: Sequence[int],
        extents: Sequence[tuple[int, int, int, int]],
    ) -> list[GazeView]:
        """Record frames from this index on, and return the gaze that each brought."""
        state, trial = STATE_CODES[self._states.state], self.trial_number
        gazes: list[GazeView] = []
        for i, (scene_state, extent) in enumerate(zip(states, extents, strict=True)):
            t_ns = ahead.t_ns[i]
            row = (index + i, ahead.light_ns[i], state, trial, scene_state, 0)
            if self._rig.eye_tracker is None:
                gazes.append(self.observer.observe(index + i, t_ns))
                self._frames.add((*row, 0), t_ns)
            else:
                late = self.observer.wait_with(index + i, extent, t_ns, self.catch_up)
                gazes.append(cast(GazeView, late))
                self._waiting.append((row, t_ns))
        return gazes

    def _begin_scene(self, scene: Scene) -> None:
        self.catch_up()  # gaze with the scene it was seen in
        self.observer.show(scene)

    def _begin_frame(self) -> FrameInfo:
        """Draw the present view and wait for the next frame."""
        view, before_ns = self._view, self._frame.t_ns
        if view is not None:
            if view is not self._scenes.view:
                self._scenes.add(view, self.t_ns)
            self._display(view)
        frame = self._wait_frame()
        if view is not None and view.window_at is not self._scenes.window_at:
            self._scenes.add_window(view.window_at, before_ns, frame.t_ns)
        return frame

    def _frame_view(self, frame: FrameInfo) -> FrameView:
        """Let the devices deliver, and return what a frame brought."""
        is_put_off = self._rig.step(
            gaze_may_wait=self._gaze_may_wait, head_may_wait=self._at_once is not None
        )
        if self._at_once is None:
            self._take_head()
        else:
            self._take_poses(self._at_once, frame)
        self._rig.hear_from(self.head)
        controls, pressed_ns = self._take_presses() if self._press_inbox else ((), ())
        if is_put_off or self._waiting:
            gaze = self._defer_gaze(frame)
            if not is_put_off:
                self.catch_up()
        else:
            gaze = self._evaluate_gaze(frame)
        return FrameView(
            frame.index,
            frame.t_ns,
            self.head,
            self.head_valid,
            gaze,
            controls,
            self._take_body() if self._body_inbox else None,
            self._pointers(),
            head_points=self.screen is None,
            pressed_ns=pressed_ns,
            sound_onsets=self._take_sound_onsets() if self._sound_onsets else (),
            surface=self.surface,
        )

    def _idle_frame_view(self, frame: FrameInfo) -> FrameView:
        """Return what a frame brought in which no device has anything to do."""
        assert self._at_once is not None  # noqa: S101 - `next` looked
        self._take_poses(self._at_once, frame)
        self._rig.hear_from(self.head)
        return FrameView(
            frame.index,
            frame.t_ns,
            self.head,
            self.head_valid,
            self._evaluate_gaze(frame)
            if self._rig.eye_tracker is None
            else self._defer_gaze(frame),
            pointers=self._pointers(),
            surface=self.surface,
        )

    def _evaluate_gaze(self, frame: FrameInfo) -> GazeView:
        gaze = self.observer.observe(frame.index, frame.t_ns)
        self._frames.add((*self._frame_row(frame), gaze.sample_count), frame.t_ns)
        return gaze

    def _defer_gaze(self, frame: FrameInfo) -> GazeView:
        """Let the gaze of a frame wait; evaluate it when it is read, or no more may wait."""
        late = self.observer.wait(frame.index, frame.t_ns, self.catch_up)
        self._waiting.append((self._frame_row(frame), frame.t_ns))
        if len(self._waiting) == MAX_WAITING:
            self.catch_up()
        return cast(GazeView, late)

    def _pointers(self) -> tuple[Pose, ...]:
        rays = self._rays
        return tuple(rays[hand] for hand in sorted(rays, reverse=True)) if rays else ()

    def _display(self, view: SceneFrame) -> None:
        """Draw and hand over; a failure becomes a fault that pauses the session."""
        trouble: DeviceError | None
        try:
            images = self._stage.draw(view, self._frame, self.head)
            self._rig.headset.submit(self._frame, images)
            self._stage.handed_over()
            trouble = self._stage.trouble()
        except DeviceError as problem:
            trouble = problem
        if trouble is not None:
            self.display_fault = Fault(
                trouble.role or "display",
                "blocking",
                str(trouble).removeprefix(f"{trouble.role}: ").removesuffix(f"; {trouble.remedy}"),
                trouble.remedy,
            )
        else:
            self.display_fault = None

    @contextmanager
    def leaving_gaze(self) -> Iterator[None]:
        """Defer gaze that nobody reads yet, at most to the end of this block."""
        self._gaze_may_wait = self._can_wait
        try:
            yield
        finally:
            self._gaze_may_wait = False
            self.catch_up()

    def catch_up(self) -> None:
        """Evaluate deferred gaze, frame by frame as each frame would have.

        Gaze is deferred on the virtual clock only; the recording is the same.
        """
        if self._waiting:
            self._rig.catch_up()
            waiting, self._waiting = self._waiting, []
            counts = self.observer.observe_waiting()
            if len(waiting) == 1:
                self._frames.add((*waiting[0][0], counts[0]), waiting[0][1])
                return
            self._frames.add_rows(
                [(*row, n) for (row, _), n in zip(waiting, counts, strict=True)],
                [t_ns for _, t_ns in waiting],
            )

    def flush(self) -> None:
        """Hand every held row to the recorder."""
        self.catch_up()
        self._rig.deliver_all()
        self._frames.flush()
        self._targets.flush()
        self._scenes.flush()

    def set_reflex(self, answer: Answer | None) -> None:
        """Answer body samples when they arrive from now on (`protocol.plan.steps.Reflex`)."""
        with self._reflex_lock:
            self._reflex = answer
        self._body_period_ns = None if answer is None else self._rig.body_period_ns
        self._rig.tap_body(None if answer is None else self._answer)

    def _answer(self, batch: SampleBatch) -> None:
        # the lock lets nothing be commanded once the reflex has been ended
        with self._reflex_lock:
            if self._reflex is None:
                return
            view = self._body_view([batch])
            self._reflex_input = (batch, view)
            for step in without_ended_steps(self._reflex(view)):
                if isinstance(step, Play):
                    self._rig.play(step)
                else:
                    self._rig.silence(step.role)

    def _attend(self, period_ns: int) -> None:
        """Take body samples between two frames, at the times when they arrive.

        A late loop takes them up to the next frame, not up to the missed one.
        """
        frame_ns = round(NS_PER_S / self._rig.headset.display_rate_hz)
        frames = max(0, self._clock.now_ns() - self._frame.t_ns) // frame_ns + 1
        until_ns = self._frame.t_ns + frames * frame_ns - BEFORE_FRAME_NS
        while (due_ns := (self._clock.now_ns() // period_ns + 1) * period_ns) < until_ns:
            self._clock.sleep_until_ns(due_ns)
            self._rig.step_body()

    def _wait_frame(self) -> FrameInfo:
        if self._body_period_ns is not None:
            self._attend(self._body_period_ns)
        frame = self._rig.headset.wait_frame()
        self.before_ns = self._frame.t_ns
        self.frames_done += 1
        self.frames_dropped += frame.dropped
        self._frame = frame
        return frame

    def head_at(self, t_ns: int) -> Pose:
        """Return the head at a session time of the last moments, measured where it was."""
        head = self.observer.heads.at(t_ns)
        return self.head if head is None else head[0]

    def _take_head(self) -> None:
        """Take poses, each at the time that it describes."""
        heads = self.observer.heads
        while self._measured_inbox:
            for t_ns, pose in _poses(self._measured_inbox.popleft()):
                if pose is not None:
                    heads.add_measured(t_ns, pose)
        while self._head_inbox:
            for t_ns, pose in _poses(self._head_inbox.popleft()):
                self._take_foreseen(pose, t_ns)
                if pose is not None and self.screen is not None:
                    # before a screen it rests, or is where the tracker found the eyes
                    heads.add_measured(t_ns, pose)

    def _take_poses(self, headset: PoseAtOnce, frame: FrameInfo) -> None:
        # before a screen the head that rests is told for the frame's beginning
        foreseen_ns = frame.predicted_display_ns if self.screen is None else frame.t_ns
        self._take_foreseen(headset.head_foreseen(), foreseen_ns)
        measured = headset.head_measured()
        if measured is not None:
            self.observer.heads.add_measured(frame.t_ns, measured)

    def _take_foreseen(self, pose: Pose | None, t_ns: int) -> None:
        self.head_valid = pose is not None
        if pose is not None:
            self.head = pose
            self.head_seen = True
            self.observer.heads.add_foreseen(t_ns, pose)

    def _take_presses(self) -> tuple[tuple[str, ...], tuple[int, ...]]:
        """Return what was pressed since the frame before, and when that was received."""
        controls: list[str] = []
        pressed_ns: list[int] = []
        while self._press_inbox:
            batch = self._press_inbox.popleft()
            values = batch.values
            for control, level, t_ns in zip(
                values["control"].tolist(),
                values["value_01"].tolist(),
                batch.t_host_ns.tolist(),
                strict=True,
            ):
                before = self._levels_01.get(control, 0.0)
                self._levels_01[control] = level
                # An axis presses once when it passes the middle; a button may report presses only.
                if level > 0.5 and (before <= 0.5 or level == before):
                    controls.append(self._controls[control])
                    pressed_ns.append(t_ns)
        return tuple(controls), tuple(pressed_ns)

    def _take_rays(self, batch: SampleBatch) -> None:
        for row in batch.values:
            hand = int(row["hand"])
            if row["valid"]:
                place = row["position_m"].astype(np.float64)
                self._rays[hand] = Pose(place, row["orientation_wxyz"].astype(np.float64))
            else:
                self._rays.pop(hand, None)

    def _take_sounds(self, batch: SampleBatch) -> None:
        for row in batch.values[batch.values["event"] == BEGAN]:
            key = self._sound_keys.pop(int(row["sound"]), None)
            if key is not None:
                self._sound_onsets.append(SoundOnset(key, int(row["t_sounding_ns"])))

    def _take_sound_onsets(self) -> tuple[SoundOnset, ...]:
        sounds, self._sound_onsets = tuple(self._sound_onsets), []
        return sounds

    def _take_body(self) -> BodyView:
        batches = []
        while self._body_inbox:
            batches.append(self._body_inbox.popleft())
        batch_and_view = self._reflex_input
        if batch_and_view is not None and len(batches) == 1 and batch_and_view[0] is batches[0]:
            return batch_and_view[1]
        return self._body_view(batches)

    def _body_view(self, batches: Sequence[SampleBatch]) -> BodyView:
        if len(batches) == 1:
            values, t_ns = batches[0].values, batches[0].t_host_ns
        else:
            values = np.concatenate([batch.values for batch in batches])
            t_ns = np.concatenate([batch.t_host_ns for batch in batches])
        return BodyView(
            self._rig.segments,
            t_ns,
            values["position_m"].astype(np.float64),
            values["orientation_wxyz"].astype(np.float64),
            values["valid"],
        )

    def _frame_row(self, frame: FrameInfo) -> tuple[object, ...]:
        """Return a row of the frames stream without its last column, the number of gaze samples."""
        return (
            frame.index,
            frame.predicted_display_ns,
            STATE_CODES[self._states.state],
            self.trial_number,
            self._scenes.state,
            frame.dropped,
        )


def _poses(batch: SampleBatch) -> Iterator[tuple[int, Pose | None]]:
    """Yield the time that each pose of a batch describes, and the pose; None: not tracked."""
    values = batch.values
    positions = values["position_m"].astype(np.float64)
    turns = values["orientation_wxyz"].astype(np.float64)
    for i, (t_ns, valid) in enumerate(
        zip(batch.t_device_ns.tolist(), values["valid"].tolist(), strict=True)
    ):
        yield t_ns, Pose(positions[i], turns[i]) if valid else None
