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
    """A part of the participant's body that touches somebody, as a plan's marks told it.

    `role` is the armband that answers it and `vibrates` whether it may; `person` counts from 0,
    None where nobody is named.
    """

    role: str
    segment: str
    person: int | None
    vibrates: bool


def nothing_drawn() -> None:
    """Return no picture: that of a session which draws none."""


@dataclass(frozen=True)
class SessionStatus:
    """Everything an operator's screen shows; `condition` is empty when blinded.

    `prompt` is what waits for the operator, `waiting` what is waited for by itself: a device that
    is away, and for how much longer; `can_go_on` tells whether ADVANCE does anything now. `flags`
    are those of the trial that runs, `contacts` what is touched now and `contacts_begun` how often
    that began in it (None where nothing was touched). `frame` is what the last frame brought and
    `shown` what stood before the participant in it: who keeps them longer copies their arrays.
    `glance` returns a small picture of what they saw, twice a second at most, to who asks in the
    session's own thread.
    """

    state: SessionState
    participant: str
    trial_id: str
    trials_done: int
    trials_planned: int
    block: str
    condition: str
    trial_left_s: float | None
    session_left_s: float
    health: dict[str, Health]
    accuracy_deg: float | None
    precision_deg: float | None
    calibration_age_s: float | None
    faults: tuple[Fault, ...]
    prompt: str = ""
    waiting: str = ""
    can_go_on: bool = False
    messages: tuple[str, ...] = field(default_factory=tuple)
    trials_skipped: int = 0
    is_calibrated_first: bool = True
    flags: tuple[str, ...] = ()
    frame: FrameView | None = None
    shown: SceneFrame | None = None
    contacts: tuple[BodyContact, ...] = ()
    contacts_begun: int | None = None
    glance: Callable[[], Glance | None] = nothing_drawn


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
    """Nobody watches: every wait is over at once; used for simulated studies."""

    status_period_ns = 0

    def poll(self) -> Sequence[Command]:
        """Ask for nothing."""
        return ()

    def show(self, status: SessionStatus) -> None:
        """Show nothing; never called, as the period is 0."""

    def waits_for_advance(self, prompt: str) -> bool:
        """Go on at once."""
        return False
