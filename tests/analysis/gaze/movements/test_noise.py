"""Fixations are found, in number and length, through the noise of headsets' trackers."""

import numpy as np
import pytest

from benchmarks.gaze_detectors.agreement import agreement, runs_of
from benchmarks.gaze_detectors.worn import Wearing, worn_set
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import MovementParameters

NOISES_DEG = (0.1, 0.2, 0.3, 0.5, 0.8)


@pytest.mark.parametrize("rate_hz", [60.0, 90.0, 120.0, 200.0])
@pytest.mark.parametrize("noise_deg", NOISES_DEG)
def test_fixations_are_as_many_and_as_long_as_they_are(rate_hz: float, noise_deg: float) -> None:
    recordings = worn_set(Wearing(0.0, noise_deg, rate_hz=rate_hz), 3)
    events = [detect_movements(r.t_ns, r.in_world, in_head=r.in_head) for r in recordings]

    truth = [r.truth.movement == Movement.FIXATION for r in recordings]
    called = [e.movement == Movement.FIXATION for e in events]
    of = agreement(truth, called)
    assert of.f1 > 0.97
    assert 0.95 <= of.count_ratio <= 1.05
    lengths = [
        np.mean([end - first for one in labels for first, end in runs_of(one)])
        for labels in (truth, called)
    ]
    assert lengths[1] / lengths[0] == pytest.approx(1.0, abs=0.05)


def test_velocity_is_smoothed_by_as_much_as_the_noise_asks_and_says_so() -> None:
    recordings = [worn_set(Wearing(0.0, noise_deg), 1)[0] for noise_deg in NOISES_DEG]
    movements = [detect_movements(r.t_ns, r.in_world) for r in recordings]

    windows_ms = [f.window_ms for f in movements]
    assert windows_ms == sorted(windows_ms)
    assert windows_ms[0] == 20.0
    assert windows_ms[-1] > 40.0
    assert "ms, as noise asks" not in movements[0].why
    assert f"velocity over {windows_ms[-1]:.0f} ms, as noise asks" in movements[-1].why


def test_the_detector_does_not_change_with_noise_from_trial_to_trial() -> None:
    movements = {
        detect_movements(r.t_ns, r.in_world).detector
        for noise_deg in NOISES_DEG
        for r in worn_set(Wearing(0.0, noise_deg), 2)
    }
    assert movements == {"engbert_kliegl"}


def test_ends_of_saccades_are_those_of_gaze_and_not_of_the_window() -> None:
    r = worn_set(Wearing(0.0, 0.1, rate_hz=250.0), 1)[0]
    wide = MovementParameters(windows_ms=(20.0, 80.0), wide_max_threshold_deg_s=1.0)

    movements = detect_movements(r.t_ns, r.in_world, wide)

    assert movements.window_ms == 80.0
    true_rows = (r.truth.movement == Movement.SACCADE).sum()
    assert (movements.movement == Movement.SACCADE).sum() == pytest.approx(true_rows, rel=0.3)
