import numpy as np
import pytest

from visavis.analysis.gaze.targets import GazeTargets
from visavis.experiments.stare.trial_example import causing_look_ms, trial_example
from visavis.lab.errors import DataError

STEP_NS = 8_000_000
ROW = {
    "participant": "S01",
    "trial_id": "T01",
    "condition": "AD",
    "place": "centre_close",
    "active_index": 1,
    "t_start_ns": 0,
    "t_end_ns": 250 * STEP_NS,
    "switch_ns": 100 * STEP_NS,
}


def gaze() -> GazeTargets:
    """Two seconds: on the second of two heads from sample 100 to 149, lost from 200 on."""
    n = 250
    angle = np.full((n, 2), 20.0)
    angle[100:150, 1] = 1.0
    hit = np.where(angle[:, 1] < 3, 1, -1).astype(np.int16)
    valid = np.arange(n) < 200
    angle[~valid], hit[~valid] = np.nan, -2
    return GazeTargets(
        t_ns=np.arange(n, dtype=np.int64) * STEP_NS,
        valid=valid,
        direction_world=np.tile([0.0, 0.0, -1.0], (n, 1)),
        angle_deg=angle,
        radius_deg=np.full((n, 2), 3.0),
        pad_limit_deg=np.full((n, 2), 0.4),
        hit=hit,
    )


def test_example_holds_the_look_the_switch_and_the_loss():
    example = trial_example(gaze(), ROW)

    assert example.looks_ms == ((800.0, 400.0, True),)
    assert example.switch_ms == 800.0
    assert example.end_ms == 2000.0
    assert np.isnan(example.angle_deg[200:]).all()
    assert example.radius_deg == pytest.approx(3.4)


def test_trial_without_a_switch_has_none():
    assert trial_example(gaze(), ROW | {"switch_ns": float("nan")}).switch_ms is None


def test_unfinished_trial_is_refused():
    with pytest.raises(DataError, match="t_end_ns is missing"):
        trial_example(gaze(), ROW | {"t_end_ns": None})


def test_length_of_the_look_that_caused_the_change():
    example = trial_example(gaze(), ROW)

    assert causing_look_ms(example, 800.0) == 400.0
    assert causing_look_ms(example, 100.0) == 0.0
