"""Perform one trial: run its plan frame by frame and write its row."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from visavis.devices.contracts import ClockPair
from visavis.lab.clock import NS_PER_S
from visavis.lab.schema import SampleBatch
from visavis.protocol.people.simulated_participant import Learner
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import (
    Ask,
    AskReply,
    EndEarly,
    FrameView,
    Hush,
    Mark,
    NextFrame,
    Plan,
    Play,
    PlaySound,
    Prompt,
    Reflex,
    Repeat,
    Row,
    Show,
    Silence,
    TrialInterrupted,
    Vibrate,
)
from visavis.protocol.session.calibration_record import NO_CALIBRATION, CalibrationInForce
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.operator_desk import OperatorDesk
from visavis.protocol.session.progress import FINAL_STATUSES
from visavis.protocol.session.rig import RunningRig
from visavis.protocol.session.session_setup import SessionSetup
from visavis.protocol.session.states import SessionState
from visavis.stimuli.panels import PanelFrame
from visavis.stimuli.scene import SceneFrame

ALIGNED_WITHIN_NS = 1_000_000


@dataclass(frozen=True)
class Outcome:
    """How a trial ended: "complete", "interrupted", "repeated" or "skipped", and why.

    "repeated": the study has it performed again. "postponed": it was not begun, because something
    has to be done first. `ending` is the end of its block or session that comes with it.
    """

    status: str
    reason: str | None
    ending: EndEarly | None = None


class TrialRunner:
    """Run trials one after another for a session; `on_question` hears that one is asked in the
    dark, when nothing is timed by frames.
    """

    def __init__(
        self,
        setup: SessionSetup,
        loop: FrameLoop,
        desk: OperatorDesk,
        rig: RunningRig,
        on_question: Callable[[], None],
    ) -> None:
        self._setup = setup
        self._loop = loop
        self._desk = desk
        self._rig = rig
        self._on_question = on_question
        self._gaze_rate_hz = rig.gaze_rate_hz or 0.0
        self._attempts = dict(setup.progress.attempts)
        self._last_exchange_ns: dict[str, int] = {}
        self._wish: Repeat | EndEarly | None = None
        self._align_gaze()
        self.memory = dict(setup.progress.memory)
        """What a simulated participant had learned at the end of the last trial."""
        self._finished, self._skipped_trials = (
            set(setup.progress.finished),
            set(setup.progress.skipped_trials),
        )
        rates_hz = (rig.headset.display_rate_hz, self._gaze_rate_hz)
        tenths = 2 if rig.has_bands else 1
        self._grid_ns = tenths * NS_PER_S // 10 if all(r % 10 == 0 for r in rates_hz) else NS_PER_S
        self._tell_desk()

    def align(self) -> None:
        """With a simulated participant, wait until display, tracker and bands are in step.

        Displays and trackers repeat their phases every tenth of a second, what keeps an idle band
        alive every fifth.
        A repeated stretch is then sampled at the same phases, so a trial performed again after an
        interruption gives the same data. Sessions with people do not wait. In real time, where
        frames of a runtime lie on no grid of ours, two rounds of the phases are enough.
        """
        if self._setup.participant is None:
            return
        rounds = math.inf if self._setup.clock.is_virtual else 2
        give_up_ns = self._loop.t_ns + rounds * self._grid_ns
        while self._loop.t_ns % self._grid_ns > ALIGNED_WITHIN_NS and self._loop.t_ns < give_up_ns:
            self._desk.next_frame()

    def run(self, trial: Trial, calibration: CalibrationInForce | None) -> Outcome:
        """Perform a trial with the time before it; write its row; return how it ended."""
        setup, loop, desk = self._setup, self._loop, self._desk
        desk.announce(trial)
        self._align_gaze()  # a tracker that went away may have come back with another clock
        # The time before the trial is not part of it: a skip or a pause takes effect at its end.
        self._perform(setup.experiment.intertrial(trial), interruptible=False)
        skip_reason = desk.skip_reason
        if skip_reason is None and desk.must_hold():
            return Outcome("postponed", None)
        self.record_exchanges()
        self._align_gaze()
        attempt = self._attempts.get(trial.trial_id, 0) + 1
        self._attempts[trial.trial_id] = attempt
        loop.trial_number = trial.number
        setup.recorder.event(
            "trial_start", loop.t_ns, trial_id=trial.trial_id, attempt=attempt, block=trial.block
        )
        self._rig.mark(f"trial_start {trial.trial_id} {attempt}", loop.t_ns)
        start_ns = loop.t_ns
        # What is delivered from here to the end of the plan counts for this trial.
        before = self._counts()
        desk.begin_trial(trial, start_ns + int(setup.experiment.trial_s * NS_PER_S))
        loop.gaze_tap = []
        self._wish = None
        if skip_reason is None:
            desk.enter(SessionState.TRIAL)
            row, interruption = self._perform(setup.experiment.run_trial(trial), interruptible=True)
            interruption = interruption or desk.lost_at_end()
        else:
            row, interruption = {}, None
            desk.skip_reason = skip_reason
        # However the plan ended, sounds stop before the end of the trial is marked.
        self._rig.hush()
        outcome = self._outcome(interruption)
        self._rig.mark(f"trial_end {trial.trial_id} {attempt} {outcome.status}", loop.t_ns)
        loop.trial_number = -1
        seen_01, loop.gaze_tap = _eyes_seen_01(loop.gaze_tap or ()), None
        desk.flag_lost_eyes(seen_01)
        loop.flush()
        # Memory and row are recorded last, so that a resumed session repeats a trial without a row.
        self._note_memory(trial)
        if outcome.ending is not None:
            self.note_ending(trial, outcome.ending)
        self._record(
            trial,
            attempt,
            outcome,
            {
                "flags": ";".join(desk.flags),
                **trial.factors,
                **row,
                "t_start_ns": row.get("t_start_ns", start_ns),
                "t_end_ns": row.get("t_end_ns", loop.t_ns),
                **self._delivery_counts(before, start_ns),
                **{f"{eye}_eye_seen_01": share_01 for eye, share_01 in seen_01.items()},
                **(calibration.columns(start_ns) if calibration else NO_CALIBRATION),
                "clock_offset_ns": loop.observer.clock_offset_ns if self._rig.eye_tracker else None,
            },
        )
        desk.end_trial(trial)
        self._tell_desk()
        desk.raise_if_aborted()
        return outcome

    def skip(self, trial: Trial, reason: str) -> None:
        """Write the row of a trial that is left out, without performing it."""
        t_ns = self._loop.t_ns
        attempt = self._attempts[trial.trial_id] = self._attempts.get(trial.trial_id, 0) + 1
        self._setup.recorder.event(
            "trial_start", t_ns, trial_id=trial.trial_id, attempt=attempt, block=trial.block
        )
        nothing = {
            "flags": "",
            **trial.factors,
            "t_start_ns": t_ns,
            "t_end_ns": t_ns,
            **self._delivery_counts(self._counts(), t_ns),
            **NO_CALIBRATION,
            "clock_offset_ns": None,
        }
        self._record(trial, attempt, Outcome("skipped", reason), nothing)
        self._tell_desk()

    def note_ending(self, trial: Trial, ending: EndEarly) -> None:
        """Record that a block or the session ends with a trial."""
        self._setup.recorder.event(
            "ended_early",
            self._loop.t_ns,
            trial_id=trial.trial_id,
            block=trial.block,
            of=ending.of,
            reason=ending.reason,
        )

    def _record(self, trial: Trial, attempt: int, outcome: Outcome, columns: Row) -> None:
        """Write a trial's row; note whether the trial is finished by it."""
        if outcome.status in FINAL_STATUSES:
            self._finished.add(trial.trial_id)
            self._skipped_trials.discard(trial.trial_id)
            if outcome.status == "skipped":
                self._skipped_trials.add(trial.trial_id)
        setup = self._setup
        setup.recorder.trial(
            {
                "participant": setup.name.participant,
                "participant_index": setup.plan.participant_index,
                "session": setup.name.session,
                "group": setup.plan.group,
                "part": setup.name.part,
                "trial_id": trial.trial_id,
                "number": trial.number,
                "block": trial.block,
                "is_practice": trial.is_practice,
                "attempt": attempt,
                "status": outcome.status,
                "reason": outcome.reason,
                **columns,
            }
        )

    @property
    def finished(self) -> int:
        """Number of trials that need no repetition: performed or skipped."""
        return len(self._finished)

    def _tell_desk(self) -> None:
        self._desk.trials_skipped = len(self._skipped_trials)
        self._desk.trials_done = self.finished - self._desk.trials_skipped

    def _outcome(self, interruption: str | None) -> Outcome:
        if self._desk.skip_reason is not None:
            return Outcome("skipped", self._desk.skip_reason)
        if interruption is not None:
            return Outcome("interrupted", interruption)
        if isinstance(self._wish, Repeat):
            return Outcome("repeated", self._wish.reason)
        return Outcome("complete", None, self._wish)

    def _perform(self, plan: Plan, *, interruptible: bool) -> tuple[Row, str | None]:
        desk = self._desk
        reply: FrameView | AskReply | None = None
        interruption: str | None = None
        with self._loop.leaving_gaze():
            try:
                step = next(plan)
                while True:
                    if isinstance(step, NextFrame):
                        reply = desk.next_frame(step.quiet_until_ns, step.update)
                        if interruptible and desk.interrupt_reason is not None:
                            interruption = desk.interrupt_reason
                            self._unwind(plan, interruption)
                            return {}, interruption
                    else:
                        reply = self._do(step)
                    step = plan.send(reply)
            except StopIteration as end:
                return (end.value or {}), interruption

    def _unwind(self, plan: Plan, reason: str) -> None:
        try:
            step = plan.throw(TrialInterrupted(reason))
            while True:
                if type(step) is NextFrame:
                    raise RuntimeError("a plan must not ask for frames while it is interrupted")
                step = plan.send(self._do(step))
        except (StopIteration, TrialInterrupted):
            return

    def _do(self, step: object) -> AskReply | None:
        setup, loop = self._setup, self._loop
        match step:
            case Show(view):
                loop.show(view)
                if _asks_in_the_dark(view):
                    self._on_question()
            case Mark(name, payload):
                setup.recorder.event(name, loop.t_ns, **payload)
                self._rig.mark(name, loop.t_ns)
                self._desk.hear(name, payload)
            case Ask(question_id, prompt, options):
                answer = setup.respondent.answer(question_id, prompt, options)
                self._desk.expect_pause()
                return AskReply(answer, loop.t_ns)
            case Prompt(text):
                return AskReply(None, loop.t_ns) if self._desk.prompt(text) else None
            case Vibrate():
                self._rig.vibrate(step)
            case Play():
                self._rig.play(step)
            case PlaySound():
                loop.play_sound(step)
            case Hush():
                self._rig.hush()
            case Silence(role):
                self._rig.silence(role)
            case Reflex(answer):
                loop.set_reflex(answer)
            case Repeat() | EndEarly():
                self._wish = step
            case _:
                raise TypeError(f"a plan yielded {step!r}, which is not a step")
        return None

    def _note_memory(self, trial: Trial) -> None:
        """Record what a simulated participant has learned, on the disk with the trial's row."""
        participant: object = self._setup.participant
        if isinstance(participant, Learner):
            self.memory = dict(participant.memory())
            self._setup.recorder.event(
                "participant_memory",
                self._loop.t_ns,
                trial_id=trial.trial_id,
                memory=self.memory,
            )

    def record_exchanges(self) -> None:
        """Note the time exchanges with each device since the last call, as events."""
        for role, pairs in self._rig.clock_pairs().items():
            last_ns = self._last_exchange_ns.get(role, -1)
            new = [pair for pair in pairs if pair.host_receive_ns > last_ns]
            if new:
                self._last_exchange_ns[role] = new[-1].host_receive_ns
                self._setup.recorder.event(
                    "clock_exchanges",
                    self._loop.t_ns,
                    role=role,
                    send_device_receive_ns=[
                        [p.host_send_ns, p.device_ns, p.host_receive_ns] for p in new
                    ],
                )

    def _align_gaze(self) -> None:
        """Date gaze by the present estimate of the tracker's clock offset."""
        self._loop.observer.align(self._exchanges())

    def _exchanges(self) -> Sequence[ClockPair]:
        tracker = self._rig.eye_tracker
        return () if tracker is None else tracker.clock_pairs()

    def _counts(self) -> tuple[int, int, int, int]:
        loop = self._loop
        return (
            loop.frames_done,
            loop.frames_dropped,
            loop.observer.received_count,
            loop.observer.valid_count,
        )

    def _delivery_counts(self, before: tuple[int, int, int, int], start_ns: int) -> dict[str, int]:
        frames, dropped_frames, received_samples, valid_samples = (
            now - then for now, then in zip(self._counts(), before, strict=True)
        )
        expected_samples = round((self._loop.t_ns - start_ns) / NS_PER_S * self._gaze_rate_hz)
        return {
            "frames": frames,
            "frames_dropped": dropped_frames,
            "gaze_expected": expected_samples,
            "gaze_received": received_samples,
            "gaze_valid": valid_samples,
        }


def _eyes_seen_01(batches: Sequence[SampleBatch]) -> dict[str, float]:
    """Return the share of samples that saw each eye; nothing when there was no sample."""
    if not batches:
        return {}
    rows = np.frombuffer(b"".join([b.values.tobytes() for b in batches]), batches[0].schema.dtype)
    if not len(rows):
        return {}
    return {eye: int(rows[f"{eye}_valid"].sum()) / len(rows) for eye in ("left", "right")}


def _asks_in_the_dark(view: SceneFrame) -> bool:
    is_asked = isinstance(view, PanelFrame) and any(panel.choices for panel in view.panels)
    return is_asked and view.scene.brightness_01 <= 0.0
