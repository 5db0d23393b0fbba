"""Degrees of an uncalibrated picture by the durations of saccades."""

import numpy as np
import pytest

from benchmarks.gaze_detectors.hmr_scale import MS_A_DEGREE, degrees_of_width, saccades_of
from benchmarks.gaze_detectors.sets import HMR_DEG, HMR_RATE_HZ, Recording, labelling_of
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.lab.geometry import direction_from_yaw_pitch_deg


@pytest.mark.parametrize("degrees", [60.0, 100.0, 150.0])
def test_a_width_has_as_many_degrees_as_saccades_of_it_last_longer(degrees: float) -> None:
    widths = np.linspace(0.03, 0.24, 40)
    saccades = [(w, 25.0 + MS_A_DEGREE * degrees * w) for w in widths]
    assert degrees == pytest.approx(degrees_of_width(saccades, (0.02, 0.25)))


def test_saccades_are_read_between_the_rows_beside_them_and_without_losses() -> None:
    yaw_deg = np.repeat([0.0, 10.0, 0.0], 20)
    movement = np.full(60, Movement.FIXATION, np.int8)
    movement[18:22] = movement[38:42] = Movement.SACCADE
    direction = np.array([direction_from_yaw_pitch_deg(yaw, 0.0) for yaw in yaw_deg])
    direction[40] = np.nan
    recording = Recording("one", np.arange(60), direction, {"authors": labelling_of(movement)})

    ((amplitude, lasts_ms),) = saccades_of([recording])

    assert 10.0 / HMR_DEG == pytest.approx(amplitude)
    assert 4 * 1000.0 / HMR_RATE_HZ == lasts_ms
