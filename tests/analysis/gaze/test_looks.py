"""The cases are numbered as in the study's list of look rules: 120 Hz, trial of 16 s."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tests.analysis.gaze.streams import (
    LOST,
    OFF,
    ON,
    OTHER,
    TRIAL_NS,
    TRIAL_ROWS,
    stamps,
    trial,
)
from visavis.analysis.gaze.looks import LookParameters, looks_on, measure_trial
from visavis.lab.errors import DataError, UsageError


def measure(areas, t_ns=None, **options):
    t = stamps(len(areas)) if t_ns is None else t_ns
    return measure_trial(t, areas, ON, 0, TRIAL_NS, **options)


def ms(value, tolerance_ms=0.001):
    return pytest.approx(value, abs=tolerance_ms)


def durations_ms(areas, t_ns=None):
    t = stamps(len(areas)) if t_ns is None else t_ns
    found = looks_on(t, areas, ON, 0, TRIAL_NS)
    return (found.duration_ns[found.is_fixation] / 1e6).tolist()


def test_seventeen_samples_are_a_glance():
    m = measure(trial((100, 17, ON)))
    assert (0, 1, ms(141.667)) == (m.fixation_count, m.glance_count, m.dwell_ms)
    assert m.dwell_in_fixations_ms == 0
    assert m.first_fixation_time_ms is None


def test_eighteen_samples_are_a_fixation_at_every_start():
    for first in range(TRIAL_ROWS - 17):
        m = measure(trial((first, 18, ON)))
        assert (1, 0) == (m.fixation_count, m.glance_count), first
        assert ms(150.0) == m.first_fixation_duration_ms


@pytest.mark.parametrize("ppm", [-100, -20, 20, 100])
def test_eighteen_samples_are_a_fixation_on_a_drifting_clock(ppm):
    t = np.rint(stamps(TRIAL_ROWS) * (1 + ppm * 1e-6)).astype(np.int64)
    counts = [measure(trial((first, 18, ON)), t).fixation_count for first in range(0, 1900, 7)]
    assert counts == [1] * len(counts)


def test_nineteen_samples_are_a_fixation():
    assert [ms(158.333)] == durations_ms(trial((100, 19, ON)))


def test_look_on_at_onset_counts_from_the_start():
    m = measure(trial((0, 30, ON)))
    assert (0.0, ms(250.0), True) == (
        m.first_fixation_time_ms,
        m.first_fixation_duration_ms,
        m.on_at_onset,
    )
    assert not measure(trial((1, 30, ON))).on_at_onset


def test_look_cut_by_the_end_counts_until_the_end():
    m = measure(trial((TRIAL_ROWS - 18, 18, ON)))
    assert ms(15850.0) == m.first_fixation_time_ms
    assert ms(150.0) == m.first_fixation_duration_ms
    assert m.cut_at_end
    assert measure(trial((TRIAL_ROWS - 17, 17, ON))).fixation_count == 0
    assert not measure(trial((100, 18, ON))).cut_at_end


def test_look_over_the_whole_trial_is_cut_at_both_ends():
    m = measure(trial((0, TRIAL_ROWS, ON)))
    assert (16000.0, 1, 0.0, 0.0) == (m.dwell_ms, m.fixation_count, m.lost_01, m.off_01)


def test_loss_of_75_ms_is_bridged_but_is_not_dwell():
    m = measure(trial((100, 100, ON), (140, 9, LOST)))
    assert (1, ms(833.333), ms(758.333)) == (
        m.fixation_count,
        m.first_fixation_duration_ms,
        m.dwell_ms,
    )


def test_loss_of_83_ms_parts_two_fixations():
    m = measure(trial((100, 100, ON), (140, 10, LOST)))
    assert (2, ms(333.333), ms(416.667), ms(1250.0)) == (
        m.fixation_count,
        m.first_fixation_duration_ms,
        m.second_fixation_duration_ms,
        m.second_fixation_time_ms,
    )


def test_one_sample_elsewhere_parts_two_fixations():
    expected = [ms(333.333), ms(491.667)]
    assert expected == durations_ms(trial((100, 100, ON), (140, 1, OFF)))
    assert expected == durations_ms(trial((100, 100, ON), (140, 1, OTHER)))


@pytest.mark.parametrize("order", [(LOST, OFF), (OFF, LOST), (LOST, OTHER)])
def test_loss_beside_a_sample_elsewhere_is_not_bridged(order):
    areas = trial((100, 100, ON), (140, 2, order[0]), (142, 2, order[1]))
    assert measure(areas).fixation_count == 2


def test_loss_at_the_ends_of_a_look_is_not_added():
    m = measure(trial((105, 100, LOST), (110, 80, ON)))
    assert (ms(916.667), ms(666.667)) == (m.first_fixation_time_ms, m.first_fixation_duration_ms)


def test_two_glances_round_a_short_loss_are_one_fixation():
    m = measure(trial((100, 12, ON), (112, 5, LOST), (117, 12, ON)))
    assert (1, 0, ms(241.667), ms(200.0)) == (
        m.fixation_count,
        m.glance_count,
        m.first_fixation_duration_ms,
        m.dwell_ms,
    )
    assert m.dwell_in_fixations_ns == m.dwell_ns


def test_all_lost_is_missing_and_not_zero():
    m = measure(trial((0, TRIAL_ROWS, LOST)))
    assert (0, 0, 0, 1.0) == (m.dwell_ns, m.fixation_count, m.glance_count, m.lost_01)
    assert m.first_fixation_time_ms is None
    assert m.first_fixation_duration_ms is None
    assert m.second_fixation_time_ms is None
    assert m.second_fixation_duration_ms is None


def test_fixation_ends_where_the_track_is_lost():
    m = measure(trial((1100, 100, ON), (1200, 720, LOST)))
    assert (ms(833.333), 0.375) == (m.first_fixation_duration_ms, m.lost_01)


def test_hundred_glances_are_no_fixation():
    m = measure(trial(*[(19 * k, 10, ON) for k in range(100)]))
    assert (0, 100, ms(8333.333)) == (m.fixation_count, m.glance_count, m.dwell_ms)


@pytest.mark.parametrize(("missing", "count", "lost"), [(9, 1, 0.0044), (10, 2, 0.0049)])
def test_rows_that_never_came_are_loss(missing, count, lost):
    rows = np.r_[0:140, 140 + missing : TRIAL_ROWS]
    m = measure(trial((100, 100, ON))[rows], stamps(TRIAL_ROWS)[rows])
    assert (count, pytest.approx(lost, abs=5e-5)) == (m.fixation_count, m.lost_01)
    held_ms = (100 - missing) * 1000 / 120 + 0.5 * 1000 / 120
    assert ms(held_ms) == m.dwell_ms


def test_repeated_stamp_changes_nothing_but_is_counted():
    areas, t = trial((100, 100, ON)), stamps(TRIAL_ROWS)
    twice = np.r_[0:150, 149, 150:TRIAL_ROWS]
    expected, got = measure(areas), measure(areas[twice], t[twice])
    assert (expected.dwell_ns, expected.first_fixation) == (got.dwell_ns, got.first_fixation)
    assert (0, 1) == (expected.repeated, got.repeated)


def test_contradictory_rows_are_refused_or_the_first_kept():
    areas, t = trial((100, 100, ON)), stamps(TRIAL_ROWS)
    t[150] = t[149]
    areas[150] = OFF
    with pytest.raises(DataError, match="row 150 repeats the stamp"):
        measure(areas, t)
    kept = measure(areas, t, params=LookParameters(conflicts="keep_first"))
    assert (1, ms(833.333)) == (kept.fixation_count, kept.first_fixation_duration_ms)


def test_backward_stamp_is_refused_or_sorted():
    areas, t = trial((100, 100, ON)), stamps(TRIAL_ROWS)
    swap = np.arange(TRIAL_ROWS)
    swap[[150, 151]] = [151, 150]
    with pytest.raises(DataError, match="row 151 is stamped"):
        measure(areas[swap], t[swap])
    assert measure(areas) == measure(areas[swap], t[swap], params=LookParameters(backward="sort"))


def test_jitter_of_2_ms_keeps_counts_and_durations():
    areas = trial((100, 30, ON), (300, 19, ON), (500, 100, ON), (700, 15, ON))
    expected = [250.0, 158.333, 833.333]
    for seed in range(20):
        jitter = np.random.default_rng(seed).uniform(-2e6, 2e6, TRIAL_ROWS).astype(np.int64)
        jitter[[100, 130, 300, 319, 500, 600]] //= 2  # a look of 150 ms may not lose 2 ms twice
        t = stamps(TRIAL_ROWS, start_ns=4_000_000) + jitter
        assert [ms(e, 2.0) for e in expected] == durations_ms(areas, t)
        assert measure(areas, t).glance_count == 1


def test_fourteen_samples_at_90_hz():
    areas = np.full(1440, OFF, np.int16)
    areas[200:214] = ON
    assert [ms(155.556)] == durations_ms(areas, stamps(1440, 90.0))


@pytest.mark.parametrize(("rows", "dwell_ms"), [(0, 0.0), (1, 12.5), (2, 20.833)])
def test_few_samples_are_defined(rows, dwell_ms):
    m = measure(np.full(rows, ON, np.int16), stamps(rows))
    assert (ms(dwell_ms), 0, min(rows, 1)) == (m.dwell_ms, m.fixation_count, m.glance_count)
    assert pytest.approx(1 - dwell_ms / 16000, abs=1e-6) == m.lost_01


def test_dwell_as_a_share_is_of_the_time_with_usable_gaze():
    # A quarter of the trial lost, half of the rest on the target.
    quarter = TRIAL_ROWS // 4
    m = measure(trial((0, quarter, LOST), (quarter, 3 * TRIAL_ROWS // 8, ON)))
    assert pytest.approx(0.5, abs=0.001) == m.dwell_of_valid_01
    assert pytest.approx(0.375, abs=0.001) == m.dwell_ns / m.duration_ns
    assert m.dwell_of_valid_01 == m.as_row("raw_")["raw_dwell_of_valid_01"]


def test_without_usable_gaze_dwell_is_no_share():
    m = measure(trial((0, TRIAL_ROWS, LOST)))
    assert (1.0, None) == (m.lost_01, m.dwell_of_valid_01)


def test_empty_trial_has_no_shares():
    m = measure_trial(stamps(100), trial()[:100], ON, 5, 5)
    assert (0, 0, None, None) == (m.duration_ns, m.dwell_ns, m.lost_01, m.off_01)
    assert m.dwell_of_valid_01 is None


def test_trial_that_ends_before_it_starts_is_refused():
    with pytest.raises(DataError, match="before it starts"):
        measure_trial(stamps(9), trial()[:9], ON, 10, 5)


def test_adjacent_trials_share_no_look():
    t, areas = stamps(2 * TRIAL_ROWS), np.full(2 * TRIAL_ROWS, OFF, np.int16)
    areas[TRIAL_ROWS - 30 : TRIAL_ROWS + 60] = ON
    before = measure_trial(t, areas, ON, 0, TRIAL_NS)
    after = measure_trial(t, areas, ON, TRIAL_NS, 2 * TRIAL_NS)
    assert (ms(250.0), True) == (before.first_fixation_duration_ms, before.cut_at_end)
    assert (ms(500.0), 0.0, True) == (
        after.first_fixation_duration_ms,
        after.first_fixation_time_ms,
        after.on_at_onset,
    )


def test_parts_sum_to_the_whole():
    areas = trial((100, 100, ON), (950, 40, ON), (955, 9, LOST), (1500, 10, ON))
    in_the_loss_ns = 8_003_000_000
    m = measure(areas, switch_ns=in_the_loss_ns)
    before, after = m.parts
    assert m.dwell_ns == before.dwell_ns + after.dwell_ns
    assert m.lost_ns == before.lost_ns + after.lost_ns
    assert m.off_ns == before.off_ns + after.off_ns
    assert in_the_loss_ns == before.duration_ns
    assert (2, 1, 1) == (m.fixation_count, before.fixation_count, after.fixation_count)
    assert (1, 1, 1) == (m.glance_count, before.glance_count, after.glance_count)
    assert ms(8033.333 - 8003.0) == after.first_fixation_time_ms
    assert m.first_fixation == before.first_fixation


def test_look_across_the_switch_is_cut_in_both_parts():
    m = measure(trial((940, 40, ON)), switch_ns=8_000_000_000)
    before, after = m.parts
    assert (ms(166.667), True) == (before.first_fixation_duration_ms, before.cut_at_end)
    assert (ms(166.667), 0.0, True) == (
        after.first_fixation_duration_ms,
        after.first_fixation_time_ms,
        after.on_at_onset,
    )
    assert (1, m.dwell_ns) == (m.fixation_count, before.dwell_ns + after.dwell_ns)


def test_switch_outside_the_trial_is_refused():
    with pytest.raises(DataError, match="outside the trial"):
        measure(trial(), switch_ns=TRIAL_NS + 1)


def test_look_begun_before_onset_is_left_out_on_request():
    areas = trial((0, 1000, ON), (1200, 30, ON))
    m = measure(areas, switch_ns=8_000_000_000, params=LookParameters(onset="exclude"))
    assert (1, ms(10_000.0), ms(250.0)) == (m.fixation_count, m.first_fixation_time_ms, m.dwell_ms)
    assert (ms(8333.333), True) == (m.excluded_ns / 1e6, m.on_at_onset)
    assert m.duration_ns == m.dwell_ns + m.excluded_ns + m.off_ns + m.lost_ns
    assert m.dwell_ns == sum(p.dwell_ns for p in m.parts)


def test_sample_before_the_trial_covers_its_first_milliseconds():
    t = stamps(TRIAL_ROWS, start_ns=-5_000_000)
    areas = trial((1, 30, ON))
    assert not measure(areas, t).on_at_onset
    without = measure(areas[1:], t[1:])
    assert without.on_at_onset
    assert t[1] == without.lost_ns - measure(areas, t).lost_ns


states = hnp.arrays(np.int16, st.integers(0, 300), elements=st.sampled_from([-2, -1, 0, 1, 2]))


@given(states, st.integers(0, 10**9), st.integers(0, 3 * 10**9), st.randoms(use_true_random=False))
def test_areas_off_and_lost_sum_to_the_trial(areas, start_ns, lasted_ns, random):
    steps = [random.choice([8_333_333, 8_333_334, 6_000_000, 60_000_000]) for _ in areas]
    t = np.cumsum(np.array(steps, np.int64))
    end_ns = start_ns + lasted_ns
    for target in range(3):
        m = measure_trial(t, areas, target, start_ns, end_ns, switch_ns=start_ns + lasted_ns // 3)
        assert min(m.dwell_ns, m.off_ns, m.lost_ns) >= 0
        assert lasted_ns == m.dwell_ns + m.off_ns + m.lost_ns
        assert m.dwell_ns == sum(p.dwell_ns for p in m.parts)
        assert m.dwell_in_fixations_ns <= m.dwell_ns


@pytest.mark.parametrize("rate_hz", [60.0, 90.0, 120.0, 200.0])
def test_counts_do_not_depend_on_the_rate(rate_hz):
    edges_ns = np.array([1.0, 1.6, 3.0, 3.3, 5.0, 6.1, 9.0, 9.1, 11.0, 11.4]) * 1e9
    t = stamps(round(16 * rate_hz), rate_hz)
    on = np.searchsorted(edges_ns, t, side="right") % 2 == 1
    m = measure(np.where(on, ON, OFF).astype(np.int16), t)
    assert 4 == pytest.approx(m.fixation_count, abs=1)
    assert 1 == pytest.approx(m.glance_count, abs=1)
    assert 2500.0 == pytest.approx(m.dwell_ms, abs=5 * 1000 / rate_hz)


def test_float_times_are_refused():
    with pytest.raises(UsageError, match="int64"):
        measure_trial(np.zeros(2), np.zeros(2, np.int16), 0, 0, 10)


@pytest.mark.parametrize(
    "wrong", [{"minimum_fixation_ms": -1}, {"hold_steps": 0.5}, {"nominal_rate_hz": 0.0}]
)
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(UsageError):
        LookParameters(**wrong)


def test_row_holds_missing_as_none():
    row = measure(trial((100, 17, ON))).as_row("before_")
    assert row["before_first_fixation_time_ms"] is None
    assert row["before_glance_count"] == 1
    assert 13 == len(row)
