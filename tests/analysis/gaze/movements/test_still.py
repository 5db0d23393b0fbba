"""The least speed of a saccade follows how fast slow gaze moves."""

import numpy as np
import pytest

from benchmarks.gaze_detectors.agreement import runs_of
from benchmarks.gaze_detectors.sets import Labelling, Recording
from benchmarks.gaze_detectors.thresholds import FixationScore, score
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import AUTO, STILL, MovementParameters
from visavis.lab.geometry import unit

RATE_HZ = 500.0
SWING_HZ = 0.5
REST, JUMP = 200, 15
"""Rows of a rest (400 ms) and of a saccade (30 ms)."""
STEP_DEG = 0.45
"""The jump's size: its greatest speed is 1.875 · 0.45° / 30 ms, some 28°/s."""


@pytest.fixture
def rests() -> Recording:
    """Four rests parted by three small saccades of minimum jerk, labelled as they are."""
    s = np.arange(1, JUMP + 1) / JUMP
    jump = STEP_DEG * (10 * s**3 - 15 * s**4 + 6 * s**5)
    pieces, labels, at = [], [], 0.0
    for i in range(4):
        pieces.append(np.full(REST, at))
        labels.append(np.full(REST, Movement.FIXATION, dtype=np.int8))
        if i < 3:
            pieces.append(at + jump)
            labels.append(np.full(JUMP, Movement.SACCADE, dtype=np.int8))
            at += STEP_DEG
    rng = np.random.default_rng(1)
    x, y = np.deg2rad(np.stack([np.concatenate(pieces), np.zeros(4 * REST + 3 * JUMP)]))
    x, y = (v + np.deg2rad(0.003) * rng.standard_normal(v.size) for v in (x, y))
    direction = unit(np.stack([np.tan(x), np.tan(y), -np.ones(x.size)], axis=1))
    movement = np.concatenate(labels)
    runs = runs_of(movement == Movement.FIXATION)
    t_ns = np.round(np.arange(x.size) * 1e9 / RATE_HZ).astype(np.int64)
    return Recording("small", t_ns, direction, {"maker": Labelling(movement, runs)})


@pytest.mark.parametrize("params", [AUTO, STILL])
def test_small_saccades_part_fixations_where_gaze_rests(
    rests: Recording, params: MovementParameters
) -> None:
    assert FixationScore(f1=1.0, count_ratio=1.0) == score([rests], params)


@pytest.mark.parametrize(("swing_deg_s", "saccades"), [(0.0, 3), (15.0, 0)])
def test_steps_as_fast_as_slow_gaze_are_no_saccades(
    rests: Recording, swing_deg_s: float, saccades: int
) -> None:
    phase = 2 * np.pi * SWING_HZ * rests.t_ns / 1e9
    up = np.deg2rad(swing_deg_s) / (2 * np.pi * SWING_HZ) * np.sin(phase)
    swung = unit(rests.direction + up[:, None] * (0.0, 1.0, 0.0))
    movements = detect_movements(rests.t_ns, swung)
    assert saccades == np.count_nonzero(movements.kind == Movement.SACCADE)


def test_the_least_speed_of_a_saccade_is_a_setting_still(rests: Recording) -> None:
    params = MovementParameters(minimum_deg_s=30.0, max_minimum_deg_s=30.0)
    assert 0.25 == score([rests], params).count_ratio
