import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.gaze.streams import looks, shaken, stamps
from visavis.analysis.gaze.events import (
    IDT_HEADSET,
    IDT_SCREEN,
    IVT_HEADSET,
    IVT_MOVING_HEAD,
    IvtParameters,
    detect_idt,
    detect_ivt,
)
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import (
    angle_deg,
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    rotate,
)

THREE = looks([(0, 0), (10, 0), (10, 10)], [60, 36, 96])
"""500, 300 and 800 ms at 120 Hz."""


def found_ms(fixations):
    return (fixations.duration_ns / 1e6).tolist()


def near_ms(values, tolerance=2 * 1000 / 120 + 0.01):
    return [pytest.approx(v, abs=tolerance) for v in values]


def test_three_fixations_are_found_within_two_samples():
    for detect in (detect_ivt, detect_idt):
        f = detect(stamps(len(THREE)), THREE)
        assert near_ms([500, 300, 800]) == found_ms(f)
        assert near_ms([0, 541.667, 883.333]) == (f.onset_ns / 1e6).tolist()
        assert (
            angle_deg(f.direction, direction_from_yaw_pitch_deg([0, 10, 10], [0, 0, 10])) < 0.6
        ).all()


def test_five_looks_of_250_ms_stay_five():
    gaze = looks([(10 * k, 0) for k in range(5)], [30] * 5)
    assert 5 == len(detect_ivt(stamps(len(gaze)), gaze))
    assert 5 == len(detect_idt(stamps(len(gaze)), gaze))


def test_merging_needs_both_nearness_in_time_and_in_angle():
    def count(angle_between, rows_between, **settings_):
        out = looks([(0, 0), (8, 0), (angle_between, 0)], [40, rows_between, 40], saccade_rows=1)
        return len(detect_ivt(stamps(len(out)), out, IvtParameters(**settings_)))

    near, far, short, long = 0.2, 3.0, 2, 20
    assert 1 == count(near, short)
    assert 2 == count(far, short)
    assert 3 == count(near, long)  # the excursion is a fixation of its own
    assert 2 == count(near, long, minimum_ms=200.0)
    assert 1 == count(far, short, merge_deg=5.0)
    assert 2 == count(near, short, merge_ms=10.0)


def test_minimum_and_merge_gap_are_independent():
    gaze = looks([(0, 0), (10, 0), (20, 0)], [40, 40, 40])
    for minimum_ms in (10.0, 60.0, 200.0):
        assert 3 == len(detect_ivt(stamps(len(gaze)), gaze, IvtParameters(minimum_ms=minimum_ms)))
    assert 0 == len(detect_ivt(stamps(len(gaze)), gaze, IvtParameters(minimum_ms=500.0)))


@pytest.mark.parametrize("lost_rows", [1, 3, 9])
def test_short_loss_does_not_split_a_fixation(lost_rows):
    gaze = THREE.copy()
    gaze[140 : 140 + lost_rows] = np.nan
    t = stamps(len(gaze))
    assert near_ms([500, 300, 800]) == found_ms(detect_ivt(t, gaze))
    assert near_ms([500, 300, 800]) == found_ms(detect_idt(t, gaze))


def test_blink_of_150_ms_splits_a_fixation():
    gaze = THREE.copy()
    gaze[152:170] = np.nan
    for detect in (detect_ivt, detect_idt):
        found = detect(stamps(len(gaze)), gaze)
        assert near_ms([500, 300, 383.333, 266.667]) == found_ms(found)
        assert not found.in_fixation[152:170].any()


def test_hole_without_rows_is_treated_like_lost_rows():
    for rows, count in ((9, 3), (10, 4)):
        keep = np.r_[0:140, 140 + rows : len(THREE)]
        t = stamps(len(THREE))[keep]
        assert count == len(detect_ivt(t, THREE[keep]))
        assert count == len(detect_idt(t, THREE[keep]))


@pytest.mark.parametrize("detect", [detect_ivt, detect_idt])
def test_few_or_no_samples_and_all_lost_are_defined(detect):
    for n in range(4):
        assert 0 == len(detect(stamps(n), np.tile([0.0, 0, -1], (n, 1))))
    lost = detect(stamps(200), np.full((200, 3), np.nan))
    assert 0 == len(lost)
    assert not lost.in_fixation.any()
    zeros = detect(stamps(200), np.zeros((200, 3)))
    assert 0 == len(zeros)


@pytest.mark.parametrize("detect", [detect_ivt, detect_idt])
def test_wrong_stamps_are_refused(detect):
    t = stamps(len(THREE))
    t[[50, 51]] = t[[51, 50]]
    with pytest.raises(DataError, match="row 51"):
        detect(t, THREE)
    again = np.r_[0:50, 49, 50 : len(THREE)]
    with pytest.raises(UsageError, match="repeat"):
        detect(stamps(len(THREE))[again], THREE[again])


turns = st.tuples(st.floats(-180, 180), st.floats(-80, 80))


@settings(max_examples=30, deadline=None)
@given(turns, st.integers(0, 2**32 - 1))
def test_turning_the_world_changes_no_event(turn, seed):
    gaze = shaken(THREE, 0.05, np.random.default_rng(seed))
    t = stamps(len(gaze))
    turned = rotate(quat_from_yaw_pitch_deg(*turn), gaze)
    for detect in (detect_ivt, detect_idt):
        a, b = detect(t, gaze), detect(t, turned)
        assert np.array_equal(a.first_row, b.first_row)
        assert np.array_equal(a.last_row, b.last_row)


@pytest.mark.parametrize(("yaw", "pitch"), [(180, 0), (0, 80), (180, -80)])
def test_looks_across_the_seam_are_found(yaw, pitch):
    gaze = rotate(quat_from_yaw_pitch_deg(yaw, pitch), THREE)
    assert near_ms([500, 300, 800]) == found_ms(detect_ivt(stamps(len(gaze)), gaze))


@pytest.mark.parametrize("rate_hz", [60.0, 90.0, 120.0, 200.0])
def test_events_do_not_depend_on_the_rate(rate_hz):
    rows = [round(s * rate_hz) for s in (0.5, 0.3, 0.8)]
    gaze = looks([(0, 0), (10, 0), (10, 10)], rows, saccade_rows=round(0.04 * rate_hz))
    t = stamps(len(gaze), rate_hz)
    window_ms = max(20.0, 2000 / rate_hz) + 0.01  # half the velocity window at either end
    assert near_ms([500, 300, 800], window_ms) == found_ms(detect_ivt(t, gaze))
    assert 3 == len(detect_idt(t, gaze))


def test_counter_rotating_eyes_fixate_in_world_and_move_in_head():
    t = stamps(240)
    world = np.tile([0.0, 0.0, -1.0], (240, 1))
    head_yaw_deg = 60.0 * t / 1e9
    head = np.array([quat_from_yaw_pitch_deg(y) for y in head_yaw_deg])
    in_head = rotate(quat_conjugate(head), world)
    assert near_ms([2000]) == found_ms(detect_ivt(t, world))
    assert 0 == len(detect_ivt(t, in_head))


def test_velocity_threshold_takes_slow_pursuit_for_fixation():
    t = stamps(240)
    slow = direction_from_yaw_pitch_deg(10.0 * t / 1e9, np.zeros(240))
    assert 1 == len(detect_ivt(t, slow))
    assert 0 == len(detect_ivt(t, direction_from_yaw_pitch_deg(50.0 * t / 1e9, np.zeros(240))))
    quick = direction_from_yaw_pitch_deg(50.0 * t / 1e9, np.zeros(240))
    assert 1 == len(detect_ivt(t, quick, IVT_MOVING_HEAD))


@pytest.mark.parametrize(("sd_deg", "window_ms"), [(0.02, 20.0), (0.3, 40.0), (0.5, 60.0)])
def test_window_grows_with_noise(sd_deg, window_ms):
    gaze = shaken(
        looks([(0, 0), (15, 0), (0, 5)], [120, 120, 120]), sd_deg, np.random.default_rng(1)
    )
    f = detect_ivt(stamps(len(gaze)), gaze)
    assert window_ms == f.window_ms
    assert 3 == len(f)


def test_headset_presets_ask_for_longer_fixations():
    gaze = looks([(0, 0), (10, 0)], [10, 40])
    t = stamps(len(gaze))
    assert (2, 1) == (len(detect_ivt(t, gaze)), len(detect_ivt(t, gaze, IVT_HEADSET)))
    assert (1, 1) == (len(detect_idt(t, gaze, IDT_SCREEN)), len(detect_idt(t, gaze, IDT_HEADSET)))
    shorter = looks([(0, 0), (10, 0)], [20, 40])
    t = stamps(len(shorter))
    assert (2, 1) == (len(detect_idt(t, shorter)), len(detect_idt(t, shorter, IDT_HEADSET)))


def test_dispersion_is_the_widest_pair_and_not_a_box():
    def count(width_deg):
        gaze = looks([(0, 0), (0.7 * width_deg, 0.7 * width_deg)] * 1, [20, 20], saccade_rows=1)
        return len(detect_idt(stamps(len(gaze)), gaze))

    assert 1 == count(0.99)
    assert 2 == count(1.03)
