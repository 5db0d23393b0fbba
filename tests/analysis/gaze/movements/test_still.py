"""On still pictures slow saccades part fixations, which they must not where something moves."""

import numpy as np
import pytest

from benchmarks.gaze_detectors.agreement import runs_of
from benchmarks.gaze_detectors.sets import Labelling, Recording
from benchmarks.gaze_detectors.thresholds import score
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import AUTO, STILL, MovementParameters
from visavis.lab.geometry import unit

RATE_HZ = 500.0
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


@pytest.mark.parametrize(("params", "found"), [(STILL, 1.0), (AUTO, 0.25)])
def test_small_saccades_part_fixations_on_still_pictures_only(
    rests: Recording, params: MovementParameters, found: float
) -> None:
    assert found == score([rests], params).count_ratio


def test_labels_that_are_found_agree_wholly(rests: Recording) -> None:
    assert 1.0 == score([rests], STILL).f1
