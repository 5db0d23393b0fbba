"""Samples are dated by all exchanges of a recording: through drift, and on both sides of a jump."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab import device_clock
from visavis.lab.device_clock import device_times

SECOND, MS = 10**9, 10**6
LENGTH_S = 300
EPOCH_NS = 94_000 * SECOND


def clock(host_ns, *, drift_ppm=0.0, jumps=()):
    """Return what a device's clock shows; jumps are (session time, by) in s."""
    host_ns = np.asarray(host_ns, np.int64)
    shown = host_ns + EPOCH_NS + np.rint(host_ns * (drift_ppm * 1e-6)).astype(np.int64)
    for at_s, by_s in jumps:
        shown = shown + (host_ns >= at_s * SECOND) * round(by_s * SECOND)
    return shown


def exchanges(rng, *, every_s=0.5, jitter_ms=0.5, until_s=LENGTH_S, **of_clock):
    sent = (np.arange(0, until_s, every_s) * SECOND).astype(np.int64)
    up, down = (100_000 + rng.exponential(jitter_ms * MS, (2, len(sent)))).astype(np.int64)
    return np.stack([sent, clock(sent + up, **of_clock), sent + up + down], axis=1).tolist()


def samples(rng, *, rate_hz=120, until_s=LENGTH_S, **of_clock):
    """Return true session times, stamps, and arrivals 8 ms and more later."""
    taken = (np.arange(until_s * rate_hz) * (SECOND // rate_hz) + SECOND // 7).astype(np.int64)
    arrived = np.maximum.accumulate(
        taken + 8 * MS + rng.exponential(2 * MS, len(taken)).astype(np.int64)
    )
    return taken, clock(taken, **of_clock), arrived


@pytest.mark.parametrize("seed", range(5))
def test_drift_of_50_ppm_is_followed_between_exchanges_half_a_minute_apart(seed):
    rng = np.random.default_rng(seed)
    taken, stamps, arrived = samples(rng, drift_ppm=50.0)

    dated = device_times(stamps, arrived, exchanges(rng, every_s=30.0, drift_ppm=50.0))

    assert np.abs(dated.t_ns - taken).max() < 0.5 * MS
    assert dated.jumps == ()


def test_drift_of_50_ppm_leaves_a_twentieth_of_a_millisecond_with_two_exchanges_a_second():
    rng = np.random.default_rng(1)
    taken, stamps, arrived = samples(rng, drift_ppm=50.0)

    dated = device_times(stamps, arrived, exchanges(rng, drift_ppm=50.0))

    assert np.abs(dated.t_ns - taken).max() < 0.05 * MS
    assert dated.drift_ppm == pytest.approx(-50.0, abs=0.5)
    assert dated.exchanges == 600


def test_a_clock_that_does_not_drift_is_mapped_exactly_where_the_best_exchanges_are():
    rng = np.random.default_rng(2)
    taken, stamps, arrived = samples(rng)
    pairs = exchanges(rng)
    for sent, _, received in pairs[::7]:
        pairs.append([sent, int(clock(sent + 50_000)), sent + 100_000])
        assert received > sent

    assert np.array_equal(device_times(stamps, arrived, pairs).t_ns, taken)


@pytest.mark.parametrize(
    ("by_s", "has_exchanges"),
    [
        (3.5, True),
        (-3.5, True),
        (0.1, True),
        (-0.1, True),
        (9e4, True),
        (3.5, False),
        (-3.5, False),
    ],
)
def test_samples_on_both_sides_of_a_jump_have_their_times(by_s, has_exchanges):
    rng = np.random.default_rng(3)
    jumps = [(200.25, by_s)]
    taken, stamps, arrived = samples(rng, drift_ppm=20.0, jumps=jumps)
    pairs = exchanges(rng, drift_ppm=20.0, jumps=jumps) if has_exchanges else ()

    dated = device_times(stamps, arrived, pairs)

    late_ns = 0 if has_exchanges else 8 * MS  # the least delay is not known without exchanges
    assert np.abs(dated.t_ns - late_ns - taken).max() < (0.1 if has_exchanges else 0.5) * MS
    (jump,) = dated.jumps
    assert jump.by_ns == pytest.approx(by_s * SECOND, abs=2 * MS)
    first_after = taken[taken >= 200.25 * SECOND][0]
    assert jump.t_ns - late_ns == pytest.approx(first_after, abs=MS)


def test_a_clock_that_jumps_there_and_back_has_two_jumps():
    rng = np.random.default_rng(4)
    jumps = [(100.0, 3.5), (101.4, -3.5)]
    taken, stamps, arrived = samples(rng, jumps=jumps)

    dated = device_times(stamps, arrived, exchanges(rng, jumps=jumps))

    assert [3.5, -3.5] == pytest.approx([j.by_ns / SECOND for j in dated.jumps], abs=1e-3)
    assert np.abs(dated.t_ns - taken).max() < 0.5 * MS


def test_one_wrong_answer_among_the_exchanges_is_no_jump():
    rng = np.random.default_rng(5)
    taken, stamps, arrived = samples(rng)
    pairs = exchanges(rng)
    pairs[300][1] += 5 * SECOND

    dated = device_times(stamps, arrived, pairs)

    assert dated.jumps == ()
    assert np.abs(dated.t_ns - taken).max() < 0.1 * MS


def test_slow_exchanges_and_a_stalled_delivery_are_no_jump():
    rng = np.random.default_rng(6)
    taken, stamps, arrived = samples(rng)
    arrived = np.where((taken > 100 * SECOND) & (taken < 102 * SECOND), 102 * SECOND, arrived)
    pairs = exchanges(rng, jitter_ms=20.0)

    assert device_times(stamps, arrived, pairs).jumps == ()
    assert device_times(stamps, arrived).jumps == ()
    assert np.abs(device_times(stamps, arrived, pairs).t_ns - taken).max() < 2 * MS


def test_an_early_temperature_drift_is_followed_by_pieces():
    rng = np.random.default_rng(7)
    taken = np.arange(0, 3600 * SECOND, SECOND // 10)
    warming = 40e-6 * 600 * SECOND * (1 - np.exp(-taken / (600 * SECOND)))
    stamps = taken + EPOCH_NS + np.rint(warming).astype(np.int64)
    up, down = (100_000 + rng.exponential(MS / 2, (2, 3600))).astype(np.int64)
    asked = taken[::10]
    pairs = np.stack([asked - up, stamps[::10], asked + down], axis=1).tolist()

    dated = device_times(stamps, taken + 8 * MS, pairs)

    assert np.abs(dated.t_ns - taken).max() < 0.2 * MS


def test_samples_without_a_stamp_are_dated_by_their_arrival():
    stamps = np.array([10, -(2**63), 30], np.int64) + np.array([0, 0, 0])
    arrived = np.array([110, 120, 130], np.int64)

    assert [110, 120, 130] == device_times(stamps, arrived).t_ns.tolist()


def test_no_samples_have_no_times():
    nothing = np.zeros(0, np.int64)

    assert len(device_times(nothing, nothing, [[0, 5, 10]]).t_ns) == 0


@pytest.mark.parametrize("seed", range(6))
def test_a_late_sample_before_a_loss_is_delay_and_no_jump(seed: int) -> None:
    rng = np.random.default_rng(seed)
    taken, stamps, arrived = samples(rng)
    at = int(np.searchsorted(taken, 60 * SECOND)) + int(rng.integers(500))
    keep = np.ones(len(taken), bool)
    keep[at + 1 : at + 25] = False
    arrived[at] += 400 * MS
    arrived = np.maximum.accumulate(arrived[keep])
    dated = device_times(stamps[keep], arrived)
    assert () == dated.jumps
    rows = np.arange(keep.sum()) != at
    assert np.abs(dated.t_ns - taken[keep])[rows].max() < 20 * MS


@given(st.lists(st.integers(0, 1000), min_size=1, max_size=60), st.integers(1, 12))
def test_the_least_of_a_window_is_that_of_its_samples(offsets: list[int], count: int) -> None:
    offset = np.array(offsets, np.int64)
    host = np.arange(len(offset), dtype=np.int64) * (device_clock.WINDOW_NS // count)
    expected = [min(offsets[max(0, i - count + 1) : i + 1]) for i in range(len(offsets))]
    assert expected == device_clock._recent_minimum(host, offset).tolist()
