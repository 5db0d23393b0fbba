"""What a synchronisation test makes of a sensor's signal, and what it refuses to make of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.analysis.sync_test import delays, offsets_ms
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.recording.journal import as_json

STEP_NS = 250_000
EVERY_NS = NS_PER_S // 2


def trace(late_ms, *, kind, lasts_ms=55.0, noise=0.004, seed=0):
    """Return times, levels and when the stimuli were asked for; NaN: nothing came."""
    rng = np.random.default_rng(seed)
    asked_ns = NS_PER_S + EVERY_NS * np.arange(len(late_ms)) + rng.integers(0, 10**7, len(late_ms))
    t_ns = np.arange(0, NS_PER_S + EVERY_NS * (len(late_ms) + 1), STEP_NS, dtype=np.int64)
    level = 0.1 + rng.normal(0, noise, t_ns.size)
    for at_ns, late in zip(asked_ns, late_ms, strict=True):
        if np.isnan(late):
            continue
        since_ms = (t_ns - at_ns) / NS_PER_MS - late
        on = (since_ms >= 0) & (since_ms < lasts_ms)
        level += 0.6 * on * (1.0 if kind == "picture" else np.cos(2 * np.pi * 0.4 * since_ms))
    return t_ns, level, asked_ns.tolist()


@settings(max_examples=25, deadline=None)
@given(st.floats(0, 200), st.floats(0, 8), st.sampled_from(["picture", "sound", "vibration"]))
def test_planted_delay_and_jitter_are_found_to_a_fifth_of_a_millisecond(least_ms, jitter_ms, kind):
    late_ms = least_ms + np.random.default_rng(2).uniform(0, jitter_ms, 60)
    summary = delays(kind, "it", *trace(late_ms, kind=kind))

    assert 60 == summary.answered
    assert float(np.median(late_ms)) == pytest.approx(summary.median_ms, abs=0.2)
    assert float(np.std(late_ms, ddof=1)) == pytest.approx(summary.sd_ms, abs=0.2)


def test_drift_over_the_test_is_found_with_its_limits():
    late_ms = 20 + np.arange(120) * 0.5 / 60 * 3.0
    summary = delays("sound", "speaker", *trace(late_ms, kind="sound"))

    assert 3.0 == pytest.approx(summary.drift_ms_per_min, abs=0.1)
    assert summary.drift_low_ms_per_min <= summary.drift_ms_per_min <= summary.drift_high_ms_per_min
    assert summary.drift_low_ms_per_min > 0


def test_stimuli_without_an_answer_are_missing_not_zero():
    late_ms = np.where(np.arange(40) % 4 == 0, np.nan, 12.0)
    summary = delays("picture", "headset", *trace(late_ms, kind="picture"))

    assert (40, 30) == (summary.asked, summary.answered)
    assert 12.0 == pytest.approx(summary.min_ms, abs=0.3)
    assert {} == offsets_ms([summary])  # a quarter missing: no offset


def test_silent_sensor_gives_no_delay_at_all():
    summary = delays("sound", "speaker", *trace([np.nan] * 30, kind="sound"))

    assert 0 == summary.answered
    assert np.isnan(summary.median_ms)
    assert as_json(summary)["median_ms"] is None


def test_flash_of_another_length_than_asked_is_counted():
    t_ns, level, requests = trace([10.0] * 20, kind="picture", lasts_ms=55.0)
    again = delays(
        "picture",
        "headset",
        t_ns,
        level,
        requests,
        flash_ns=66 * NS_PER_MS,
        frame_ns=11 * NS_PER_MS,
    )
    right = delays(
        "picture",
        "headset",
        t_ns,
        level,
        requests,
        flash_ns=55 * NS_PER_MS,
        frame_ns=11 * NS_PER_MS,
    )

    assert (20, 0) == (again.shown_wrong, right.shown_wrong)


def test_offsets_are_named_for_what_they_delay():
    picture = delays("picture", "headset", *trace([9.0] * 20, kind="picture"))
    band = delays("vibration", "armband_left", *trace([31.0] * 20, kind="vibration"))

    assert {
        "picture_delay_ms": pytest.approx(9.0, abs=0.2),
        "vibration_delay_ms.armband_left": pytest.approx(31.0, abs=0.2),
    } == offsets_ms([picture, band])
