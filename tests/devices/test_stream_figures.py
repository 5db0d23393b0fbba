"""What `devices test` says of a stream, on streams whose figures are known."""

import numpy as np
import pytest

from visavis.devices.contracts import GAZE, HAPTICS, NO_DEVICE_TIME, ClockPair
from visavis.devices.stream_figures import clock_figures, steady_fit, stream_figures
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.schema import SampleBatch, empty_values

OFFSET_NS = 40 * NS_PER_S
PERIOD_NS = round(NS_PER_S / 120)


def batch(device, host, seq=None, schema=GAZE):
    device, host = np.asarray(device, "i8"), np.asarray(host, "i8")
    numbers = np.arange(device.size) if seq is None else np.asarray(seq, "i8")
    return SampleBatch(schema, numbers, device, host, empty_values(schema, device.size))


def regular(n=1200, delay_ms=8.0, drift_ppm=0.0):
    device = np.arange(n, dtype="i8") * PERIOD_NS
    host = device * (1 + drift_ppm * 1e-6) + OFFSET_NS + delay_ms * NS_PER_MS
    return batch(device, host)


def pairs(seconds=10.0, drift_ppm=0.0, round_trip_ms=1.0, step_s=0.25):
    figures = []
    for k in range(round(seconds / step_s)):
        device = round(k * step_s * NS_PER_S)
        middle = device * (1 + drift_ppm * 1e-6) + OFFSET_NS
        half = round_trip_ms / 2 * NS_PER_MS
        figures.append(ClockPair(round(middle - half), device, round(middle + half)))
    return figures


def test_delay_is_absolute_with_time_exchanges():
    figures = stream_figures(GAZE, [regular()], pairs())
    assert figures.delay_is_absolute
    assert figures.delay_ms == pytest.approx(8.0, abs=0.01)
    assert figures.rate_hz == pytest.approx(120.0, abs=0.01)
    assert (0, 0) == (figures.gaps, figures.lost)


def test_delay_without_exchanges_is_above_the_quickest_sample():
    figures = stream_figures(GAZE, [regular()])
    assert not figures.delay_is_absolute
    assert figures.delay_ms == pytest.approx(0.0, abs=0.01)


def test_gap_and_hole_are_counted():
    whole = regular(100)
    keep = np.r_[0:40, 43:100]
    cut = batch(whole.t_device_ns[keep], whole.t_host_ns[keep], keep)
    figures = stream_figures(GAZE, [cut])
    assert (1, 3) == (figures.gaps, figures.lost)
    assert figures.longest_gap_ms == pytest.approx(4 * PERIOD_NS / NS_PER_MS)


def test_stream_that_never_came_has_no_figures():
    figures = stream_figures(GAZE, [])
    assert (0, None, None, None) == (
        figures.samples,
        figures.rate_hz,
        figures.jitter_ms,
        figures.delay_ms,
    )


def test_stamps_of_our_own_clock_say_nothing_of_delay():
    same = np.arange(200) * PERIOD_NS
    assert stream_figures(GAZE, [batch(same, same)]).delay_ms is None


def test_rows_without_device_time_are_counted_only():
    rows = batch([NO_DEVICE_TIME] * 20, np.arange(20), schema=HAPTICS)
    figures = stream_figures(HAPTICS, [rows])
    assert 20 == figures.samples
    assert figures.delay_ms is None


def test_exchanges_of_the_opening_make_no_drift():
    opening = [
        ClockPair(OFFSET_NS + k * 1000, k * 1000 + 300, OFFSET_NS + k * 1000 + 500 * (k % 3 + 1))
        for k in range(20)
    ]
    assert clock_figures([], opening).drift_ppm is None
    assert steady_fit(opening).drift_ppm == 0.0


def test_drift_is_told_from_five_seconds_on():
    figures = clock_figures([], pairs(10.0, drift_ppm=50.0))
    assert figures.drift_ppm == pytest.approx(50.0, abs=0.5)
    assert figures.bound_ms == pytest.approx(0.5, abs=0.01)
    assert clock_figures([], pairs(4.0, drift_ppm=50.0)).drift_ppm is None


def test_one_way_clock_has_no_bound():
    figures = clock_figures([regular(drift_ppm=20.0)])
    assert figures.bound_ms is None
    assert figures.drift_ppm == pytest.approx(20.0, abs=0.5)
