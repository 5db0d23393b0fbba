"""Between the operator and the frame loop: requests, prompts, faults, the status shown."""

from devices.contracts import Fault
from lab.clock import NS_PER_S
from lab.errors import SessionAborted
from protocol.calibration_record import CalibrationInForce
from protocol.frame_loop import FrameLoop
from protocol.operator import Action, Command, SessionStatus
from protocol.plan import Trial
from protocol.rig import RunningRig
from protocol.session_setup import SessionSetup
from protocol.states import SessionState, StateMachine
from protocol.steps import FrameView

FAULT_CHECK_FRAMES = 22
"""Device faults are looked at four times a second at 90 Hz."""

LOST_STREAM_NS = 3 * NS_PER_S
"""A blocking fault that lasts this long within a trial interrupts it."""

LATER = frozenset({Action.PAUSE, Action.RECALIBRATE, Action.REPEAT})
"""Requests that wait for the next checkpoint."""


class OperatorDesk:
    """Deliver frames, and with them whatever the operator or a device wants."""

    def __init__(
        self,
        setup: SessionSetup,
        loop: FrameLoop,
        rig: RunningRig,
        states: StateMachine,
        gaze_rate_hz: float,
    ) -> None:
        self._setup = setup
        self._loop = loop
        self._rig = rig
        self._states = states
        self._operator = setup.operator
        self._recorder = setup.recorder
        self._gaze_rate_hz = gaze_rate_hz
        self._pending: set[Action] = set()
        self._advance = False
        self._faults: tuple[Fault, ...] = ()
        self._known: set[tuple[str, str]] = set()
        self._blocking_since_ns: int | None = None
        self._frames_since_check = 0
        self._next_status_ns = 0
        self._messages: list[str] = []
        self._prompt = ""
        self._in_trial = False
        self.interrupt_reason: str | None = None
        self.skip_reason: str | None = None
        self.flags: list[str] = []
        self.block_name = ""
        self.trial: Trial | None = None
        self.trial_end_ns: int | None = None
        self.trials_done = 0
        self.calibration: CalibrationInForce | None = None

    # ---- frames ------------------------------------------------------------------------------

    def next_frame(self) -> FrameView:
        """Return the next frame after acting on requests and faults.

        Raises:
            SessionAborted: the operator ended the session.
        """
        view = self._loop.next()
        for command in self._operator.poll():
            self._act(command)
        self._frames_since_check += 1
        if self._frames_since_check >= FAULT_CHECK_FRAMES:
            self._frames_since_check = 0
            self._look_for_faults()
        period_ns = self._operator.status_period_ns
        if period_ns and view.t_ns >= self._next_status_ns:
            self._next_status_ns = view.t_ns + period_ns
            self._operator.show(self._status())
        return view

    def wait(self, prompt: str, *, always: bool = False) -> None:
        """Let frames pass until the operator goes on; at once when nobody watches."""
        self._advance = False
        self._prompt = prompt
        if self._operator.waits_for_advance(prompt) or (always and self._operator.status_period_ns):
            while not self._advance:
                self.next_frame()
        else:
            self.next_frame()
        self._prompt = ""

    def enter(self, state: SessionState) -> None:
        """Move the session to a state."""
        self._states.move(state)

    # ---- trials ------------------------------------------------------------------------------

    def begin_trial(self, trial: Trial, end_ns: int) -> None:
        """Forget what concerned the trial before."""
        self._in_trial = True
        self.interrupt_reason = None
        self.skip_reason = None
        self.flags = []
        self.trial = trial
        self.trial_end_ns = end_ns
        self._blocking_since_ns = None

    def end_trial(self) -> None:
        """Note that no trial runs."""
        self._in_trial = False
        self.trial_end_ns = None

    def take(self, action: Action) -> bool:
        """Tell whether this was asked for since the last checkpoint, and forget it."""
        if action in self._pending:
            self._pending.discard(action)
            return True
        return False

    # ---- faults ------------------------------------------------------------------------------

    def report(self, fault: Fault) -> None:
        """Record a fault once and tell the operator."""
        key = (fault.role, fault.message)
        if key not in self._known:
            self._known.add(key)
            self._recorder.event(
                "fault",
                self._loop.t_ns,
                role=fault.role,
                severity=fault.severity,
                message=fault.message,
                remedy=fault.remedy,
            )

    def say(self, message: str) -> None:
        """Put a line on the operator's screen."""
        self._messages = [*self._messages[-4:], message]

    def blocking_fault(self) -> Fault | None:
        """Return the first fault that keeps a trial from running, if any."""
        return next((f for f in self._faults if f.severity == "blocking"), None)

    def device_lost(self) -> bool:
        """Look again, and tell whether a device is away."""
        self._look_for_faults()
        return self.blocking_fault() is not None

    def _look_for_faults(self) -> None:
        self._faults = self._rig.faults()
        if not self._faults:
            self._blocking_since_ns = None
            self._known.clear()
            return
        for fault in self._faults:
            self.report(fault)
            if self._in_trial:
                self._flag(f"{fault.role}_{'lost' if fault.severity == 'blocking' else 'warning'}")
        blocking = self.blocking_fault()
        if blocking is None:
            self._blocking_since_ns = None
        elif self._blocking_since_ns is None:
            self._blocking_since_ns = self._loop.t_ns
        elif self._in_trial and self._loop.t_ns - self._blocking_since_ns >= LOST_STREAM_NS:
            self.interrupt_reason = f"{blocking.role}: {blocking.message}"

    def _flag(self, flag: str) -> None:
        if flag not in self.flags:
            self.flags.append(flag)

    # ---- requests ----------------------------------------------------------------------------

    def _act(self, command: Command) -> None:
        action = command.action
        self._recorder.event(
            "operator", self._loop.t_ns, action=action.value, text=command.text or None
        )
        if action is Action.ADVANCE:
            self._advance = True
        elif action is Action.ABORT:
            self.interrupt_reason = "session aborted by the operator"
            self._pending.add(Action.ABORT)
            if not self._in_trial:
                self.raise_if_aborted()
        elif action is Action.SKIP and self._in_trial:
            self.skip_reason = command.text or "no reason given"
            self.interrupt_reason = f"skipped: {self.skip_reason}"
        elif action is Action.REPEAT and self._in_trial:
            self.interrupt_reason = "repeat asked for by the operator"
        elif action in LATER:
            self._pending.add(action)
            self.say(f"{action.value} at the next checkpoint")
        elif action is Action.FLAG:
            if self._in_trial:
                self._flag("operator_flag")
            self.say("moment flagged")
        elif action is Action.NOTE:
            self.say(f"noted: {command.text}")

    def raise_if_aborted(self) -> None:
        """Raise SessionAborted when the operator asked for it."""
        if Action.ABORT in self._pending:
            raise SessionAborted(
                "the session was aborted; every finished trial is kept; "
                "continue with `visavis resume`"
            )

    # ---- status ------------------------------------------------------------------------------

    def _status(self) -> SessionStatus:
        setup = self._setup
        t_ns = self._loop.t_ns
        trial = self.trial
        calibration = self.calibration
        total = len(setup.plan.trials)
        per_trial_s = setup.experiment.trial_s + setup.experiment.intertrial_s
        condition = ""
        if trial is not None and not setup.blind:
            condition = ", ".join(f"{k} {v}" for k, v in trial.factors.items())
        verdict = calibration.verdict if calibration else None
        return SessionStatus(
            state=self._states.state,
            participant=setup.participant_label,
            trial_id=trial.trial_id if trial else "",
            trials_done=self.trials_done,
            trials_planned=total,
            block=self.block_name,
            condition=condition,
            trial_left_s=None
            if self.trial_end_ns is None
            else max(self.trial_end_ns - t_ns, 0) / NS_PER_S,
            session_left_s=max(total - self.trials_done, 0) * per_trial_s,
            health=self._rig.health(),
            accuracy_deg=verdict.accuracy_deg if verdict else None,
            precision_deg=verdict.precision_deg if verdict else None,
            calibration_age_s=(t_ns - calibration.t_ns) / NS_PER_S if calibration else None,
            faults=self._faults,
            prompt=self._prompt,
            messages=tuple(self._messages),
        )


def is_waiting(status: SessionStatus) -> bool:
    """Tell whether the session waits for the operator."""
    return bool(status.prompt) or status.state is SessionState.PAUSED
