"""A clock has jumped when two time exchanges cannot both be right, however slow they were."""

import pytest

from visavis.devices.contracts import ClockPair
from visavis.devices.drivers.streaming.exchange_log import MAX_KEPT, ExchangeLog
from visavis.lab.clock import NS_PER_MS


def pair(at_ms: float, there_ms: float, back_ms: float, ahead_ms: float = 0.0) -> ClockPair:
    """Return an exchange whose request and answer travelled so long, of a clock that far ahead."""
    at, there, back, ahead = (round(ms * NS_PER_MS) for ms in (at_ms, there_ms, back_ms, ahead_ms))
    return ClockPair(at, at + there + ahead, at + there + back)


@pytest.mark.parametrize("slow", [(200, 1), (1, 200), (200, 200)])
def test_a_slow_exchange_is_no_jump_before_or_after_quick_ones(slow: tuple[float, float]) -> None:
    log = ExchangeLog()
    exchanges = [pair(0, 1, 1), pair(1000, *slow), pair(2000, 1, 1)]
    assert [None] * 3 == [log.add(p) for p in exchanges]
    assert exchanges == log.recent


def test_a_jump_beyond_what_both_round_trips_explain_is_told() -> None:
    log = ExchangeLog()
    log.add(pair(0, 10, 10))
    assert log.add(pair(1000, 10, 10, ahead_ms=39)) is None
    assert 61 == pytest.approx(log.add(pair(2000, 10, 10, ahead_ms=100)))
    assert 1 == len(log.recent)


def test_a_long_session_keeps_the_latest_exchanges_alone() -> None:
    log = ExchangeLog()
    exchanges = [pair(1000 * i, 1, 1) for i in range(3 * MAX_KEPT)]
    assert [None] * len(exchanges) == [log.add(p) for p in exchanges]
    assert MAX_KEPT // 2 <= len(log) <= MAX_KEPT
    assert exchanges[-len(log) :] == log.pairs


def test_the_latest_exchanges_are_those_since_a_jump_when_older_ones_are_gone() -> None:
    log = ExchangeLog()
    for i in range(MAX_KEPT - 4):
        log.add(pair(1000 * i, 1, 1))
    since = [pair(1000 * (MAX_KEPT + i), 1, 1, ahead_ms=100) for i in range(10)]
    assert 1 == sum(log.add(p) is not None for p in since)
    assert since == log.recent
