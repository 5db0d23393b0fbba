import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.gaze.streams import stamps
from visavis.analysis.gaze.pupil import PupilParameters, foreshortening, prepared_pupil, response
from visavis.lab.errors import UsageError
from visavis.lab.geometry import direction_from_yaw_pitch_deg

N = 600
T = stamps(N)


def steady(mm=4.0, n=N):
    return np.full(n, mm)


def test_a_blink_is_bridged_by_a_line_with_its_edges():
    size = np.linspace(3.0, 4.0, N)
    expected = size.copy()
    size[200:218] = np.nan  # 150 ms
    size[197:200] -= [0.1, 0.4, 0.9]  # the lid comes down
    got = prepared_pupil(T, size)
    assert 1 == got.blinks
    assert expected == pytest.approx(got.diameter_mm)
    assert got.bridged[195:222].all()
    assert (N - 18) / N == pytest.approx(got.measured_01)


def test_a_long_loss_stays_missing():
    size = steady()
    size[200:290] = 0.0
    got = prepared_pupil(T, size)
    assert np.isnan(got.diameter_mm[200:290]).all()
    assert 0 == got.blinks


def test_a_loss_at_either_end_is_not_guessed():
    size = steady()
    size[:10] = size[-10:] = np.nan
    got = prepared_pupil(T, size)
    assert np.isnan(got.diameter_mm[[0, 9, -10, -1]]).all()


def test_seen_width_is_the_cosine_that_mathur_and_colleagues_measured():
    gaze = direction_from_yaw_pitch_deg([0.0, 20.0, 0.0, 70.0], [0.0, 0.0, 40.0, 0.0])
    expected = [1.0, np.cos(np.radians(20) / 1.121), np.cos(np.radians(40) / 1.121), np.nan]
    assert expected == pytest.approx(foreshortening(gaze), nan_ok=True)


@given(st.floats(-40, 40), st.floats(-30, 30), st.floats(2.5, 6.0))
@settings(max_examples=30, deadline=None)
def test_foreshortening_is_undone_at_any_angle(yaw_deg, pitch_deg, true_mm):
    gaze = direction_from_yaw_pitch_deg(np.full(N, yaw_deg), np.full(N, pitch_deg))
    got = prepared_pupil(T, true_mm * np.sqrt(foreshortening(gaze)), gaze)
    assert true_mm == pytest.approx(got.diameter_mm[N // 2])


def test_response_is_the_mean_less_the_baseline_just_before():
    size = steady(4.0)
    size[300:] = 4.0 + np.minimum(0.25, 0.01 * np.arange(N - 300))
    got = response(T, prepared_pupil(T, size), int(T[300]), int(T[420]))
    assert 4.0 == got.baseline_mm
    assert size[300:420].mean() - 4.0 == pytest.approx(got.change_mm)
    assert 0.25 == pytest.approx(got.peak_mm)
    assert (1.0, 0.0) == (got.known_01, got.bridged_01)


def test_without_enough_baseline_there_is_no_change_but_a_mean():
    size = steady(4.0)
    size[240:300] = np.nan
    params = PupilParameters(max_bridge_ms=100)
    got = response(T, prepared_pupil(T, size, params=params), int(T[310]), int(T[420]))
    assert np.isnan([got.baseline_mm, got.change_mm, got.peak_mm]).all()
    assert 4.0 == pytest.approx(got.mean_mm)


def test_nothing_is_defined_and_wrong_input_refused():
    empty = prepared_pupil(stamps(0), np.zeros(0))
    assert np.isnan(response(stamps(0), empty, 0, 10).mean_mm)
    assert np.isnan(prepared_pupil(T, np.full(N, np.nan)).diameter_mm).all()
    with pytest.raises(UsageError, match="do not fit"):
        prepared_pupil(T, steady(n=3))
    with pytest.raises(UsageError, match="repeat or go back"):
        prepared_pupil(T[::-1], steady())
