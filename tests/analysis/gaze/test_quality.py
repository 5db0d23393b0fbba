import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.gaze.streams import looks, shaken, stamps
from visavis.analysis.gaze.events import detect_ivt
from visavis.analysis.gaze.loss import combined_direction, frozen_samples, loss, usable_samples
from visavis.analysis.gaze.quality import accuracy, moving_precision_deg, precision, validate
from visavis.lab.errors import UsageError
from visavis.lab.geometry import (
    angle_deg,
    direction_from_yaw_pitch_deg,
    quat_from_yaw_pitch_deg,
    rotate,
)

AHEAD = np.array([0.0, 0.0, -1.0])


def steady(n=240, sd_deg=0.0, seed=0):
    return shaken(np.tile(AHEAD, (n, 1)), sd_deg, np.random.default_rng(seed))


def near(value, tolerance=1e-6):
    return pytest.approx(value, abs=tolerance)


def test_two_accuracies_are_told_apart():
    gaze = direction_from_yaw_pitch_deg([1.0, -1.0, 3.0, -3.0], np.zeros(4))
    a = accuracy(gaze, AHEAD)
    assert (near(0.0), near(2.0), near(2.0)) == (
        a.of_mean_deg,
        a.mean_of_samples_deg,
        a.median_of_samples_deg,
    )


def test_offset_says_where_gaze_lies_from_the_target():
    a = accuracy(direction_from_yaw_pitch_deg([-2.0], [0.0]), AHEAD)
    assert (near(2.0), near(0.0), near(2.0)) == (a.right_deg, a.up_deg, a.of_mean_deg)
    a = accuracy(direction_from_yaw_pitch_deg([0.0], [1.5]), AHEAD)
    assert (near(0.0), near(1.5)) == (a.right_deg, a.up_deg)


def test_alternating_gaze_has_known_precision():
    step = 0.5
    gaze = direction_from_yaw_pitch_deg(np.tile([0.0, step], 100), np.zeros(200))
    p = precision(stamps(200), gaze)
    assert (near(step), near(step / 2), near(0.0)) == (p.rms_s2s_deg, p.std_deg, p.bcea_deg2)


def test_white_noise_has_the_precision_of_its_spread():
    p = precision(stamps(20_000), steady(20_000, 0.2))
    assert pytest.approx(0.4, rel=0.02) == p.rms_s2s_deg
    assert pytest.approx(0.2 * np.sqrt(2), rel=0.02) == p.std_deg
    assert pytest.approx(2 * -np.log(0.32) * np.pi * 0.04, rel=0.03) == p.bcea_deg2


@settings(deadline=None)
@given(st.floats(-180, 180), st.floats(-89, 89))
def test_turning_everything_changes_no_quality(yaw, pitch):
    gaze, q = steady(60, 0.2, seed=3), quat_from_yaw_pitch_deg(yaw, pitch)
    target = direction_from_yaw_pitch_deg(1.0, 0.5)
    a, b = precision(stamps(60), gaze), precision(stamps(60), rotate(q, gaze))
    assert near(a.rms_s2s_deg) == b.rms_s2s_deg
    assert near(a.std_deg) == b.std_deg
    assert near(a.bcea_deg2) == b.bcea_deg2
    a, b = accuracy(gaze, target), accuracy(rotate(q, gaze), rotate(q, target))
    assert near(a.of_mean_deg) == b.of_mean_deg
    assert near(a.mean_of_samples_deg) == b.mean_of_samples_deg


def test_pairs_across_loss_and_holes_and_repeats_are_left_out():
    gaze = direction_from_yaw_pitch_deg(
        np.r_[np.tile([0.0, 0.1], 10), np.full(20, 5.0)], 0.0 * np.ones(40)
    )
    whole = precision(stamps(40), gaze).rms_s2s_deg
    gaze[19] = np.nan
    assert near(0.1) == precision(stamps(40), gaze).rms_s2s_deg
    keep = np.r_[0:19, 25:40]
    assert near(0.1) == precision(stamps(40)[keep], gaze[keep]).rms_s2s_deg
    assert whole > 0.5


def test_nothing_usable_has_no_quality():
    lost = np.full((5, 3), np.nan)
    assert np.isnan(accuracy(lost, AHEAD).of_mean_deg)
    assert np.isnan(precision(stamps(5), lost).rms_s2s_deg)
    assert np.isnan(moving_precision_deg(stamps(0), np.zeros((0, 3)))).all()


def test_moving_precision_finds_the_calm_window():
    gaze = np.vstack([steady(120, 0.5), steady(48, 0.05, seed=1), steady(120, 0.5, seed=2)])
    middle, calmest = moving_precision_deg(stamps(288), gaze)
    assert pytest.approx(1.0, rel=0.2) == middle
    assert calmest < 0.3


def test_rows_that_are_no_direction_are_lost():
    gaze = steady(8, 0.1)
    gaze[1], gaze[2], gaze[3], gaze[4] = 0.0, np.nan, np.inf, 0.5 * gaze[4]
    gaze[5] = 3.0 * gaze[5]
    expected = [True, False, False, False, False, False, True, True]
    assert expected == usable_samples(stamps(8), gaze).tolist()


def test_verdict_openness_and_confidence_lose_samples_and_unknown_does_not():
    gaze, t, ok = steady(4, 0.1), stamps(4), np.ones(4, bool)
    nan = np.nan
    got = usable_samples(t, gaze, valid=np.array([True, False, True, True]))
    assert [True, False, True, True] == got.tolist()
    got = usable_samples(t, gaze, valid=ok, openness_01=np.array([nan, 0.49, 0.5, 1.0]))
    assert [True, False, True, True] == got.tolist()
    got = usable_samples(t, gaze, confidence_01=np.array([nan, 0.24, 0.25, 1.0]))
    assert [True, False, True, True] == got.tolist()


@pytest.mark.parametrize(("rows", "frozen"), [(11, 0), (12, 12), (30, 30)])
def test_gaze_frozen_for_100_ms_is_lost_and_reported(rows, frozen):
    gaze = steady(100, 0.1)
    gaze[40 : 40 + rows] = gaze[40]
    t = stamps(100)
    assert frozen == frozen_samples(t, gaze).sum()
    usable = usable_samples(t, gaze)
    assert 100 - frozen == usable.sum()
    data_loss = loss(t, gaze, usable, nominal_rate_hz=120.0)
    assert (frozen, pytest.approx(frozen / 100)) == (data_loss.frozen, data_loss.lost_01)


def test_loss_sees_rows_that_never_came():
    keep = np.r_[0:60, 90:120]
    gaze, t = steady(120, 0.1)[keep], stamps(120)[keep]
    data_loss = loss(t, gaze, np.ones(90, bool), nominal_rate_hz=120.0)
    assert (0.0, near(0.25)) == (data_loss.invalid_rows_01, data_loss.lost_01)
    assert (near(90.0, 1e-3), near(250.0, 1e-3), 1) == (
        data_loss.effective_rate_hz,
        data_loss.longest_gap_ms,
        data_loss.gaps,
    )
    assert 1.0 == data_loss.blink_gaps_01


def test_repeats_are_counted():
    rows = np.r_[0:50, 49, 50:100]
    gaze = steady(100, 0.1)
    gaze[71] = gaze[70]
    data_loss = loss(stamps(100)[rows], gaze[rows], np.ones(101, bool), nominal_rate_hz=120.0)
    assert (1, 1, 100) == (data_loss.repeated_stamps, data_loss.repeated_values, data_loss.usable)


def test_rate_comes_from_first_and_last_stamp():
    uneven = np.cumsum(np.tile([7_979_000, 7_979_000, 9_042_000], 200))
    gaze = steady(600, 0.1)
    data_loss = loss(uneven, gaze, np.ones(600, bool), nominal_rate_hz=120.0)
    assert pytest.approx(120.0, abs=0.1) == data_loss.rate_hz


def test_no_samples_have_no_loss_and_backward_stamps_are_refused():
    data_loss = loss(stamps(0), np.zeros((0, 3)), np.zeros(0, bool), nominal_rate_hz=120.0)
    assert np.isnan(data_loss.lost_01)
    with pytest.raises(UsageError, match="go back"):
        loss(stamps(3)[::-1], steady(3), np.ones(3, bool), nominal_rate_hz=120.0)


def test_one_eye_lost_in_mid_look_does_not_jump():
    gaze = looks([(0, 0), (10, 0)], [60, 120])
    left = rotate(quat_from_yaw_pitch_deg(-1.5, 0.4), gaze)
    right = rotate(quat_from_yaw_pitch_deg(1.5, -0.4), gaze)
    ok, gone = np.ones(len(gaze), bool), np.ones(len(gaze), bool)
    gone[100:140] = False
    left[100:140] = 0.0
    joined, eyes = combined_direction(left, right, gone, ok)
    assert angle_deg(joined, gaze).max() < 0.1
    assert (3, 2) == (eyes[99], eyes[100])
    assert 2 == len(detect_ivt(stamps(len(gaze)), joined))
    mirrored, eyes = combined_direction(right, left, ok, gone)
    assert angle_deg(mirrored, gaze).max() < 0.1
    assert 1 == eyes[100]


def test_zero_vector_is_never_averaged():
    joined, eyes = combined_direction(
        np.tile(AHEAD, (3, 1)), np.zeros((3, 3)), np.ones(3, bool), np.zeros(3, bool)
    )
    assert np.array_equal(np.tile(AHEAD, (3, 1)), joined)
    assert [1, 1, 1] == eyes.tolist()
    joined, _ = combined_direction(joined, joined, np.zeros(3, bool), np.zeros(3, bool))
    assert np.isnan(joined).all()


def validation(errors_deg, rows=120):
    targets = direction_from_yaw_pitch_deg(
        np.arange(len(errors_deg)) * 5.0, np.zeros(len(errors_deg))
    )
    yaw = np.arange(len(errors_deg)) * 5.0 + np.array(errors_deg)
    return [
        (target, stamps(rows), np.tile(direction_from_yaw_pitch_deg(y, 0.0), (rows, 1)))
        for target, y in zip(targets, yaw, strict=True)
    ]


@pytest.mark.parametrize(
    ("passed", "errors"), [(True, [1.0, 1.9]), (False, [1.6, 1.6]), (False, [0.0, 0.0, 3.1])]
)
def test_validation_passes_on_mean_and_worst_error(passed, errors):
    summary = validate(validation(errors), nominal_rate_hz=120.0)
    assert near(np.mean(errors)) == summary.accuracy_deg
    assert near(max(errors)) == summary.worst_deg
    assert passed == summary.passed


def test_validation_without_enough_samples_does_not_pass():
    points = validation([0.5, 0.5])
    points[1][2][30:] = np.nan
    summary = validate(points, nominal_rate_hz=120.0)
    assert (False, near(0.5), near(250.0)) == (
        summary.passed,
        summary.accuracy_deg,
        summary.points[1].usable_ms,
    )
    assert near(0.75 / 2) == summary.lost_01
    assert not validate([], nominal_rate_hz=120.0).passed
