"""What the operator can do while a session runs, and what the session shows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

from visavis.devices.contracts import Fault, Health
from visavis.protocol.plan.steps import FrameView
from visavis.protocol.session.states import SessionState
from visavis.stage.contracts import Glance
from visavis.stimuli.scene import SceneFrame


class Action(StrEnum):
    """What a run-time key asks for."""

    ADVANCE = "advance"
    PAUSE = "pause"
    REPEAT = "repeat"
    SKIP = "skip"
    RECALIBRATE = "recalibrate"
    CHECK_DRIFT = "check_drift"
    NOTE = "note"
    FLAG = "flag"
    SILENCE = "silence"
    ABORT = "abort"
    ANSWER = "answer"
    REASON = "reason"


KEYS = {
    " ": Action.ADVANCE,
    "p": Action.PAUSE,
    "r": Action.REPEAT,
    "s": Action.SKIP,
    "c": Action.RECALIBRATE,
    "d": Action.CHECK_DRIFT,
    "n": Action.NOTE,
    "w": Action.REASON,
    "f": Action.FLAG,
    "x": Action.SILENCE,
    "\x1b": Action.ABORT,
}
"""Run-time keys; SKIP, NOTE and REASON ask for text, ABORT asks whether it is meant. Digits are
ANSWER, with the digit as text: the participant's choice on a board, said aloud. REASON says why the
last flag or pause was."""


@dataclass(frozen=True)
class Command:
    """One finished request of the operator; `text` is the reason or note, `code` the reason among
    those of the lab (`visavis.lab.config.INCIDENTS`).
    """

    action: Action
    text: str = ""
    code: str = ""

    @property
    def why(self) -> str:
        """Code and words in one."""
        return ": ".join(part for part in (self.code, self.text) if part)


@dataclass(frozen=True)
class BodyContact:
    """A part of the participant's body that touches somebody, as reported by a plan's marks.

    `role` is the armband that answers it and `vibrates` whether it may; `person` counts from 0,
    None where nobody is named.
    """

    role: str
    segment: str
    person: int | None
    vibrates: bool


def nothing_drawn() -> None:
    """Return no picture; for a session that draws none."""


@dataclass(frozen=True)
class TrialCounts:
    """Numbers of a session's trials, and the time that the rest takes."""

    done_count: int
    """Trials that are finished."""
    planned_count: int
    """Trials that the plan holds."""
    skipped_count: int = 0
    """Trials that the operator left out."""
    left_s: float = 0.0
    """How long the rest takes, in seconds."""


@dataclass(frozen=True)
class CalibrationStatus:
    """The quality of gaze by the last validation; None before the first."""

    accuracy_deg: float | None = None
    """Mean error of gaze."""
    precision_deg: float | None = None
    """Spread of gaze from sample to sample."""
    age_s: float | None = None
    """Seconds since it was validated."""
    is_planned: bool = True
    """Whether the session calibrates at all."""


@dataclass(frozen=True)
class SessionStatus:
    """Everything an operator's screen shows."""

    state: SessionState
    """What the session does now."""
    participant: str
    """The participant's label."""
    trial_id: str
    """The trial that runs; "" between trials."""
    trials: TrialCounts
    """How far the session has come."""
    block: str
    """The title of the block."""
    condition: str
    """The levels of the trial's factors; "" for an operator who is blinded."""
    trial_left_s: float | None = None
    """How much longer the trial takes; None where that is unknown."""
    health: dict[str, Health] = field(default_factory=dict)
    """How each device's stream is, by role."""
    calibration: CalibrationStatus = CalibrationStatus()
    """How well gaze is measured."""
    faults: tuple[Fault, ...] = ()
    """Faults of devices that hold now."""
    prompt: str = ""
    """The text of a prompt that waits for the operator."""
    waiting: str = ""
    """A wait that needs no operator: for a device that is away, and how much longer."""
    can_go_on: bool = False
    """Whether ADVANCE does anything now."""
    messages: tuple[str, ...] = ()
    """Recent messages."""
    flags: tuple[str, ...] = ()
    """Flags of the trial that runs."""
    frame: FrameView | None = None
    """The input of the last frame; copy its arrays to keep them."""
    scene_frame: SceneFrame | None = None
    """What that frame showed the participant; copy its arrays to keep them."""
    contacts: tuple[BodyContact, ...] = ()
    """Contacts that exist now."""
    contacts_begun: int | None = None
    """How many contacts began in the trial; None where nothing was touched."""
    glance: Callable[[], Glance | None] = nothing_drawn
    """Returns a small picture of what the participant saw, at most twice a second; to be called in
    the session's own thread.
    """


class Operator(Protocol):
    """Whoever runs the session; polled once per frame, never blocks the frame loop."""

    @property
    def status_period_ns(self) -> int:
        """How often `show` wants a status; 0 for never."""
        ...

    def poll(self) -> Sequence[Command]:
        """Return the requests finished since the last call."""
        ...

    def show(self, status: SessionStatus) -> None:
        """Show the present status."""
        ...

    def waits_for_advance(self, prompt: str) -> bool:
        """Tell whether the session must wait for ADVANCE after this prompt."""
        ...


class UnattendedOperator:
    """An operator for simulated studies: nobody watches, so every wait ends at once."""

    status_period_ns = 0

    def poll(self) -> Sequence[Command]:
        """Ask for nothing."""
        return ()

    def show(self, status: SessionStatus) -> None:
        """Show nothing; never called, as the period is 0."""

    def waits_for_advance(self, prompt: str) -> bool:
        """Go on at once."""
        return False
