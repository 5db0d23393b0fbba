"""Between the operator and the frame loop: requests, prompts, faults, the status shown."""

from collections.abc import Callable, Collection, Mapping
from typing import Any, Literal

from visavis.devices.contracts import Armband, Fault, Health
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import SessionAborted
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import FrameView, comes_back
from visavis.protocol.session.active_faults import ActiveFaults
from visavis.protocol.session.calibration_record import CalibrationInForce
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.operator import (
    Action,
    BodyContact,
    CalibrationStatus,
    Command,
    SessionStatus,
    TrialCounts,
    UnattendedOperator,
)
from visavis.protocol.session.rig import RunningRig
from visavis.protocol.session.session_setup import SessionSetup
from visavis.protocol.session.states import SessionState, StateMachine
from visavis.stimuli.scene import SceneFrame

CONTACT_BEGIN, CONTACT_RENEW, CONTACT_END = "contact_begin", "contact_renew", "contact_end"
"""Marks by which a plan tells what the participant's body touches, with `role` (the armband that
answers), `segment`, `person` and `vibrates`."""

FAULT_CHECK_NS = 200 * NS_PER_MS
"""How often device faults are looked at."""

HEALTH_NS = 200 * NS_PER_MS
"""How old the streams' figures of a status may be: clocks are fitted for them."""

LOST_STREAM_NS = 3 * NS_PER_S
"""A blocking fault that lasts this long within a trial interrupts it."""

EYE_SEEN_AT_LEAST_01 = 0.7
"""A trial that saw an eye in less of its samples is flagged."""

MESSAGE_SHOWN_NS = 30 * NS_PER_S
"""How long a message stays on the operator's screen; a pending request stays until it is done."""

LATER = {
    Action.PAUSE: "pausing before the next trial",
    Action.RECALIBRATE: "recalibrating before the next trial",
    Action.CHECK_DRIFT: "checking drift of gaze before the next trial",
}
"""Requests that wait for the next checkpoint, with the message for the operator."""

OF_GAZE = frozenset({Action.RECALIBRATE, Action.CHECK_DRIFT})
"""Requests that need a session that calibrates gaze."""

STALL_NS = 250 * NS_PER_MS
"""A picture that stands for this long is a stall, not a dropped frame or two."""


class StallWatch:
    """Tell from the times of frames how long the picture stood still."""

    def __init__(self) -> None:
        self._last_ns = 0
        self._allowed = 1

    def allow(self, frames: int) -> None:
        """Do not count the time to the coming frames: something is asked, or made ready."""
        self._allowed = frames

    def skip(self, frames: int, t_ns: int) -> None:
        """Take frames that followed each other without a pause, the last at `t_ns`."""
        if frames:
            self._last_ns, self._allowed = t_ns, max(0, self._allowed - frames)

    def stood_ns(self, t_ns: int) -> int:
        """Return how long the picture stood still before this frame, 0 for no stall."""
        gap_ns, self._last_ns = t_ns - self._last_ns, t_ns
        if self._allowed:
            self._allowed -= 1
            return 0
        return gap_ns if gap_ns >= STALL_NS else 0


def as_reason(stood_ns: int) -> str:
    """Return the length of a stall as the reason in a trial's row."""
    return f"the picture stood still for {stood_ns / NS_PER_S:.1f} s"


class OperatorDesk:
    """Deliver frames, and act on requests of the operator and faults of devices."""

    def __init__(
        self,
        setup: SessionSetup,
        loop: FrameLoop,
        rig: RunningRig,
        states: StateMachine,
    ) -> None:
        self._setup = setup
        self._loop = loop
        self._rig = rig
        self._states = states
        self._operator = setup.operator
        # another kind of operator may ask for something at any frame
        self._is_unattended = type(setup.operator) is UnattendedOperator
        self._recorder = setup.recorder
        self._idle_roles = setup.idle_roles
        self._calibrates = rig.eye_tracker is not None and any(
            block.calibrate for block in setup.plan.blocks
        )
        self._pending: set[Action] = set()
        self._advance = False
        self._faults = ActiveFaults(setup.recorder)
        self._repeats: list[Trial] = []
        self._answers: list[str] = []
        self._last_trial: Trial | None = None
        self.check_due_ns = 0
        """When faults are looked for next (`visavis.protocol.session.frame_loop.FaultWatch`)."""
        self._next_status_ns = 0
        self._health: dict[str, Health] = {}
        self._next_health_ns = 0
        self._messages: list[tuple[int, str]] = []
        self._prompt = ""
        self._in_trial = False
        self._trial_start_ns = 0
        self._has_begun = False
        self._stalls = StallWatch()
        self._contacts: dict[str, BodyContact] = {}
        self._contacts_begun: int | None = None
        self.interrupt_reason: str | None = None
        self.skip_reason: str | None = None
        self.flags: list[str] = []
        self.block_name = ""
        self.waiting = ""
        self.may_do_without = False
        self.trial: Trial | None = None
        self.trial_end_ns: int | None = None
        self.trials_done = self.trials_skipped = 0
        self.calibration: CalibrationInForce | None = None

    # ---- frames ------------------------------------------------------------------------------

    def next_frame(
        self,
        quiet_until_ns: int = 0,
        update: Callable[[FrameView], SceneFrame | None] | None = None,
    ) -> FrameView:
        """Return the next frame after acting on requests and faults.

        Where nobody watches, quiet frames are passed (`NextFrame`).

        Raises:
            SessionAborted: the operator ended the session.
        """
        loop = self._loop
        is_passing = quiet_until_ns > 0 and self._is_unattended
        while True:
            if is_passing:
                frames_before = loop.frames_done
                view = loop.next(quiet_until_ns, update, self)
                self._stalls.skip(loop.frames_done - frames_before - 1, loop.before_ns)
            else:
                view = loop.next()
            stood_ns = self._stalls.stood_ns(view.t_ns)
            if stood_ns and self._in_trial:
                self._note_stall(stood_ns)
            for command in self._operator.poll():
                self._act(command)
            self.check()
            period_ns = self._operator.status_period_ns
            if period_ns and view.t_ns >= self._next_status_ns:
                self._next_status_ns = view.t_ns + period_ns
                self._operator.show(self._status(view))
            if self._advance and self._in_trial and self._prompt:
                return view._replace(went_on=self.take_advance())
            is_quiet = is_passing and view.t_ns < quiet_until_ns
            if not is_quiet or self.interrupt_reason is not None or comes_back(view, update):
                return view
            shown = None if update is None else update(view)
            if shown is not None:
                loop.show(shown)

    def prompt(self, text: str) -> bool:
        """Show what a trial waits for, or nothing; return whether there is no operator to go on."""
        self._advance = False
        goes_on = bool(text) and not self._operator.waits_for_advance(text)
        self._prompt = "" if goes_on else text
        return goes_on

    def wait(
        self, prompt: str, *, always: bool = False, controls: Collection[str] = ()
    ) -> Literal["operator", "keys", "nobody"]:
        """Let frames pass until the operator goes on, or the participant by one of some controls;
        at once when nobody watches. Return who went on.
        """
        self._advance = False
        self._prompt = prompt
        by: Literal["operator", "keys", "nobody"] = "nobody"
        if self._operator.waits_for_advance(prompt) or (always and self._operator.status_period_ns):
            by = "operator"
            while not self._advance:
                view = self.next_frame()
                if any(control in controls for control in view.pressed):
                    by = "keys"
                    break
        else:
            self.next_frame()
        self._prompt = ""
        return by

    def enter(self, state: SessionState) -> None:
        """Move the session to a state."""
        self._states.move(state)

    # ---- trials ------------------------------------------------------------------------------

    def announce(self, trial: Trial) -> None:
        """State which trial comes next."""
        self.trial = trial
        self.interrupt_reason = None
        self.skip_reason = None

    def begin_trial(self, trial: Trial, end_ns: int) -> None:
        """Forget what concerned the trial before."""
        self._in_trial = True
        self._rig.is_muted = self._rig.has_vibrated = False
        self._trial_start_ns = self._loop.t_ns
        self._has_begun = True
        self._contacts.clear()
        self._contacts_begun = None
        self._stalls.allow(2)  # the scene is made and drawn for the first time
        self.announce(trial)
        self.flags = [f"{role}_lost" for role in sorted(self._rig.without)]
        self.trial_end_ns = end_ns

    def end_trial(self, trial: Trial) -> None:
        """Note that this trial was the last one and that none runs."""
        self._in_trial = False
        self._contacts.clear()
        self._prompt = ""
        self.trial_end_ns = None
        self._last_trial = trial

    def hear(self, mark: str, payload: Mapping[str, Any]) -> None:
        """Take from a plan's mark what the operator sees of it: contacts of the body."""
        if mark not in (CONTACT_BEGIN, CONTACT_RENEW, CONTACT_END):
            return
        role, person = str(payload.get("role") or ""), payload.get("person")
        if mark == CONTACT_END:
            self._contacts.pop(role, None)
            return
        if mark == CONTACT_BEGIN:
            self._contacts_begun = (self._contacts_begun or 0) + 1
        self._contacts[role] = BodyContact(
            role,
            str(payload.get("segment") or ""),
            person if isinstance(person, int) else None,
            bool(payload.get("vibrates")),
        )

    def leave_trial(self) -> None:
        """Take the last trial off the screen."""
        self.trial = self._contacts_begun = None

    def take(self, action: Action) -> bool:
        """Tell whether this was asked for since the last checkpoint, and forget it."""
        if action in self._pending:
            self._pending.discard(action)
            text = LATER.get(action)
            self._messages = [message for message in self._messages if message[1] != text]
            return True
        return False

    def take_repeats(self) -> tuple[Trial, ...]:
        """Return the trials to be performed again, and forget them."""
        repeats, self._repeats = tuple(self._repeats), []
        return repeats

    def take_answers(self) -> tuple[str, ...]:
        """Return the digits pressed since the last call, and forget them."""
        answers, self._answers = tuple(self._answers), []
        return answers

    def must_hold(self) -> bool:
        """Tell whether the next trial has to wait."""
        return not self._pending.isdisjoint(LATER) or self.device_lost()

    # ---- faults ------------------------------------------------------------------------------

    def report(self, fault: Fault) -> None:
        """Record a fault once for as long as it holds."""
        self._faults.report(fault, self._loop.t_ns, is_set_up=self._is_set_up)

    @property
    def _is_set_up(self) -> bool:
        # before the first calibration, or trial of a study without one, devices are being set up
        return self.calibration is not None if self._calibrates else self._has_begun

    def say(self, message: str) -> None:
        """Put a line on the operator's screen."""
        self._messages = [*self._messages[-4:], (self._loop.t_ns, message)]

    def blocking_fault(self) -> Fault | None:
        """Return the first fault that keeps a trial from running, if any."""
        return next(iter(self._faults.blocking()), None)

    @property
    def accepted_absences(self) -> frozenset[str]:
        """Roles the operator goes on without: from the beginning, or until they are back."""
        return self._rig.without | self._faults.accepted_absences

    def do_without(self, role: str) -> None:
        """Let trials run although this device is away; each is flagged until it is back."""
        self._faults.accepted_absences.add(role)
        self.say(f"going on without {role}; every trial is flagged until it is back")

    def take_advance(self) -> bool:
        """Tell whether the operator asked to go on, and forget it."""
        advance, self._advance = self._advance, False
        return advance

    @property
    def blocking_since_ns(self) -> int:
        """Session time since which a fault has blocked trials; the present time if none does."""
        since = [self._faults.since_ns(f) for f in self._faults.blocking()]
        return min(since, default=self._loop.t_ns)

    def device_lost(self) -> bool:
        """Look again, and tell whether a device is away."""
        self._look_for_faults()
        return self.blocking_fault() is not None

    def flag_lost_eyes(self, seen_01: Mapping[str, float]) -> None:
        """Flag the trial for each eye ("left", "right") that was seen in too little of it."""
        for eye, share_01 in seen_01.items():
            if share_01 < EYE_SEEN_AT_LEAST_01:
                self._flag(f"{eye}_eye_lost")

    def lost_at_end(self) -> str | None:
        """Look again at the end of a trial; return why its data are cut off, if they are."""
        if self.device_lost():
            self._interrupt_if_lost(0)
        return self.interrupt_reason

    def is_calm(self) -> bool:
        """Tell whether nothing has a fault, nor had one when that was looked at last."""
        return not self._faults.present and not self._faults_now()

    def check(self) -> bool:
        """Look for faults if that is due in the present frame; tell whether there are none."""
        t_ns = self._loop.t_ns
        if t_ns >= self.check_due_ns:
            self.check_due_ns = t_ns + FAULT_CHECK_NS
            self._look_for_faults()
        return not self._faults.present

    def _faults_now(self) -> tuple[Fault, ...]:
        display_fault = self._loop.display_fault
        rig_faults = (f for f in self._rig.faults() if not self._is_idle_uncalibrated(f))
        return (*rig_faults, *(() if display_fault is None else (display_fault,)))

    def _look_for_faults(self) -> None:
        faults = self._faults_now()
        self._faults.look(faults, self._loop.t_ns, is_set_up=self._is_set_up)
        for fault in faults if self._in_trial else ():
            is_idle = fault.role in self._idle_roles and fault.severity == "warning"
            if not is_idle and self._faults.concerns(fault, self._trial_start_ns):
                self._flag(f"{fault.role}_{'lost' if fault.severity == 'blocking' else 'warning'}")
        if self._in_trial:
            self._interrupt_if_lost(LOST_STREAM_NS)

    def _is_idle_uncalibrated(self, fault: Fault) -> bool:
        """Tell whether a fault is a missing calibration of a device the study does not need."""
        return fault.is_uncalibrated and fault.role in self._idle_roles

    def _interrupt_if_lost(self, longest_ns: int) -> None:
        """Interrupt the trial for a device that has been away this long.

        A missing band costs no data: it counts only after `LOST_STREAM_NS`, and only if this trial
        used it.
        """
        for fault in self._faults.blocking():
            patience_ns = longest_ns
            if self._rig.is_band(fault.role):
                if not self._rig.has_vibrated:
                    continue
                patience_ns = LOST_STREAM_NS
            if self._loop.t_ns - self._faults.since_ns(fault) >= patience_ns:
                self.interrupt_reason = f"{fault.role}: {fault.message}"
                return

    def expect_pause(self) -> None:
        """Do not count the time to the next frame as a stall: a question was asked."""
        self._stalls.allow(1)

    def _note_stall(self, stood_ns: int) -> None:
        """Flag a trial in which the picture stood still; interrupt it as for a lost device."""
        self._flag("picture_stalled")
        self._recorder.event("picture_stalled", self._loop.t_ns, stood_ms=stood_ns // NS_PER_MS)
        if stood_ns >= LOST_STREAM_NS and self.interrupt_reason is None:
            self.interrupt_reason = as_reason(stood_ns)

    def _flag(self, flag: str) -> None:
        if flag not in self.flags:
            self.flags.append(flag)

    # ---- requests ----------------------------------------------------------------------------

    def _act(self, command: Command) -> None:
        action = command.action
        self._recorder.event(
            "operator",
            self._loop.t_ns,
            action=action.value,
            text=command.text or None,
            **({"code": command.code} if command.code else {}),
        )
        if action is Action.ADVANCE:
            self._advance = True
        elif action is Action.ABORT:
            self.interrupt_reason = "session aborted by the operator"
            self._pending.add(Action.ABORT)
            if not self._in_trial:
                self.raise_if_aborted()
        elif action in OF_GAZE and not self._calibrates:
            self.say("nothing to calibrate: this study does not measure gaze")
        elif action in LATER:
            self._pending.add(action)
            self.say(LATER[action])
        elif action is Action.ANSWER:
            self._answers.append(command.text)
        elif action is Action.SKIP:
            self._skip(command.why or "no reason given")
            self._flag_code(command)
        elif action is Action.REPEAT:
            self._repeat()
        elif action is Action.SILENCE:
            self._silence()
        elif action is Action.FLAG:
            if self._in_trial:
                self._flag("operator_flag")
            self.say(f"flagged{self._within()}")
        elif action is Action.REASON:
            self._flag_code(command)
            self.say(f"reason noted{self._within()}: {command.why}")
        elif action is Action.NOTE:
            self.say(f"noted{self._within()}: {command.text}")

    def _flag_code(self, command: Command) -> None:
        if self._in_trial and command.code:
            self._flag(command.code)

    def _within(self) -> str:
        return f" in {self.trial.trial_id}" if self._in_trial and self.trial else ""

    def _skip(self, reason: str) -> None:
        if self.trial is None or not (self._in_trial or self._comes_next()):
            self.say("nothing to skip: no trial is running or about to")
            return
        self.skip_reason = reason
        self.say(f"{self.trial.trial_id} is skipped: {reason}")
        if self._in_trial:
            self.interrupt_reason = f"skipped: {reason}"

    def _comes_next(self) -> bool:
        return self._states.state is SessionState.INTERTRIAL

    def _repeat(self) -> None:
        if self._in_trial and self.trial is not None:
            self.interrupt_reason = "repeat asked for by the operator"
            self.say(f"{self.trial.trial_id} is ended and comes again at the end of the block")
        elif self._last_trial is None:
            self.say("nothing to repeat: no trial has been performed yet")
        else:
            if self._last_trial not in self._repeats:
                self._repeats.append(self._last_trial)
            self.say(f"{self._last_trial.trial_id} comes again at the end of the block")

    def _silence(self) -> None:
        """Stop all vibration, in a trial until its end, because the next contact follows soon."""
        armbands = [r for r, d in self._setup.rig.by_role().items() if isinstance(d, Armband)]
        self._rig.is_muted = self._in_trial and bool(armbands)
        self._rig.silence()
        if self._rig.is_muted:
            self._flag("silenced_by_operator")
        until = f", to the end of {self.trial.trial_id}" if self._in_trial and self.trial else ""
        roles = ", ".join(armbands)
        self.say(f"silenced{until if roles else ''}: {roles or 'no haptic device is connected'}")

    def raise_if_aborted(self) -> None:
        """Raise SessionAborted when the operator asked for it."""
        if Action.ABORT in self._pending:
            raise SessionAborted(
                "the session was ended by the operator; every finished trial is kept"
            )

    # ---- status ------------------------------------------------------------------------------

    def _status(self, view: FrameView) -> SessionStatus:
        setup = self._setup
        t_ns = self._loop.t_ns
        trial = self.trial
        calibration = self.calibration
        total = len(setup.plan.trials)
        per_trial_s = setup.experiment.trial_s + setup.experiment.intertrial_s
        condition = ""
        if trial is not None and not setup.blind:
            condition = ", ".join(_factor_words(k, v) for k, v in trial.factors.items())
        verdict = calibration.verdict if calibration else None
        if t_ns >= self._next_health_ns:
            self._health, self._next_health_ns = self._rig.health(), t_ns + HEALTH_NS
        return SessionStatus(
            state=self._states.state,
            participant=setup.name.participant,
            trial_id=trial.trial_id if trial else "",
            trials=TrialCounts(
                done_count=self.trials_done,
                planned_count=total,
                skipped_count=self.trials_skipped,
                left_s=max(total - self.trials_done - self.trials_skipped, 0) * per_trial_s,
            ),
            block=self.block_name,
            condition=condition,
            trial_left_s=None
            if self.trial_end_ns is None or self.trial_end_ns <= t_ns
            else (self.trial_end_ns - t_ns) / NS_PER_S,
            health=self._health,
            calibration=CalibrationStatus(
                accuracy_deg=verdict.accuracy_deg if verdict else None,
                precision_deg=verdict.precision_deg if verdict else None,
                age_s=(t_ns - calibration.t_ns) / NS_PER_S if calibration else None,
                is_planned=any(b.calibrate for b in setup.plan.blocks),
            ),
            faults=self._faults.for_screen(t_ns),
            prompt=self._prompt,
            waiting=self.waiting,
            can_go_on=bool(self._prompt) or self.may_do_without,
            messages=self._messages_now(),
            flags=tuple(self.flags) if self._in_trial else (),
            frame=view,
            scene_frame=self._loop.current_view,
            glance=self._loop.glance,
            contacts=tuple(self._contacts.values()),
            contacts_begun=self._contacts_begun,
        )

    def _messages_now(self) -> tuple[str, ...]:
        waiting = {LATER[action] for action in self._pending & LATER.keys()}
        since_ns = self._loop.t_ns - MESSAGE_SHOWN_NS
        return tuple(text for t_ns, text in self._messages if t_ns >= since_ns or text in waiting)


def _factor_words(name: str, level: object) -> str:
    """Return a level as the operator reads it."""
    if name == "condition":
        return str(level)
    words = name.replace("_", " ")
    if isinstance(level, bool):
        return f"{words}: {'yes' if level else 'no'}"
    return f"{words} {str(level).replace('_', ' ')}"
