"""Logarithm, Euler angles, means and reflections against other implementations and invariants."""

from itertools import permutations
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.stimuli.motion.rotation_cases import random_quats, same, seeds
from visavis.lab.geometry import quat_multiply, rotate, unit
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import (
    continuous,
    euler_from_quat,
    mirrored_quat,
    quat_between,
    quat_exp,
    quat_from_axes,
    quat_from_euler,
    quat_log,
    slerp,
    weighted_mean,
)

ORDERS = ["".join(p) for p in permutations("XYZ")]
quick = settings(max_examples=40, deadline=None)


@quick
@given(seeds)
def test_exponential_undoes_the_logarithm(seed: int) -> None:
    q = random_quats(np.random.default_rng(seed), 20)

    assert np.abs(q - quat_exp(quat_log(q))).max() < 1e-14


def test_logarithm_keeps_tiny_angles_and_the_identity() -> None:
    assert np.array_equal(np.zeros(3), quat_log(np.array([1.0, 0, 0, 0])))
    assert pytest.approx(1e-13) == quat_log(quat_exp(np.array([0, 1e-13, 0])))[1]


@quick
@given(seeds, st.sampled_from([*ORDERS, "XYX", "ZXZ", "YZY"]))
def test_euler_angles_compose_as_scipy_composes_intrinsic_ones(seed: int, order: str) -> None:
    angles = np.random.default_rng(seed).uniform(-9, 9, (10, 3))
    oracle = Rotation.from_euler(order, angles).as_quat(scalar_first=True)

    assert same(oracle, quat_from_euler(angles, order), 1e-12)


@quick
@given(seeds, st.sampled_from(ORDERS))
def test_euler_angles_of_a_rotation_give_it_back(seed: int, order: str) -> None:
    rng = np.random.default_rng(seed)
    q = random_quats(rng, 20)
    locked = quat_from_euler(
        np.stack([rng.uniform(-3, 3, 4), np.array([1, 1, -1, -1]) * np.pi / 2, np.ones(4)], -1),
        order,
    )

    for rotations in (q, locked):
        assert same(rotations, quat_from_euler(euler_from_quat(rotations, order), order), 1e-7)
    assert same(q, quat_from_euler(euler_from_quat(q, order), order), 1e-10)


def test_order_that_repeats_an_axis_cannot_be_read_back() -> None:
    with pytest.raises(MotionError, match="repeats"):
        euler_from_quat(np.array([1.0, 0, 0, 0]), "ZXZ")


@quick
@given(seeds)
def test_rotation_between_directions_takes_one_to_the_other(seed: int) -> None:
    a, b = unit(np.random.default_rng(seed).normal(size=(2, 10, 3)))

    for to in (b, -a, a):
        assert np.abs(to - rotate(quat_between(a, to), a)).max() < 1e-7


@quick
@given(seeds)
def test_axes_of_a_rotation_give_it_back(seed: int) -> None:
    q = random_quats(np.random.default_rng(seed))

    assert same(q, quat_from_axes(*(rotate(q, e) for e in np.eye(3))), 1e-9)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_mirror_turns_reflected_vectors_as_the_original_turns_vectors(
    axis: Literal["X", "Y", "Z"],
) -> None:
    rng = np.random.default_rng(2)
    q, v = random_quats(rng, 30), rng.normal(size=(30, 3))
    flip = np.where(np.arange(3) == "XYZ".index(axis), -1.0, 1.0)

    assert np.abs(flip * rotate(q, v) - rotate(mirrored_quat(q, axis), flip * v)).max() < 1e-12
    assert np.array_equal(q, mirrored_quat(mirrored_quat(q, axis), axis))


def test_continuous_signs_keep_every_rotation() -> None:
    q = random_quats(np.random.default_rng(4), 50, 3)

    unrolled = continuous(q)

    assert np.sum(unrolled[1:] * unrolled[:-1], -1).min() >= 0
    assert same(q, unrolled, 0.0)


@quick
@given(seeds)
def test_mean_is_one_of_its_parts_at_weight_one_and_halfway_at_equal_weights(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = random_quats(rng, 2, 5)

    assert same(q[1], weighted_mean(q, np.array([[0.0] * 5, [1.0] * 5])), 1e-9)
    assert same(slerp(q[0], q[1], 0.5), weighted_mean(q, np.full((2, 5), 0.5)), 1e-6)


@quick
@given(seeds)
def test_mean_ignores_signs_and_turns_with_its_parts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    near = quat_exp(rng.normal(0, 0.3, (4, 3)))
    w, turn = rng.uniform(0, 1, 4), random_quats(rng)
    expected = weighted_mean(near, w)

    assert same(expected, weighted_mean(near * rng.choice([-1.0, 1.0], (4, 1)), w), 1e-9)
    assert same(quat_multiply(turn, expected), weighted_mean(quat_multiply(turn, near), w), 1e-9)
