import pytest

from visavis.protocol.session.states import (
    TRANSITIONS,
    ForbiddenTransition,
    SessionState,
    StateMachine,
)


def test_every_state_has_an_entry_in_the_table() -> None:
    assert set(SessionState) == set(TRANSITIONS)


def test_every_state_but_idle_can_be_reached() -> None:
    reachable = {to for moves in TRANSITIONS.values() for to in moves}

    assert set(SessionState) - {SessionState.IDLE} == reachable


def test_every_unfinished_state_can_be_aborted_and_can_fail() -> None:
    ends = {SessionState.FINISHED, SessionState.ABORTED, SessionState.FAILED}
    for state in set(SessionState) - ends:
        assert {SessionState.ABORTED, SessionState.FAILED} <= TRANSITIONS[state]


@pytest.mark.parametrize("end", [SessionState.FINISHED, SessionState.ABORTED, SessionState.FAILED])
def test_nothing_follows_an_end(end: SessionState) -> None:
    assert frozenset() == TRANSITIONS[end]


def test_a_trial_cannot_start_before_preflight() -> None:
    machine = StateMachine()

    with pytest.raises(ForbiddenTransition, match="from idle to trial"):
        machine.move(SessionState.TRIAL)
    assert SessionState.IDLE is machine.state
