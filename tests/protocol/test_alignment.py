"""Stretches of a simulated participant begin in step with the devices, where frames allow it."""

from types import SimpleNamespace

import pytest

from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.protocol.session.trial_runner import TrialRunner

GRID_NS = NS_PER_S // 5


def aligned(
    first_ns: int, period_ns: int, participant: object = "somebody", *, is_virtual: bool = False
) -> int:
    """Return when a runner goes on whose frames come at these times."""
    runner = TrialRunner.__new__(TrialRunner)
    loop = SimpleNamespace(t_ns=first_ns)

    def next_frame() -> None:
        loop.t_ns += period_ns

    runner._setup = SimpleNamespace(
        participant=participant, clock=SimpleNamespace(is_virtual=is_virtual)
    )  # type: ignore[assignment]  # what it asks
    runner._loop = loop  # type: ignore[assignment]  # as above
    runner._desk = SimpleNamespace(next_frame=next_frame)  # type: ignore[assignment]  # as above
    runner._grid_ns = GRID_NS
    runner.align()
    return loop.t_ns


def test_frames_on_the_grid_wait_for_the_next_round() -> None:
    assert aligned(30 * NS_PER_MS, 10 * NS_PER_MS) == GRID_NS


@pytest.mark.parametrize("period_ms", [16, 20, 48])
def test_frames_of_a_runtime_that_never_meet_the_grid_are_not_waited_for(period_ms: int) -> None:
    first_ns = 5 * NS_PER_MS
    waited_ns = aligned(first_ns, period_ms * NS_PER_MS) - first_ns
    assert waited_ns <= 2 * GRID_NS + period_ms * NS_PER_MS


def test_the_virtual_clock_waits_however_long_it_takes() -> None:
    first_ns, period_ns = 5 * NS_PER_MS, 17_000_000
    assert aligned(first_ns, period_ns, is_virtual=True) % GRID_NS <= NS_PER_MS


def test_a_person_waits_for_nothing() -> None:
    assert aligned(5 * NS_PER_MS, 7 * NS_PER_MS, None) == 5 * NS_PER_MS
