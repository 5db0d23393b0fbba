"""Stamps alone tell the rate, what was lost, and why time goes back, however they were made."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from visavis.lab.sampling import gaps_beyond, sampling_of, step_ns_of, time_returns

Stamps = npt.NDArray[np.int64]


def even(rate_hz: float, n: int) -> Stamps:
    return np.rint(np.arange(n) * 1e9 / rate_hz).astype(np.int64)


def without(t_ns: Stamps, share: float, seed: int) -> tuple[Stamps, int]:
    """Stamps of which some are lost at random, first and last stay; and how many are lost."""
    stays = np.random.default_rng(seed).random(len(t_ns)) >= share
    stays[[0, -1]] = True
    return t_ns[stays], int((~stays).sum())


@settings(max_examples=40, deadline=None)
@example(rate_hz=30, share=0.2, seed=85)  # stamps happen to stay rather near a line
@example(rate_hz=1000, share=0.05, seed=693)
@example(rate_hz=1000, share=0.01, seed=1231)
@given(
    rate_hz=st.sampled_from([30, 60, 90, 120, 200, 250, 500, 1000, 1250]),
    share=st.sampled_from([0.0, 0.01, 0.05, 0.1, 0.2, 0.3]),
    seed=st.integers(0, 99),
)
def test_what_is_lost_at_random_is_counted_and_does_not_change_the_rate(
    rate_hz: int, share: float, seed: int
) -> None:
    t_ns, lost = without(even(rate_hz, 2000), share, seed)
    sampling = sampling_of(t_ns)
    assert pytest.approx(rate_hz, rel=1e-3) == sampling.rate_hz
    assert lost == sampling.missing.sum()


@settings(max_examples=40, deadline=None)
@given(
    rate_hz=st.floats(60, 240),
    tick_ms=st.sampled_from([1, 2, 4]),
    hole=st.integers(0, 60),
)
def test_a_host_that_stamps_by_ticks_loses_nothing_but_what_is_lost(
    rate_hz: float, tick_ms: int, hole: int
) -> None:
    tick = tick_ms * 1_000_000
    t_ns = even(rate_hz, 2000) // tick * tick
    t_ns = np.delete(t_ns, slice(800, 800 + hole))
    sampling = sampling_of(np.unique(t_ns))
    assert pytest.approx(rate_hz, rel=5e-3) == sampling.rate_hz
    # Within a tick nobody can tell: a hole of n samples counts as n, one more or one less.
    assert abs(int(sampling.missing.sum()) - hole) <= (2 if hole else 0)


@settings(max_examples=30, deadline=None)
@example(rate_hz=50, packet=26, lost=2, seed=0)  # losses of more than a second
@example(rate_hz=50, packet=16, lost=5, seed=7)  # a loss where a stretch begins
@example(rate_hz=50, packet=22, lost=5, seed=8)  # a loss in each of three blocks is no other rate
@given(
    rate_hz=st.sampled_from([50, 100, 250, 500]),
    packet=st.integers(2, 40),
    lost=st.integers(0, 5),
    seed=st.integers(0, 99),
)
def test_packets_are_no_gaps_and_lost_packets_are(
    rate_hz: int, packet: int, lost: int, seed: int
) -> None:
    k = np.arange(packet * 120)
    t_ns = even(rate_hz, len(k))[k // packet * packet] + k % packet * 40_000
    gone = np.random.default_rng(seed).choice(np.arange(10, 110, 5), lost, replace=False)
    sampling = sampling_of(t_ns[~np.isin(k // packet, gone)])
    assert pytest.approx(rate_hz, rel=0.02) == sampling.rate_hz
    assert (lost, lost * packet) == (sampling.gaps, sampling.missing.sum())


def test_steps_of_one_and_two_ticks_at_random_are_a_host_and_triples_are_loss() -> None:
    rng = np.random.default_rng(7)
    ticks = rng.choice([4_000_000, 8_000_000], 1600, p=[0.76, 0.24])
    t_ns = np.cumsum(ticks)
    assert 0 == sampling_of(t_ns).missing.sum()
    assert pytest.approx(1e9 / ticks.mean(), rel=1e-3) == sampling_of(t_ns).rate_hz
    lost, count = without(even(250, 2000), 0.2, 3)
    assert (pytest.approx(250), count) == (
        sampling_of(lost).rate_hz,
        sampling_of(lost).missing.sum(),
    )


def test_a_change_of_rate_is_no_loss() -> None:
    slow = even(60, 1000)
    t_ns = np.concatenate([slow, slow[-1] + 16_666_667 + even(120, 1000)])
    sampling = sampling_of(t_ns)
    assert [60, 120] == [round(rate) for rate in sampling.rates_hz]
    assert 0 == sampling.missing.sum()
    assert abs(sampling.stretches[1].first - 1000) <= 1


def test_a_pause_parts_stretches_and_leaves_the_rate() -> None:
    t_ns = np.concatenate([even(50, 1500), 130_000_000_000 + even(50, 1500)])
    sampling = sampling_of(t_ns)
    assert [(0, 1500), (1500, 3000)] == [(s.first, s.after) for s in sampling.stretches]
    assert pytest.approx(50.0) == sampling.rate_hz


@settings(max_examples=60, deadline=None)
@given(
    rate_hz=st.sampled_from([30, 60, 120, 250, 500, 1000, 2000]),
    blocks=st.integers(2, 40),
    block_s=st.floats(1.0, 4.0),
    spread=st.sampled_from([0.0, 0.05, 0.6]),
    seed=st.integers(0, 99),
)
def test_pauses_between_blocks_leave_the_rate_however_many_and_regular_they_are(
    rate_hz: int, blocks: int, block_s: float, spread: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    parts, begin = [], 0
    for _ in range(blocks):
        # As long as packets may be, blocks and packets cannot be told apart from stamps alone.
        n = max(
            round(block_s * rate_hz * (1 + spread * rng.uniform(-1, 1))), 300 if blocks > 9 else 8
        )
        parts.append(begin + even(rate_hz, n))
        begin = int(parts[-1][-1]) + round(1e9 * (1.5 + spread * rng.uniform(-0.4, 2)))
    sampling = sampling_of(np.concatenate(parts))
    assert pytest.approx(rate_hz, rel=1e-3) == sampling.rate_hz
    assert sampling.is_even
    assert blocks - 1 == sampling.gaps


def test_few_stamps_are_not_judged_and_equal_ones_are_refused() -> None:
    assert np.isnan(sampling_of(even(100, 2)).rate_hz)
    assert np.isnan(step_ns_of(even(100, 1)))
    with pytest.raises(ValueError, match="repeat or go back"):
        sampling_of(np.array([0, 5, 5, 9]))


def test_packets_of_a_labs_own_device_are_no_gaps() -> None:
    k = np.arange(2000)
    packets = even(100, 2000)[k // 10 * 10] + k % 10 * 50_000
    assert 0 == gaps_beyond(packets, 15e6)
    assert 1 == gaps_beyond(np.delete(packets, slice(500, 510)), 15e6)
    assert 2 == gaps_beyond(np.delete(even(100, 2000), [300, 700]), 15e6)


# ---- time that goes back -----------------------------------------------------------------------


@settings(max_examples=50, deadline=None)
@given(
    rows=st.lists(st.integers(64, 400), min_size=2, max_size=4),
    rate_hz=st.sampled_from([60, 120, 500]),
)
def test_programs_that_were_started_again_are_new_recordings(rows: list[int], rate_hz: int) -> None:
    rows = sorted(rows)  # each begins within the time of the one before
    t_ns = np.concatenate([even(rate_hz, n) for n in rows])
    returns = time_returns(t_ns)
    assert tuple(np.cumsum(rows)[:-1]) == returns.restarts
    assert {"new recording"} == set(returns.reasons)


@settings(max_examples=30, deadline=None)
@given(before_s=st.integers(100, 10**6), rows=st.integers(64, 400))
def test_a_clock_that_was_set_back_is_told_apart(before_s: int, rows: int) -> None:
    t_ns = np.concatenate([before_s * 10**9 + even(120, 600), even(120, rows)])
    returns = time_returns(t_ns)
    assert ((600,), ("clock reset",)) == (returns.restarts, returns.reasons)


@settings(max_examples=50, deadline=None)
@given(
    at=st.integers(10, 700), size=st.integers(1, 60), way=st.sampled_from(["packet", "eyes", "row"])
)
def test_rows_that_came_late_are_disorder(at: int, size: int, way: str) -> None:
    t_ns = even(120, 960)
    if way == "eyes":
        t_ns = np.stack([t_ns + 3_000_000, t_ns], axis=1).ravel()
    elif way == "packet":
        late = t_ns[at : at + size].copy()
        t_ns[at : at + size] = t_ns[at + size : at + 2 * size].copy()
        t_ns[at + size : at + 2 * size] = late
    else:
        t_ns[at] = t_ns[at // 2]
    returns = time_returns(t_ns)
    assert () == returns.restarts
    assert returns.disorder


@pytest.mark.parametrize("n", [5, 6, 7])
def test_few_stamps_of_which_most_are_far_apart_have_the_usual_of_their_steps(n: int) -> None:
    usual_ns, long_ns = 6_000_000, 60_000_000
    steps = [long_ns] * (n - 3) + [usual_ns] * 2
    t_ns = np.concatenate([[0], np.cumsum(steps)])
    assert usual_ns == step_ns_of(t_ns)
