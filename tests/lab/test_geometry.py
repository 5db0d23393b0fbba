"""One vector is turned and scaled as many are, to the last bit: recordings rest on it."""

import numpy as np

from visavis.lab.geometry import Vector, rotate, turn_towards, unit

MANY = 1000
RNG = np.random.default_rng(1)
TURNS = unit(RNG.normal(size=(MANY, 3))), RNG.uniform(-np.pi, np.pi, (MANY, 1))
QUATERNIONS = np.hstack([np.cos(TURNS[1] / 2), np.sin(TURNS[1] / 2) * TURNS[0]])
VECTORS: Vector = RNG.normal(size=(MANY, 3)) * 10.0 ** RNG.uniform(-3, 3, (MANY, 1))
NOWHERE = np.array([[0.0, 0.0, 0.0], [np.nan, 1.0, 0.0], [np.inf, 0.0, 0.0]])


def test_one_vector_is_rotated_as_many_are() -> None:
    one_by_one = [rotate(q, v) for q, v in zip(QUATERNIONS, VECTORS, strict=True)]
    assert rotate(QUATERNIONS, VECTORS).tobytes() == np.array(one_by_one).tobytes()


def test_one_vector_is_scaled_to_length_one_as_many_are() -> None:
    assert unit(VECTORS).tobytes() == np.array([unit(v) for v in VECTORS]).tobytes()
    assert np.isnan(unit(NOWHERE)).all()
    assert np.isnan([unit(v) for v in NOWHERE]).all()


def test_vectors_of_single_precision_keep_it() -> None:
    q, v = QUATERNIONS[0].astype("f4"), VECTORS[0].astype("f4")
    assert np.float32 == rotate(q, v).dtype == unit(v).dtype


def test_a_turn_towards_a_direction_brings_what_is_ahead_there() -> None:
    ahead = np.array([0.0, 0.0, -1.0])
    for direction in (*unit(VECTORS), -ahead, ahead):
        np.testing.assert_allclose(rotate(turn_towards(direction), ahead), direction, atol=1e-7)


def test_what_has_four_numbers_is_scaled_as_well() -> None:
    assert unit(np.array([3.0, 0.0, 4.0, 0.0])).tolist() == [0.6, 0.0, 0.8, 0.0]
