"""Clock offsets are recovered through drift and jitter, and exact when the link is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.devices.contracts import ClockPair
from visavis.lab.clock_fit import fit_clock, fit_one_way, latest_quick, offset_ns
from visavis.lab.errors import DataError

SECOND = 10**9


def exchanges(rng, *, n, offset, drift_ppm=0.0, jitter_ms=0.0, interval_ns=SECOND // 2):
    """Return pairs whose true host-minus-device time is offset + drift · device time."""
    device = SECOND + np.arange(n) * interval_ns
    up, down = (100_000 + rng.exponential(jitter_ms * 1e6, (2, n))).astype(np.int64)
    host = device + offset + np.rint(device * drift_ppm * 1e-6).astype(np.int64)
    return [
        ClockPair(int(h - u), int(d), int(h + w))
        for h, d, u, w in zip(host, device, up, down, strict=True)
    ]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.integers(-(10**15), 10**15), st.floats(-100, 100))
def test_fit_recovers_offset_and_drift_of_a_quiet_link(seed, offset, drift_ppm):
    rng = np.random.default_rng(seed)
    pairs = exchanges(rng, n=60, offset=offset, drift_ppm=drift_ppm)

    fit = fit_clock(pairs)

    device = np.array([p.device_ns for p in pairs])
    truth = device + offset + np.rint(device * drift_ppm * 1e-6).astype(np.int64)
    assert np.abs(fit.to_host_ns(device) - truth).max() <= 3
    assert fit.drift_ppm == pytest.approx(drift_ppm, abs=0.01)


@pytest.mark.parametrize("seed", range(20))
def test_fit_is_within_a_fifth_of_a_ms_at_50_ppm_and_5_ms_jitter(seed):
    rng = np.random.default_rng(seed)
    pairs = exchanges(rng, n=2400, offset=7 * SECOND, drift_ppm=50.0, jitter_ms=5.0)

    fit = fit_clock(pairs)

    device = np.array([p.device_ns for p in pairs])
    truth = device + 7 * SECOND + np.rint(device * 50e-6).astype(np.int64)
    assert np.abs(fit.to_host_ns(device) - truth).max() < 200_000
    assert fit.n_used == 720


@given(st.integers(0, 2**32), st.integers(-(10**15), 10**15))
@settings(deadline=None)
def test_offset_is_exact_when_the_best_exchanges_are(seed, offset):
    rng = np.random.default_rng(seed)
    quiet = exchanges(rng, n=3, offset=offset)
    noisy = exchanges(rng, n=30, offset=offset, jitter_ms=5.0)

    assert offset_ns([*noisy, *quiet]) == offset


def test_one_exchange_gives_its_own_offset_without_drift():
    fit = fit_clock([ClockPair(100, 1_000, 300)])

    assert (fit.offset_ns, fit.drift_ppm, fit.n) == (-800, 0.0, 1)
    assert np.isnan(fit.residual_ms)


def test_no_exchange_is_an_error():
    with pytest.raises(DataError, match="at least one"):
        offset_ns([])


def test_answer_before_its_request_is_an_error():
    with pytest.raises(DataError, match="exchange 1 was received before"):
        fit_clock([ClockPair(0, 0, 1), ClockPair(5, 0, 4)])


@pytest.mark.parametrize("seed", range(10))
def test_one_way_envelope_recovers_drift_under_one_sided_delay(seed):
    rng = np.random.default_rng(seed)
    device = np.arange(12_000) * (SECOND // 100)
    delay = 2_000_000 + rng.exponential(3e6, device.size).astype(np.int64)
    host = device + 5 * SECOND + np.rint(device * 50e-6).astype(np.int64) + delay

    fit = fit_one_way(device, host)

    least = device + 5 * SECOND + np.rint(device * 50e-6).astype(np.int64) + 2_000_000
    assert np.abs(fit.to_host_ns(device) - least).max() < 200_000
    assert (fit.to_host_ns(device) <= host + 1).all()


def test_one_way_fit_needs_two_times():
    with pytest.raises(DataError, match="two samples"):
        fit_one_way(np.array([1, 1]), np.array([2, 3]))


def test_latest_quick_leaves_out_exchanges_before_a_clock_jump() -> None:
    before = [ClockPair(t, t + 10**12, t + 200_000) for t in range(0, 10**9, 10**8)]
    after = [ClockPair(t, t + 5 * 10**12, t + 300_000) for t in range(10**9, 2 * 10**9, 10**8)]

    assert after[-3:] == latest_quick([*before, *after])


def test_latest_quick_leaves_out_slow_exchanges() -> None:
    quick = [ClockPair(t, t, t + 200_000) for t in (0, 10**8, 2 * 10**8)]
    slow = [ClockPair(3 * 10**8, 3 * 10**8, 3 * 10**8 + 5_000_000)]

    assert quick == latest_quick([*quick, *slow])
