"""A measured walk is kept without losing a bit."""

import json

import numpy as np

from experiments.crowd.measures import MeasuredWalk
from experiments.crowd.measuring import as_json, from_json


def test_a_measured_walk_survives_json_bit_for_bit():
    walk = MeasuredWalk(
        {"a": np.float64(0.1), "b": np.int64(3), "c": float("nan")},
        [{"v": 1 / 3}],
        [],
        ((1, 2, 3), None),
        np.array([[0.25, -1.5]]),
    )
    back = from_json(json.loads(json.dumps(as_json(walk))))
    assert ({"a": 0.1, "b": 3, "c": None}, [{"v": 1 / 3}]) == (back.row, back.collisions)
    assert ((1, 2, 3), None) == back.cells
    assert (walk.track_m == back.track_m).all()
