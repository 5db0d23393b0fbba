"""The states of a session and the only moves between them."""

from collections.abc import Mapping
from enum import StrEnum

from visavis.lab.errors import LabError


class SessionState(StrEnum):
    """What the session is doing."""

    IDLE = "idle"
    PREFLIGHT = "preflight"
    INSTRUCTING = "instructing"
    CALIBRATING = "calibrating"
    VALIDATING = "validating"
    INTERTRIAL = "intertrial"
    TRIAL = "trial"
    PAUSED = "paused"
    BREAK = "break"
    QUESTIONNAIRE = "questionnaire"
    FINISHED = "finished"
    ABORTED = "aborted"
    FAILED = "failed"


S = SessionState
_ENDS = frozenset({S.ABORTED, S.FAILED})
_AFTER_TRIAL = frozenset(
    {
        S.INTERTRIAL,
        S.INSTRUCTING,
        S.PAUSED,
        S.CALIBRATING,
        S.BREAK,
        S.VALIDATING,
        S.QUESTIONNAIRE,
    }
)

TRANSITIONS: Mapping[SessionState, frozenset[SessionState]] = {
    S.IDLE: frozenset({S.PREFLIGHT}) | _ENDS,
    S.PREFLIGHT: frozenset({S.INSTRUCTING, S.VALIDATING, S.QUESTIONNAIRE}) | _ENDS,
    S.INSTRUCTING: frozenset({S.CALIBRATING, S.INTERTRIAL, S.PAUSED, S.INSTRUCTING}) | _ENDS,
    S.CALIBRATING: frozenset({S.VALIDATING, S.CALIBRATING, S.PAUSED}) | _ENDS,
    S.VALIDATING: frozenset(
        {S.CALIBRATING, S.VALIDATING, S.INTERTRIAL, S.QUESTIONNAIRE, S.PAUSED, S.INSTRUCTING}
    )
    | _ENDS,
    S.INTERTRIAL: _AFTER_TRIAL | {S.TRIAL} | _ENDS,
    S.TRIAL: _AFTER_TRIAL | _ENDS,
    S.PAUSED: frozenset(
        {S.INTERTRIAL, S.CALIBRATING, S.VALIDATING, S.INSTRUCTING, S.BREAK, S.QUESTIONNAIRE}
    )
    | _ENDS,
    S.BREAK: frozenset({S.INSTRUCTING, S.PAUSED}) | _ENDS,
    S.QUESTIONNAIRE: frozenset(
        {S.QUESTIONNAIRE, S.FINISHED, S.PAUSED, S.BREAK, S.INSTRUCTING, S.VALIDATING}
    )
    | _ENDS,
    S.FINISHED: frozenset(),
    S.ABORTED: frozenset(),
    S.FAILED: frozenset(),
}


class ForbiddenTransition(LabError):
    """The session tried to move where the table allows no move; a defect in Visavis."""


class StateMachine:
    """Hold the present state and refuse moves the table does not list."""

    def __init__(self) -> None:
        self._state = SessionState.IDLE

    @property
    def state(self) -> SessionState:
        """The present state."""
        return self._state

    def move(self, to: SessionState) -> None:
        """Enter a state.

        Raises:
            ForbiddenTransition: the table does not allow it from here.
        """
        if to not in TRANSITIONS[self._state]:
            raise ForbiddenTransition(f"a session cannot go from {self._state} to {to}")
        self._state = to
