"""A saccade's light against the sample that shows it bounds how late a tracker's stamps are."""

import numpy as np
import pytest

from visavis.analysis.gaze_delay import gaze_delay_bound, saccade_latencies_ms
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import direction_from_yaw_pitch_deg
from visavis.recording.journal import as_json

SAMPLE_NS = NS_PER_S // 250
LIGHT_NS = NS_PER_S * np.arange(1, 41)


def looking(latency_ms, delay_ms=0.0, *, noise_deg=0.05, lost=()):
    """Gaze that goes from side to side after each light, stamped `delay_ms` late."""
    rng = np.random.default_rng(3)
    t_ns = np.arange(0, 42 * NS_PER_S, SAMPLE_NS)
    moves_ns = LIGHT_NS + (np.asarray(latency_ms) + delay_ms) * NS_PER_MS
    side = np.searchsorted(moves_ns, t_ns, side="right") % 2
    yaw_deg = np.where(side, -7.0, 7.0) + rng.normal(0, noise_deg, t_ns.size)
    valid = np.ones(t_ns.size, bool)
    for i in lost:
        valid[(t_ns >= LIGHT_NS[i] - NS_PER_S // 4) & (t_ns < LIGHT_NS[i] + 3 * NS_PER_S // 4)] = 0
    return t_ns, direction_from_yaw_pitch_deg(yaw_deg, 0 * yaw_deg), valid


@pytest.mark.parametrize("delay_ms", [0.0, 12.0, 45.0])
def test_the_bound_holds_for_any_delay_and_is_no_more_than_an_eyes_own_latency_beyond(delay_ms):
    latency_ms = 100 + np.random.default_rng(1).exponential(40, LIGHT_NS.size)
    latencies_ms = saccade_latencies_ms(*looking(latency_ms, delay_ms), LIGHT_NS.tolist())
    bound = gaze_delay_bound("eyes", latencies_ms)

    assert bound.answer_count == LIGHT_NS.size
    assert delay_ms <= bound.at_most_ms <= delay_ms + 35


def test_an_artificial_eye_that_moves_with_the_light_gives_the_delay_itself():
    latencies_ms = saccade_latencies_ms(*looking(0.0, 12.0), LIGHT_NS.tolist())
    bound = gaze_delay_bound("eyes", latencies_ms, min_latency_ms=0.0)
    assert bound.at_most_ms == pytest.approx(12.0, abs=SAMPLE_NS / NS_PER_MS)


def test_saccades_begun_before_the_light_could_be_seen_are_left_out():
    latency_ms = np.where(np.arange(LIGHT_NS.size) % 4 == 0, 30.0, 150.0)
    latencies_ms = saccade_latencies_ms(*looking(latency_ms), LIGHT_NS.tolist())
    bound = gaze_delay_bound("eyes", latencies_ms)
    assert bound.answer_count == 30
    assert bound.at_most_ms == pytest.approx(70.0, abs=SAMPLE_NS / NS_PER_MS)


def test_a_tracker_that_saw_nothing_has_no_bound_and_no_zero():
    latencies_ms = saccade_latencies_ms(*looking(150.0, lost=range(35)), LIGHT_NS.tolist())
    bound = gaze_delay_bound("eyes", latencies_ms)
    assert not bound.is_known
    assert as_json(bound)["at_most_ms"] is None
