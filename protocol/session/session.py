"""Perform a session plan for one participant: blocks, trials, breaks, questions."""

from collections import Counter, deque

from visavis.devices.contracts import CalibrationOutcome
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import ConfigError, DeviceError, LabError, RecordingError, SessionAborted
from visavis.protocol.people.simulated_participant import STRETCH_AGAIN, Learner
from visavis.protocol.plan.experiment import (
    AfterPractice,
    Foreseeing,
    Guiding,
    Respondent,
    SelfPaced,
    demands_of,
    spare_roles_of,
)
from visavis.protocol.plan.session_plan import Block, Trial
from visavis.protocol.plan.steps import EndEarly
from visavis.protocol.session.boards import CONFIRM
from visavis.protocol.session.calibration_record import CalibrationInForce
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.gaze_setup import GazeSetup
from visavis.protocol.session.operator import Action
from visavis.protocol.session.operator_desk import LOST_STREAM_NS, OperatorDesk
from visavis.protocol.session.panel_questions import PanelRespondent, show_board
from visavis.protocol.session.progress import remaining_trials
from visavis.protocol.session.questioning import Questioning
from visavis.protocol.session.rig import RunningRig
from visavis.protocol.session.session_setup import SessionSetup
from visavis.protocol.session.states import SessionState, StateMachine
from visavis.protocol.session.trial_runner import Outcome, TrialRunner
from visavis.stimuli.panels import board_before

OFF = "The headset may come off."
MAX_CALIBRATIONS = 3
"""Calibration attempts before the session goes on with the best one and says so."""
SAY_AFTER_NS = 400 * NS_PER_MS
"""A wait in the dark this long is explained to whoever waits."""

STRETCH_CALIBRATION = 200_000
STRETCH_QUESTIONS = 300_000
STRETCH_VALIDATION = 50
STRETCH_DRIFT = 400_000
STRETCH_PRACTICE = 100_000


class Session:
    """Own the course of one session (or of what is left of it)."""

    def __init__(self, setup: SessionSetup) -> None:
        self._setup = setup
        self._states = StateMachine()
        self._recorder = setup.recorder
        self._participant = setup.participant
        self._calibration: CalibrationInForce | None = None
        self._calibrations = setup.progress.calibrations
        self._owes_calibration = False
        self._drift_checks = 0
        self._trials_since_check = 0
        self._queue: deque[Trial] = deque()
        self._again = Counter(setup.progress.again)
        self._endings = dict(setup.progress.endings)
        self._practice_rounds = 1 + setup.progress.further_practice
        self._trials_left: deque[Trial] = deque()
        self._foreseen_trial: Trial | None = None

    @property
    def state(self) -> SessionState:
        """What the session is doing."""
        return self._states.state

    def run(self) -> None:
        """Perform the plan to its end.

        The stage outlives the devices: a headset's runtime frees its images in the stage's context.

        Raises:
            SessionAborted: the operator ended it; everything finished is kept, resumable.
            DeviceError: a device is missing or stayed away; resumable as well.
        """
        try:
            self._run_on_devices()
        finally:
            self._setup.stage.close()

    def _run_on_devices(self) -> None:
        setup = self._setup
        self._states.move(SessionState.PREFLIGHT)
        deliver: list[FrameLoop] = []
        with RunningRig(setup.rig, setup.clock, lambda r, b: deliver[0].sink(r, b)) as rig:
            for schema in rig.schemas():
                self._recorder.declare(schema)
            if setup.listeners.on_open is not None:
                setup.listeners.on_open(rig.infos())
            loop = FrameLoop(
                setup.experiment,
                rig,
                rig.headset.display_rate_hz,
                rig.gaze_rate_hz,
                rig.controls(),
                setup.stage,
                self._recorder,
                setup.clock,
                self._states,
            )
            deliver.append(loop)
            self._loop = loop
            self._rig = rig
            self._gaze_rate_hz = rig.gaze_rate_hz or 0.0
            self._desk = OperatorDesk(setup, loop, rig, self._states)
            self._questioning = Questioning(setup, loop, self._asking())
            self._runner = TrialRunner(setup, loop, self._desk, rig, self._foresee_next)
            if self._calibrates:
                self._gaze_setup = self._new_gaze_setup()
            for fault in rig.preflight(demands_of(setup.experiment)):
                self._desk.report(fault)
            rig.start()
            try:
                self._perform()
                loop.flush()
                self._runner.record_exchanges()
            except LabError as error:
                self._end_early(error)
                raise
            except BaseException:
                # Ended from the keyboard, by the system or by a defect: keep buffered rows, too.
                loop.flush()
                raise

    @property
    def _calibrates(self) -> bool:
        is_there = "eye_tracker" not in self._desk.accepted_absences
        return is_there and any(block.calibrate for block in self._setup.plan.blocks)

    def _end_early(self, error: LabError) -> None:
        is_abort = isinstance(error, SessionAborted)
        if not isinstance(error, RecordingError):  # a failed recording takes no more data
            self._loop.flush()
            self._runner.record_exchanges()
            name = "session_aborted" if is_abort else "session_failed"
            self._recorder.event(name, self._loop.t_ns, message=str(error))
        self._states.move(SessionState.ABORTED if is_abort else SessionState.FAILED)

    def _asking(self) -> Respondent:
        """Return who answers questionnaires: on boards in the scene, where the stage does that."""
        setup, desk = self._setup, self._desk
        if not setup.stage.asks:
            return setup.respondent
        return PanelRespondent(
            self._loop,
            self._recorder,
            desk.next_frame,
            desk.take_answers,
            setup.respondent,
            lambda: setup.experiment.blank(None),
            self._participant,
            words=setup.board_words,
        )

    def _new_gaze_setup(self) -> GazeSetup:
        setup, tracker = self._setup, self._rig.eye_tracker
        if tracker is None:
            raise ConfigError(
                f"{setup.experiment.name} calibrates gaze, but no eye_tracker is configured; "
                "add the role with its driver under devices in lab_config.yaml"
            )
        return GazeSetup(
            setup.experiment,
            self._loop,
            tracker,
            self._participant,
            self._desk.next_frame,
            setup.timing,
        )

    # ---- the course of the session -----------------------------------------------------------

    def _perform(self) -> None:
        setup = self._setup
        self._loop.show_scene(setup.experiment.blank(None))
        self._trials_left = deque(
            t for block in setup.plan.blocks for t in remaining_trials(block, setup.progress)
        )
        self._foresee_next()
        self._recorder.event(
            "session_start",
            self._loop.t_ns,
            part=setup.name.part,
            resumed=setup.progress.is_resumed,
        )
        for role in sorted(self._rig.without):
            self._recorder.event("device_done_without", self._loop.t_ns, role=role)
            self._desk.say(f"without {role}; every trial is flagged")
        if self._participant is not None:
            self._participant.wear(0)
            self._participant.prepare(0, self._loop.t_ns)
        self._await_scene()
        has_begun = False
        for block in setup.plan.blocks:
            trials = self._skip_if_ended(block, remaining_trials(block, setup.progress))
            trials = trials or self._further_practice(block)
            if trials:
                if has_begun:
                    self._take_break(block)
                has_begun = True
                self._perform_block(block, trials)
            if None not in self._endings and self._questioning.is_due(block):
                self._begin_questions(block.index)
                self._questioning.ask_after(block)
        if has_begun:
            self._validate_at_end()
        elif not setup.progress.validated_at_end:
            # The tracker was restarted, so a validation now says nothing about earlier trials.
            self._recorder.event("end_validation_missed", self._loop.t_ns)
        self._begin_questions(len(setup.plan.blocks))
        self._questioning.ask_at_end()
        self._states.move(SessionState.FINISHED)
        self._recorder.event("session_end", self._loop.t_ns)

    def _foresee(self, trial: Trial) -> None:
        """Let the stage prepare what the trial shows first; a virtual clock does not need it."""
        experiment = self._setup.experiment
        if trial is self._foreseen_trial or not isinstance(experiment, Foreseeing):
            return
        self._foreseen_trial = trial
        if not self._setup.clock.is_virtual:
            self._setup.stage.foresee(lambda: experiment.first_lit(trial))

    def _foresee_next(self) -> None:
        """Foresee what comes after the present trial, while its questions or others stand."""
        coming = self._queue or self._trials_left
        if coming:
            self._foresee(coming[0])

    def _await_scene(self) -> None:
        """Wait until the scene foreseen is ready, and say that it comes where that lasts."""
        setup, loop, since_ns, is_said = self._setup, self._loop, self._loop.t_ns, False
        if setup.stage.is_preparing:
            loop.show_scene(setup.experiment.blank(None))
        while setup.stage.is_preparing:
            if not is_said and loop.t_ns - since_ns > SAY_AFTER_NS:
                is_said = True
                self._desk.waiting = "The next scene is being made ready."
                board = board_before(loop.head, loop.surface, setup.board_words.coming, ())
                show_board(loop, self._recorder, "coming", board, setup.experiment.blank(None))
            self._desk.next_frame()
        if is_said:
            self._desk.waiting = ""
            loop.show_scene(setup.experiment.blank(None))
            self._recorder.event("panel_answered", loop.t_ns, question="coming", by="stage")

    def _begin_questions(self, after: int) -> None:
        """Begin the questions; answers do not depend on a resumption before them."""
        self._states.move(SessionState.QUESTIONNAIRE)
        self._foresee_next()
        if self._participant is not None:
            self._participant.prepare(STRETCH_QUESTIONS + after, self._loop.t_ns)

    def _take_break(self, block: Block) -> None:
        self._desk.leave_trial()
        self._states.move(SessionState.BREAK)
        self._loop.show_scene(self._setup.experiment.blank(None))
        self._recorder.event("break_start", self._loop.t_ns, before_block=block.index)
        self._recorder.checkpoint(timeout_s=5.0)
        words, experiment = self._setup.board_words.pause, self._setup.experiment
        if isinstance(experiment, Guiding):
            words = experiment.pause_before(self._setup.plan, block) or words
        self._let_read("break", words, f"Break before {self._name_of(block)}. {OFF}")
        self._recorder.event("break_end", self._loop.t_ns, before_block=block.index)

    def _name_of(self, block: Block) -> str:
        """Return the name of a block for the operator, which may give conditions away."""
        return f"Block {block.index + 1}" if self._setup.blind else block.name

    def _let_read(self, name: str, words: str, prompt: str) -> None:
        """Wait for the operator at a prompt while words stand before participants at a screen.

        In a study whose instructions are read, participants go on by a key.
        """
        loop, experiment, board_words = self._loop, self._setup.experiment, self._setup.board_words
        if not words or loop.surface.screen is None or not self._setup.stage.asks:
            self._desk.wait(prompt)
            return
        is_self_paced = isinstance(experiment, SelfPaced) and experiment.is_self_paced
        hint = board_words.go_on if is_self_paced else ""
        board = board_before(loop.head, loop.surface, words, (), hint=hint)
        show_board(loop, self._recorder, name, board, experiment.blank(None))
        if self._setup.blind and is_self_paced:
            prompt = f"The participant reads words on the screen ({name.replace('_', ' ')})."
        by = self._desk.wait(prompt, controls=CONFIRM if is_self_paced else ())
        loop.show_scene(experiment.blank(None))
        self._recorder.event("panel_answered", loop.t_ns, question=name, by=by)

    def _perform_block(self, block: Block, trials: tuple[Trial, ...]) -> None:
        self._states.move(SessionState.INSTRUCTING)
        if self._participant is not None:
            self._participant.wear(block.index + 1)
        self._recorder.event(
            "block_start",
            self._loop.t_ns,
            block=block.index,
            block_name=block.name,
            trials_left=len(trials),
        )
        self._desk.block_name = self._name_of(block)
        self._let_read("instruction", block.instruction, block.instruction)
        if self._calibrates and (block.calibrate or self._is_uncalibrated(block)):
            self._calibrate(block)
        self._queue = deque(trials)
        while self._queue:
            self._hold_if_needed(block)
            trial = self._queue.popleft()
            if self._trials_left and self._trials_left[0] is trial:
                self._trials_left.popleft()
            outcome = self._one_trial(trial)
            self._trials_since_check += outcome.status != "postponed"
            if outcome.status == "postponed":
                self._queue.appendleft(trial)
            elif outcome.status in ("interrupted", "repeated"):
                self._again[trial.trial_id] += outcome.status == "repeated"
                self._queue.append(trial)
            self._repeat_if_asked()
            if outcome.ending is not None:
                self._end(block, outcome.ending)
            self._hold_if_needed(block)
            if not self._queue:
                self._queue.extend(self._further_practice(block))
        self._recorder.event("block_end", self._loop.t_ns, block=block.index)

    def _end(self, block: Block, ending: EndEarly) -> None:
        """Leave out the trials that an early end leaves in its block; later blocks follow suit."""
        self._endings[block.index if ending.of == "block" else None] = ending.reason
        self._desk.say(f"the {ending.of} ends here: {ending.reason}")
        self._queue = deque(self._skip_if_ended(block, tuple(self._queue)))

    def _skip_if_ended(self, block: Block, trials: tuple[Trial, ...]) -> tuple[Trial, ...]:
        """Return trials to be performed: none of a block or session that has ended early."""
        reason = self._endings.get(block.index, self._endings.get(None))
        if reason is None:
            return trials
        for trial in trials:
            self._runner.skip(trial, reason)
        return ()

    def _further_practice(self, block: Block) -> tuple[Trial, ...]:
        """Return the trials of another round of practice, where the study asks for one."""
        experiment, has_ended = self._setup.experiment, {block.index, None} & set(self._endings)
        if has_ended or not (block.is_practice and isinstance(experiment, Guiding)):
            return ()
        after: AfterPractice = experiment.after_practice(block, self._practice_rounds)
        if after.ends:
            ending = EndEarly(after.ends)
            self._runner.note_ending(block.trials[-1], ending)
            self._end(block, ending)
        if not after.again:
            return ()
        names = [trial.trial_id for trial in block.trials]
        self._recorder.event("practice_again", self._loop.t_ns, block=block.index, trial_ids=names)
        self._again.update(names)
        self._practice_rounds += 1
        self._desk.leave_trial()
        self._states.move(SessionState.INSTRUCTING)
        self._let_read("practice_again", after.again, after.again)
        return block.trials

    def _is_uncalibrated(self, block: Block) -> bool:
        """Tell whether a resumed session has reopened the tracker since it was calibrated."""
        before = (b for b in self._setup.plan.blocks if b.index < block.index)
        return self._calibration is None and any(b.calibrate for b in before)

    def _one_trial(self, trial: Trial) -> Outcome:
        self._states.move(SessionState.INTERTRIAL)
        self._foresee(trial)
        self._await_scene()
        self._runner.align()
        stretch = trial.number + (STRETCH_PRACTICE if trial.is_practice else 0)
        stretch += STRETCH_AGAIN * self._again[trial.trial_id]
        if self._participant is not None:
            # As recorded: what is learned does not depend on time between trials or on breaks.
            if self._runner.memory and isinstance(self._participant, Learner):
                self._participant.remember(self._runner.memory)
            self._participant.prepare(stretch, self._loop.t_ns)
        outcome = self._runner.run(trial, self._calibration)
        if outcome.status != "postponed" and self._setup.listeners.on_trial is not None:
            self._setup.listeners.on_trial(
                trial.trial_id, self._runner.finished, len(self._setup.plan.trials)
            )
        return outcome

    def _repeat_if_asked(self) -> None:
        for trial in self._desk.take_repeats():
            self._recorder.event("trial_repeat", self._loop.t_ns, trial_id=trial.trial_id)
            if trial not in self._queue:
                self._queue.append(trial)

    def _hold_if_needed(self, block: Block) -> None:
        """Wait for devices that are away and for the operator; then see to gaze if needed."""
        calibrate = self._desk.take(Action.RECALIBRATE)
        is_asked = self._desk.take(Action.CHECK_DRIFT)
        if self._desk.device_lost():
            calibrate = self._wait_for_device() or calibrate
        if self._desk.take(Action.PAUSE):
            self._states.move(SessionState.PAUSED)
            self._recorder.event("pause_start", self._loop.t_ns)
            self._desk.wait("Paused.", always=True)
            self._recorder.event("pause_end", self._loop.t_ns)
            calibrate = self._desk.take(Action.RECALIBRATE) or calibrate
            is_asked = self._desk.take(Action.CHECK_DRIFT) or is_asked
        calibrate = calibrate or self._owes_calibration
        if not (self._queue and self._calibrates):  # a break calibrates anyway
            return
        every = self._setup.gaze_checks.drift_check_trials
        is_due = 0 < every <= self._trials_since_check
        if not calibrate and (is_asked or is_due):
            calibrate = self._check_drift(block, moment="operator" if is_asked else "rule")
        if calibrate:
            self._calibrate(block)

    def _wait_for_device(self) -> bool:
        """Wait until no device is missing; tell whether it was away long enough to recalibrate."""
        desk, loop = self._desk, self._loop
        first_fault = desk.blocking_fault()
        if first_fault is None:
            return False
        since_ns = desk.blocking_since_ns
        self._states.move(SessionState.PAUSED)
        self._recorder.event(
            "device_lost", loop.t_ns, role=first_fault.role, message=first_fault.message
        )
        self._recorder.checkpoint(timeout_s=5.0)
        limit_s = self._setup.lost_device_s
        spare = spare_roles_of(self._setup.experiment)
        desk.take_advance()
        give_up_ns = loop.t_ns + int(limit_s * NS_PER_S)
        while (fault := desk.blocking_fault()) is not None:
            if loop.t_ns > give_up_ns:
                raise DeviceError(
                    f"did not come back within {limit_s:.0f} s ({fault.message}). Every finished "
                    "trial is kept",
                    role=fault.role,
                    remedy=f"{fault.remedy.partition(';')[0]}, then continue with `visavis resume`",
                )
            left_s = max(0, give_up_ns - loop.t_ns) // NS_PER_S
            desk.may_do_without = fault.role in spare
            way_on = "; you can go on without it" if desk.may_do_without else ""
            desk.waiting = (
                f"Waiting for {fault.role}: in {left_s} s the session ends, to be resumed. "
                f"Every finished trial is safe{way_on}."
            )
            desk.next_frame()
            if fault.role in spare and desk.take_advance():
                desk.do_without(fault.role)
                self._owes_calibration |= fault.role == "eye_tracker"
                self._recorder.event("device_done_without", loop.t_ns, role=fault.role)
        desk.waiting, desk.may_do_without = "", False
        if first_fault.role in desk.accepted_absences:
            return False
        away_ns = loop.t_ns - since_ns
        self._recorder.event(
            "device_back", loop.t_ns, role=first_fault.role, away_s=round(away_ns / NS_PER_S, 3)
        )
        desk.say(f"{first_fault.role} is back after {away_ns / NS_PER_S:.1f} s")
        return away_ns >= LOST_STREAM_NS

    # ---- calibration -------------------------------------------------------------------------

    def _check_drift(self, block: Block, *, moment: str) -> bool:
        """Check drift of gaze and record it; tell whether gaze is to be calibrated anew."""
        self._states.move(SessionState.VALIDATING)
        self._prepare(STRETCH_DRIFT + self._drift_checks)
        self._drift_checks += 1
        self._trials_since_check = 0
        limit_deg = self._setup.gaze_checks.drift_limit_deg
        check = self._gaze_setup.check_drift(limit_deg)
        is_within = check.is_within(limit_deg)
        correction = check.correction
        self._recorder.event(
            "drift_check",
            self._loop.t_ns,
            block=block.index,
            number=self._drift_checks,
            moment=moment,
            accepted=is_within,
            limit_deg=limit_deg,
            error_deg=_number_or_none(check.error_deg),
            yaw_deg=_number_or_none(check.yaw_deg),
            pitch_deg=_number_or_none(check.pitch_deg),
            seen_01=check.seen_01,
            corrected=correction is not None and correction.succeeded,
            message=None if correction is None else correction.message,
        )
        error = f"{check.error_deg:.1f}°" if check.error_deg == check.error_deg else "not seen"
        self._desk.say(f"drift of gaze: {error} (limit {limit_deg:g}°)")
        return not is_within

    def _calibrate(self, block: Block) -> None:
        best: CalibrationInForce | None = None
        problem: DeviceError | None = None
        for attempt in range(1, MAX_CALIBRATIONS + 1):
            if self._desk.device_lost():
                self._wait_for_device()
            if not self._calibrates:  # the operator goes on without the tracker
                return
            self._states.move(SessionState.CALIBRATING)
            self._prepare(100 * block.index + attempt)
            try:
                outcome = self._gaze_setup.calibrate()
            except DeviceError as error:
                problem = error
                outcome = CalibrationOutcome(succeeded=False, message=str(error))
                self._desk.say(f"calibration failed: {error}")
            self._recorder.event(
                "calibration",
                self._loop.t_ns,
                block=block.index,
                attempt=attempt,
                succeeded=outcome.succeeded,
                message=outcome.message,
                vendor_accuracy_deg=outcome.vendor_accuracy_deg,
                vendor_precision_deg=outcome.vendor_precision_deg,
            )
            self._store_head_fit(block.index, attempt)
            if self._desk.device_lost():
                continue
            calibration = self._validate(block.index, attempt, moment="block_start")
            # The best attempt counts if none is accepted; an accepted one ends the attempts.
            if best is None or _error(calibration) < _error(best):
                best = calibration
            if calibration.verdict.accepted and outcome.succeeded:
                best = calibration
                break
            self._desk.say(f"calibration {attempt} of {MAX_CALIBRATIONS} not good enough: again")
        if not self._calibrates:
            return
        if best is None:
            raise problem or DeviceError(
                f"went away in each of {MAX_CALIBRATIONS} calibrations",
                role="eye_tracker",
                remedy="look at it and its program; then continue with `visavis resume`",
            )
        # Gaze that is mirrored or rotated is a mistake of the setup, which no attempt corrects.
        if best.verdict.is_turned:
            raise DeviceError(
                f"{best.verdict.reason}. Nothing is recorded with it",
                role="eye_tracker",
                remedy="correct axes or mounting of the tracker, then continue with "
                "`visavis resume`",
            )
        if not best.verdict.accepted:
            self._recorder.event(
                "calibration_below_threshold", self._loop.t_ns, reason=best.verdict.reason
            )
            self._desk.say(
                f"going on with the best of {MAX_CALIBRATIONS} calibrations "
                f"({best.verdict.reason}); press C to try again"
            )
        self._owes_calibration = False
        self._trials_since_check = 0
        self._calibration = best
        self._desk.calibration = best

    def _store_head_fit(self, block: int, attempt: int) -> None:
        """Record the fit of the camera to the head, for trackers with a camera on the head."""
        fit, self._gaze_setup.head_fit = self._gaze_setup.head_fit, None
        if fit is not None:
            self._recorder.event(
                "camera_on_head",
                self._loop.t_ns,
                block=block,
                attempt=attempt,
                rotation=[[float(x) for x in row] for row in fit.matrix],
                angle_deg=fit.angle_deg,
                residual_deg=fit.residual_deg,
            )

    def _validate(self, block: int, attempt: int, *, moment: str) -> CalibrationInForce:
        self._states.move(SessionState.VALIDATING)
        # Prepared again, because calibrating never takes the same time.
        self._prepare(100 * block + STRETCH_VALIDATION + attempt)
        points = self._gaze_setup.validate()
        verdict = self._setup.judge_validation(points, self._gaze_rate_hz)
        self._calibrations += 1
        calibration = CalibrationInForce(f"C{self._calibrations:02d}", self._loop.t_ns, verdict)
        fields = {
            "moment": moment,
            "block": block,
            "attempt": attempt,
            "calibration_id": calibration.calibration_id,
            "accepted": verdict.accepted,
            "reason": verdict.reason,
            "accuracy_deg": verdict.accuracy_deg,
            "worst_point_deg": verdict.worst_point_deg,
            "precision_deg": verdict.precision_deg,
            "lost_01": verdict.lost_01,
        }
        self._recorder.event(
            "validation", self._loop.t_ns, **fields, points=[dict(row) for row in verdict.rows]
        )
        if self._setup.listeners.on_validation is not None:
            self._setup.listeners.on_validation(
                {"part": self._setup.name.part, "t_ns": self._loop.t_ns, **fields}
            )
        return calibration

    def _validate_at_end(self) -> None:
        if not self._calibrates:
            return
        self._validate(len(self._setup.plan.blocks), 1, moment="end")

    def _prepare(self, stretch: int) -> None:
        self._runner.align()
        if self._participant is not None:
            self._participant.prepare(STRETCH_CALIBRATION + stretch, self._loop.t_ns)
            # Targets are placed before the head as it now is. What is foreseen of it at the first
            # frame still comes from its movement before, which an interruption changes.
            self._desk.next_frame()
            self._desk.next_frame()


def _number_or_none(number: float) -> float | None:
    """Return a number for the journal; None where it is not known."""
    return number if number == number else None


def _error(calibration: CalibrationInForce) -> float:
    accuracy = calibration.verdict.accuracy_deg
    return float("inf") if accuracy is None else accuracy
