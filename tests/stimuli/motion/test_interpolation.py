"""Invariants of LinEuler, Slerp and Squad, and the traps found by experiment."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.spatial.transform import Slerp as ScipySlerp

from tests.stimuli.motion.rotation_cases import (
    Array,
    apart_deg,
    random_quats,
    same,
    seeds,
    spin,
    steps_of,
)
from visavis.lab.geometry import quat_multiply
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.interpolation import (
    Interpolation,
    KeyTimes,
    LinEuler,
    Method,
    Slerp,
    Spline,
    Squad,
    interpolate,
)
from visavis.stimuli.motion.rotations import quat_conjugate, quat_from_euler, slerp, slerp_as_given

METHODS: tuple[Method, ...] = ("lineuler", "slerp", "squad")
quick = settings(max_examples=40, deadline=None)


def uneven(rng: np.random.Generator, n: int, closed: bool = False) -> KeyTimes:
    t = np.cumsum(rng.uniform(0.1, 1.0, n + 1))
    return KeyTimes(t[:-1], float(t[-1] - t[0]) if closed else None)


def velocity(curve: Interpolation, t_s: Array, step_s: float) -> Array:
    """Return the rotation vector per second from t_s to t_s + step_s, in the parent's axes."""
    turn = quat_multiply(curve.at(t_s + step_s), quat_conjugate(curve.at(t_s)))
    turn *= np.where(turn[..., :1] < 0, -1.0, 1.0)
    return 2 * turn[..., 1:] / step_s


@quick
@given(seeds, st.sampled_from(METHODS), st.booleans())
def test_every_method_meets_its_keys(seed: int, method: Method, closed: bool) -> None:
    rng = np.random.default_rng(seed)
    keys = steps_of(rng, 5, 170.0, 3)
    times = uneven(rng, 5, closed)

    curve = interpolate(method, times, keys)

    assert same(keys, curve.at(times.t_s), 1e-9 if method == "lineuler" else 1e-12)
    last = curve.in_segment(len(times.segment_s) - 1, 1.0)
    assert same(keys[0 if closed else -1], last, 1e-9 if method == "lineuler" else 1e-12)


@quick
@given(seeds, st.sampled_from(METHODS))
def test_results_are_unit_quaternions(seed: int, method: Method) -> None:
    rng = np.random.default_rng(seed)
    times = uneven(rng, 6, closed=True)
    curve = interpolate(method, times, random_quats(rng, 6, 2))

    q = curve.at(rng.uniform(-5, 5, 200))

    assert np.abs(np.linalg.norm(q, axis=-1) - 1).max() < 1e-12


@quick
@given(seeds, st.sampled_from(["slerp", "squad"]))
def test_turning_all_keys_in_the_world_or_in_the_joint_turns_the_result(
    seed: int, method: Method
) -> None:
    rng = np.random.default_rng(seed)
    keys, turn = steps_of(rng, 5, 150.0), random_quats(rng)
    times, t = uneven(rng, 5), rng.uniform(0, 3, 50)
    expected = interpolate(method, times, keys).at(t)

    before = interpolate(method, times, quat_multiply(turn, keys)).at(t)
    after = interpolate(method, times, quat_multiply(keys, turn)).at(t)

    assert same(quat_multiply(turn, expected), before, 1e-9)
    assert same(quat_multiply(expected, turn), after, 1e-9)


@quick
@given(seeds, st.sampled_from(METHODS), st.booleans())
def test_signs_of_the_keys_do_not_matter(seed: int, method: Method, closed: bool) -> None:
    rng = np.random.default_rng(seed)
    keys = steps_of(rng, 5, 170.0)
    times, t = uneven(rng, 5, closed), rng.uniform(-1, 4, 50)
    signs = rng.choice([-1.0, 1.0], (5, 1))

    expected = interpolate(method, times, keys).at(t)

    assert same(expected, interpolate(method, times, signs * keys).at(t), 1e-9)


@quick
@given(seeds, st.sampled_from(METHODS))
def test_keys_in_reverse_order_give_the_motion_backwards(seed: int, method: Method) -> None:
    rng = np.random.default_rng(seed)
    keys, times = steps_of(rng, 6, 160.0), uneven(rng, 6)
    t = rng.uniform(times.t_s[0], times.t_s[-1], 50)
    expected = interpolate(method, times, keys).at(t)

    backwards = interpolate(method, KeyTimes(-times.t_s[::-1]), keys[::-1]).at(-t)

    assert same(expected, backwards, 1e-9)


@quick
@given(seeds, st.floats(20.0, 170.0), st.booleans())
def test_angular_velocity_of_squad_is_continuous_at_keys(
    seed: int, largest_deg: float, closed: bool
) -> None:
    rng = np.random.default_rng(seed)
    times = uneven(rng, 6, closed)
    curve = Squad(times, steps_of(rng, 6, largest_deg))
    inner = times.t_s if closed else times.t_s[1:-1]
    jumps = []

    for step_s in (1e-4, 1e-5):
        before, after = velocity(curve, inner - step_s, step_s), velocity(curve, inner, step_s)
        jumps.append(np.linalg.norm(after - before, axis=-1).max())

    # The finite difference shrinks with the step; a break in velocity would stay.
    assert jumps[1] < max(jumps[0] / 5, 1e-5)


def test_angular_velocity_of_slerp_breaks_at_keys() -> None:
    rng = np.random.default_rng(3)
    curve = Slerp(KeyTimes(np.arange(5.0)), steps_of(rng, 5, 90.0))
    inner = np.arange(1.0, 4.0)

    jump = velocity(curve, inner, 1e-5) - velocity(curve, inner - 1e-5, 1e-5)

    assert np.linalg.norm(jump, axis=-1).min() > 0.1


def test_uniform_formula_on_uneven_times_breaks_where_the_time_aware_does_not() -> None:
    keys = spin((0, 1, 0), [0.0, 20.0, 60.0, 70.0])
    times = KeyTimes(np.array([0.0, 1.0, 1.2, 3.0]))
    breaks = {
        aware: np.linalg.norm(
            velocity(curve, times.t_s[1:3], 1e-6) - velocity(curve, times.t_s[1:3] - 1e-6, 1e-6),
            axis=-1,
        ).max()
        for aware in (True, False)
        if (curve := Squad(times, keys, time_aware=aware))
    }

    assert breaks[True] < 1e-3 < 1.0 < breaks[False]


@quick
@given(seeds, st.floats(1.0, 170.0))
def test_even_steps_about_one_axis_make_squad_a_slerp(seed: int, step_deg: float) -> None:
    rng = np.random.default_rng(seed)
    keys = quat_multiply(random_quats(rng), spin(rng.normal(size=3), step_deg * np.arange(6)))
    times, t = KeyTimes(np.arange(6.0)), rng.uniform(1, 4, 40)

    assert same(Slerp(times, keys).at(t), Squad(times, keys).at(t), 1e-9)


@quick
@given(seeds, st.floats(1.0, 170.0))
def test_two_keys_to_and_fro_ease_in_and_out(seed: int, apart: float) -> None:
    rng = np.random.default_rng(seed)
    keys = quat_multiply(random_quats(rng), spin(rng.normal(size=3), [0.0, apart]))
    h = rng.uniform(0, 1, 40)
    curve = Squad(KeyTimes(np.array([0.0, 1.0]), period_s=2.0), keys)

    assert same(slerp(keys[0], keys[1], 3 * h**2 - 2 * h**3), curve.at(h), 1e-9)
    assert same(curve.at(h), curve.at(2.0 - h), 1e-9)
    mid = np.linalg.norm(velocity(curve, np.array([0.5 - 5e-5]), 1e-4))
    assert pytest.approx(1.5 * np.radians(apart), rel=1e-3) == mid


def test_squad_about_one_axis_follows_the_closed_form() -> None:
    theta = np.array([0.0, 30.0, 45.0, 100.0, 60.0])
    sigma = theta.copy()
    sigma[1:-1] -= (theta[2:] - 2 * theta[1:-1] + theta[:-2]) / 4
    curve = Squad(KeyTimes(np.arange(5.0)), spin((1, 2, 3), theta))
    segment = np.repeat(np.arange(4), 9)
    h = np.tile(np.linspace(0, 1, 9), 4)
    k = 2 * h * (1 - h)
    lerp = [(1 - h) * x[segment] + h * x[segment + 1] for x in (theta, sigma)]

    expected = spin((1, 2, 3), (1 - k) * lerp[0] + k * lerp[1])

    assert same(expected, curve.in_segment(segment, h), 1e-12)


@quick
@given(seeds, st.floats(95.0, 170.0))
def test_squad_does_not_jump_between_keys_far_apart(seed: int, apart: float) -> None:
    rng = np.random.default_rng(seed)
    curve = Squad(KeyTimes(np.arange(5.0)), steps_of(rng, 5, apart, 4))
    t = np.linspace(0, 4, 4001)

    q = curve.at(t)

    assert apart_deg(q[1:], q[:-1]).max() < 2.5


def test_shorter_arcs_inside_squad_would_jump_on_the_same_keys() -> None:
    rng = np.random.default_rng(1)
    keys = steps_of(rng, 5, 170.0, 20)
    curve = Squad(KeyTimes(np.arange(5.0)), keys)
    h = np.linspace(0, 1, 1001)[:, None]
    start, end, leave, arrive = (x[1][None] for x in curve._ends)

    flipped = slerp(slerp(start, end, h), slerp(leave, arrive, h), 2 * h * (1 - h))

    assert apart_deg(flipped[1:], flipped[:-1]).max() > 10.0
    assert apart_deg(*(curve.in_segment(1, h[i:, 0])[:1000] for i in (0, 1))).max() < 2.5


def test_neighbours_in_place_of_controls_back_up_at_a_key() -> None:
    keys = spin((0, 1, 0), 10.0 * np.arange(6))
    curve = Squad(KeyTimes(np.arange(6.0)), keys, controls="neighbours")

    at_key = velocity(curve, np.array([2.0]), 1e-6)[0, 1]

    assert pytest.approx(-np.radians(10.0), rel=1e-4) == at_key


@quick
@given(seeds)
def test_slerp_agrees_with_scipy_and_has_constant_speed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    keys, times = random_quats(rng, 5), uneven(rng, 5)
    t = np.linspace(times.t_s[0], times.t_s[-1], 301)
    oracle = ScipySlerp(times.t_s, Rotation.from_quat(keys, scalar_first=True))

    curve = Slerp(times, keys)

    assert same(oracle(t).as_quat(scalar_first=True), curve.at(t), 1e-9)
    h = curve.in_segment(0, np.linspace(0, 1, 33))
    steps = apart_deg(h[1:], h[:-1])
    assert pytest.approx(steps[0], rel=1e-6) == steps


@quick
@given(seeds, st.floats(0.0, 1.0))
def test_slerp_from_the_other_end_is_the_same(seed: int, h: float) -> None:
    rng = np.random.default_rng(seed)
    p, q = random_quats(rng, 2)

    assert same(slerp(p, q, h), slerp(q, p, 1 - h), 1e-12)


@pytest.mark.parametrize("apart", [51.0, 52.0, 1e-9, 0.0])
def test_series_and_trigonometry_agree_about_the_change_over(apart: float) -> None:
    p, q = spin((1, 1, 0), [0.0, apart])
    h = np.linspace(-0.9, 1.9, 29)

    assert same(spin((1, 1, 0), apart * h), slerp(p, q, h), 2e-15)


@pytest.mark.parametrize(
    "apart",
    [
        *([x] for x in (16.1, 16.3, 28.0, 28.2, 51.6, 51.8, 91.0, 91.2, 119.9, 120.1, 179.0)),
        [0.0, 1e-7, 10.0, 20.0, 40.0, 80.0, 110.0, 130.0, 170.0],
    ],
)
def test_every_length_of_the_series_reaches_double_precision(apart: list[float]) -> None:
    h = np.linspace(0, 1, 33)
    ends = spin((1, -1, 2), np.array([[0.0] * len(apart), apart]))
    expected = spin((1, -1, 2), h[:, None] * np.array(apart))
    times = KeyTimes(np.array([0.0, 1.0]))

    eased = 3 * h**2 - 2 * h**3
    squad = Squad(KeyTimes(times.t_s, period_s=2.0), ends)

    assert same(expected, Slerp(times, ends).at(h), 3e-15)
    assert same(spin((1, -1, 2), eased[:, None] * np.array(apart)), squad.at(h), 1e-14)


def test_opposite_signs_of_one_rotation_stay_unit_on_the_way() -> None:
    p = spin((1, 0, 0), 40.0)

    q = slerp_as_given(p, -p, np.linspace(0, 1, 11))

    assert np.abs(np.linalg.norm(q, axis=-1) - 1).max() < 1e-12
    assert np.abs(q[-1] + p).max() < 1e-12


@quick
@given(seeds, st.integers(0, 2), st.sampled_from(["ZXY", "ZYX", "XYZ", "YXZ"]))
def test_lineuler_is_a_slerp_when_one_angle_changes(seed: int, which: int, order: str) -> None:
    rng = np.random.default_rng(seed)
    keys = np.tile(rng.uniform(-1, 1, 3), (2, 1))
    keys[1, which] += rng.uniform(-3, 3)
    times, t = KeyTimes(np.array([0.0, 1.0])), np.linspace(0, 1, 11)

    expected = Slerp(times, quat_from_euler(keys, order)).at(t)

    assert same(expected, LinEuler(times, keys, order).at(t), 1e-9)


def test_lineuler_takes_angles_as_authored_unless_told_to_unwrap() -> None:
    keys = np.radians([[170.0, 0.0, 0.0], [-170.0, 0.0, 0.0]])
    times = KeyTimes(np.array([0.0, 1.0]))

    assert same(spin((0, 0, 1), 0.0), LinEuler(times, keys, "ZXY").at(0.5))
    assert same(spin((0, 0, 1), 180.0), LinEuler(times, keys, "ZXY", unwrap=True).at(0.5))


@pytest.mark.parametrize("method", METHODS)
def test_one_call_answers_for_many_people_at_their_own_times(method: Method) -> None:
    rng = np.random.default_rng(5)
    curve = interpolate(method, KeyTimes(np.arange(4.0), period_s=4.0), steps_of(rng, 4, 60.0, 7))
    t = rng.uniform(0, 20, (3, 5))

    q = curve.at(t)

    assert (3, 5, 7, 4) == q.shape
    assert np.array_equal(q[1, 2], curve.at(t[1, 2]))


def test_open_motion_rests_outside_its_keys_and_closed_repeats() -> None:
    keys = spin((0, 0, 1), [0.0, 40.0, 50.0])
    opened = Slerp(KeyTimes(np.array([1.0, 2.0, 3.0])), keys)
    beyond = Slerp(KeyTimes(np.array([1.0, 2.0, 3.0]), extrapolate=True), keys)
    closed = Slerp(KeyTimes(np.array([1.0, 2.0, 3.0]), period_s=3.0), keys)

    assert same(keys[[0, 2]], opened.at([0.0, 9.0]))
    assert same(spin((0, 0, 1), [-40.0, 60.0]), beyond.at([0.0, 4.0]))
    assert same(closed.at([1.5, 3.5]), closed.at([1.5 - 6.0, 3.5 + 30.0]), 1e-9)


@pytest.mark.parametrize(
    ("t_s", "period_s"),
    [([0.0], None), ([0.0, 0.0], None), ([1.0, 0.0], None), ([0.0, np.nan], None), ([0, 1], 1.0)],
)
def test_impossible_key_times_are_refused(t_s: list[float], period_s: float | None) -> None:
    with pytest.raises(MotionError):
        KeyTimes(np.array(t_s), period_s)


@pytest.mark.parametrize("bad", [[1, 0, 0, 0.2], [np.nan, 0, 0, 1], [0, 0, 0, 0], [1, 0, 0]])
def test_keys_that_are_no_rotations_are_refused(bad: list[float]) -> None:
    with pytest.raises(MotionError, match=r"index|shape"):
        Squad(KeyTimes(np.array([0.0, 1.0])), np.array([bad, bad]))


def test_wrong_segment_time_order_and_count_are_refused() -> None:
    times, keys = KeyTimes(np.array([0.0, 1.0])), np.tile([1.0, 0, 0, 0], (2, 1))

    for segment in (1, -1, [0, 1], [0, -1]):
        with pytest.raises(MotionError, match="segments"):
            Slerp(times, keys).in_segment(segment, 0.5)
    with pytest.raises(MotionError, match="not a number"):
        Slerp(times, keys).at(np.nan)
    with pytest.raises(MotionError, match="axis order"):
        LinEuler(times, np.zeros((2, 3)), "ZXX")
    with pytest.raises(MotionError, match="one time per key"):
        Slerp(times, np.tile(keys, (2, 1)))


@quick
@given(seeds)
def test_a_spline_meets_its_keys_and_nothing_jumps_but_the_third_derivative(seed: int) -> None:
    rng = np.random.default_rng(seed)
    keys, times = steps_of(rng, 5, 100.0, 3), uneven(rng, 5)
    curve, h = Spline(times, keys), 1e-4
    assert same(keys, curve.at(times.t_s), 1e-9)

    def acceleration(t_s: Array) -> Array:
        return (velocity(curve, t_s + h, h) - velocity(curve, t_s, h)) / h

    inner = times.t_s[1:-1]
    before, after = acceleration(inner - 2.5 * h), acceleration(inner + 0.5 * h)
    assert np.abs(after - before).max() < 0.02 * (1 + np.abs(before).max())


def test_squad_does_jump_in_acceleration_where_a_spline_does_not() -> None:
    rng = np.random.default_rng(3)
    keys, times, h = steps_of(rng, 5, 100.0, 3), uneven(rng, 5), 1e-4
    inner = times.t_s[1:-1]

    def jump(curve: Interpolation) -> float:
        sides = [
            (velocity(curve, inner + at + h, h) - velocity(curve, inner + at, h)) / h
            for at in (-2.5 * h, 0.5 * h)
        ]
        return float(np.abs(sides[1] - sides[0]).max())

    assert jump(Squad(times, keys)) > 50 * jump(Spline(times, keys))


def test_a_closed_spline_is_refused() -> None:
    with pytest.raises(MotionError, match="Squad"):
        Spline(KeyTimes(np.array([0.0, 1.0, 2.0]), 3.0), np.eye(4)[:3])
