from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.warping.bodies import arm_raised, box_person, waving_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_limits import beyond_deg, clamp_turns
from visavis.stimuli.motion.warping.clips import smooth_offsets, warp_clip
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Situation,
    cap_length,
    control_step,
    damped_solution,
    scale_of,
    see,
    steer,
    wanted_features,
)
from visavis.stimuli.motion.warping.features import FeatureTarget, register_feature
from visavis.stimuli.motion.warping.outlook import looking_at, outlook
from visavis.stimuli.motion.warping.units import UNITS, turned_by, units_named
from visavis.stimuli.rooms.solids import box

CENTRE = np.array([0.0, 1.1, 0.0])
CAREFUL = ControlSettings()
SEARCHED = ControlSettings(search=True, wide_probe_deg=12.0)
either_way = pytest.mark.parametrize("loop", [CAREFUL, SEARCHED], ids=["plain", "searched"])


def situation(change=0.25, *, yaw_deg=50.0, units=("all",), parts=("face", "right_hand"), **more):
    yaw = np.radians(yaw_deg)
    eye = CENTRE + 3.0 * np.array([-np.sin(yaw), 0.1, -np.cos(yaw)])
    root, turns = arm_raised()
    return Situation(
        box_person(),
        outlook(looking_at(eye, CENTRE, 1.15), 128, **more),
        (FeatureTarget("coverage", parts, change),),
        units_named(units),
        root,
        turns,
    )


def test_there_are_the_22_units_of_the_source():
    assert len(UNITS) == 22
    assert [3, 3, 8, 8] == [
        len(units_named((g,))) for g in ("spine", "neck_head", "left_arm", "right_arm")
    ]


def test_offsets_of_zero_change_no_bit():
    root, turns = arm_raised()
    del root
    warped = turned_by(box_person().skeleton, units_named(("all",)), turns, np.zeros(22))
    np.testing.assert_array_equal(turns, warped)


@given(angle=st.floats(-1.0, 1.0))
def test_spine_shares_add_up_to_the_unit(angle):
    skeleton = box_person().skeleton
    _, turns = arm_raised()
    warped = turned_by(skeleton, units_named(("spine_turn",)), turns, np.array([angle]))
    halves = [
        np.arctan2(warped[skeleton.index(j), 2], warped[skeleton.index(j), 0])
        for j in ("spine", "chest", "upper_chest")
    ]
    assert angle == pytest.approx(2 * sum(halves), abs=1e-12)


def test_wanted_coverage_is_reached_within_a_tenth_in_five_steps():
    outcome = steer(situation(0.25, yaw_deg=25.0), replace(CAREFUL, most_steps=5))
    assert outcome.is_reached
    assert abs(outcome.goal - outcome.final) <= 0.1 * abs(outcome.goal - outcome.original)


def test_decrease_lowers_what_is_seen():
    outcome = steer(situation(-0.3, parts=("face",)), CAREFUL)
    assert outcome.final[0] < 0.85 * outcome.original[0]


@either_way
def test_nothing_perceived_means_nothing_moves_and_no_nan(loop):
    wall = box((0, 1.2, -1.2), (8, 8, 0.05), (0, 0, 0))
    hidden = situation(0.5, yaw_deg=0.0, occluders=[wall])
    outcome = steer(hidden, loop)
    np.testing.assert_array_equal(np.zeros(22), outcome.omega_rad)
    np.testing.assert_array_equal([0.0], outcome.original)
    step = control_step(hidden, np.zeros(22), np.array([0.2]), scale_of(hidden, np.zeros(1)), loop)
    assert np.isfinite(step.next_rad).all()
    np.testing.assert_array_equal(np.zeros(22), step.next_rad)


@either_way
def test_target_equal_to_the_present_leaves_the_clip_bit_for_bit(loop):
    clip = waving_clip()
    here = situation(0.0)
    warped = warp_clip(clip, here.body, here.view, here.targets, here.units, loop)
    np.testing.assert_array_equal(clip.orientation_wxyz, warped.clip.orientation_wxyz)
    np.testing.assert_array_equal(clip.root_m, warped.clip.root_m)
    assert warped.is_reached.all()


def test_mirrored_camera_mirrors_the_sign_of_a_turn_of_the_head():
    signs = []
    for yaw in (60.0, -60.0):
        here = situation(0.3, yaw_deg=yaw, units=("head_turn",), parts=("face",))
        scale = scale_of(here, see(here, np.zeros((1, 1)))[0])
        # A turn to the left (positive) shows more of the face to somebody on the left.
        up, down = see(here, np.array([[0.1], [-0.1]]))
        signs.append(float(np.sign(scale * (up - down))[0]))
    assert signs[0] == -signs[1]
    assert signs[0] != 0


@given(error=st.lists(st.floats(-5, 5), min_size=1, max_size=4), cap=st.floats(0.01, 2))
def test_asked_change_is_never_longer_than_its_cap(error, cap):
    assert np.linalg.norm(cap_length(np.array(error), cap)) <= cap * (1 + 1e-12)


@given(rows=st.integers(1, 4), seed=st.integers(0, 2**31 - 1), damping=st.floats(0.01, 1.0))
def test_damped_solution_is_the_regularised_least_squares_one(rows, seed, damping):
    rng = np.random.default_rng(seed)
    jacobian, change = rng.standard_normal((rows, 22)), rng.standard_normal(rows)
    stacked = np.vstack([jacobian, damping * np.eye(22)])
    expected = np.linalg.lstsq(stacked, np.concatenate([change, np.zeros(22)]), rcond=None)[0]
    np.testing.assert_allclose(
        expected, damped_solution(jacobian, change, damping), rtol=1e-6, atol=1e-9
    )


@either_way
@settings(max_examples=10, deadline=None)
@given(change=st.floats(-1, 2), yaw=st.floats(-90, 90))
def test_no_step_turns_a_unit_beyond_its_cap_or_range(loop, change, yaw):
    here = situation(change, yaw_deg=yaw)
    scale = scale_of(here, see(here, np.zeros((1, 22)))[0])
    reach = np.radians([u.range_deg for u in here.units])
    omega = 0.98 * reach
    step = control_step(here, omega, np.array([1.0]), scale, loop)
    assert np.abs(step.next_rad - omega).max() <= np.radians(loop.step_cap_deg) + 1e-12
    assert (np.abs(step.next_rad) <= reach + 1e-12).all()
    assert np.linalg.norm(step.change) <= loop.error_cap + 1e-12


def test_searched_steps_leave_no_more_than_plain_ones():
    here = situation(0.4, units=("spine", "neck_head", "right_arm"))
    plain, searched = (steer(here, replace(loop, most_steps=2)) for loop in (CAREFUL, SEARCHED))
    assert abs(searched.goal - searched.final)[0] <= abs(plain.goal - plain.final)[0]


def test_wide_probe_finds_a_hand_that_is_wholly_hidden():
    board = box((0.745, 1.15, -1.0), (0.9, 1.3, 0.04), (0, 0, 0))
    here = situation(
        0.25, yaw_deg=0.0, units=("right_arm",), parts=("face", "right_hand"), occluders=[board]
    )
    alone = replace(here, targets=(FeatureTarget("coverage", ("right_hand",), 0.0),))
    assert see(alone, np.zeros((1, 8)))[0, 0] == 0.0
    assert steer(here, replace(SEARCHED, wide_probe_deg=30.0, step_cap_deg=10.0)).is_reached
    assert not steer(here, replace(SEARCHED, wide_probe_deg=0.0, step_cap_deg=10.0)).is_reached


def test_wide_probe_without_a_searched_step_is_refused():
    with pytest.raises(MotionError, match="set search as well"):
        ControlSettings(wide_probe_deg=12.0)


@either_way
def test_threads_do_not_change_a_warp(loop):
    here = situation(0.25)
    one, two = (
        warp_clip(
            waving_clip(),
            here.body,
            here.view,
            here.targets,
            here.units,
            replace(loop, threads=n, rate_hz=3.0),
        )
        for n in (1, 2)
    )
    np.testing.assert_array_equal(one.clip.orientation_wxyz, two.clip.orientation_wxyz)


def test_unreachable_target_says_so_and_keeps_the_best():
    here = situation(1.9, units=("right_wrist_twist",), parts=("legs",))
    warped = warp_clip(waving_clip(), here.body, here.view, here.targets, here.units)
    assert not warped.is_reached.any()
    assert "best these units allow" in warped.summary
    assert (
        np.abs(warped.goal - warped.final) <= np.abs(warped.goal - warped.original) + 1e-9
    ).all()


def test_feature_of_a_user_can_be_steered():
    def middle_of_face(ids, wanted):
        columns = np.flatnonzero(wanted[ids].any(axis=0))
        return float(columns.mean() / ids.shape[1]) if columns.size else 0.0

    register_feature("middle_of_parts", middle_of_face)
    here = replace(
        situation(units=("spine", "neck_head")),
        targets=(FeatureTarget("middle_of_parts", ("face",), 0.05),),
    )
    outcome = steer(here, CAREFUL)
    assert outcome.final[0] == pytest.approx(outcome.goal[0], abs=0.01)
    with pytest.raises(MotionError, match="already a visual feature"):
        register_feature("coverage", middle_of_face)


@given(st.lists(st.floats(-1, 1), min_size=2, max_size=30))
def test_filter_over_time_stays_within_what_it_filters(values):
    series = np.array(values)[:, None]
    out = smooth_offsets(series, 0.1 * np.arange(len(series)), 0.25)
    assert out.min() >= series.min() - 1e-12
    assert out.max() <= series.max() + 1e-12


def test_filter_keeps_zeros_and_delays_nothing():
    t = 0.1 * np.arange(101)
    np.testing.assert_array_equal(np.zeros((101, 2)), smooth_offsets(np.zeros((101, 2)), t, 0.25))
    bump = np.exp(-((t - 5.0) ** 2))[:, None]
    assert 5.0 == pytest.approx(t[np.argmax(smooth_offsets(bump, t, 0.25))], abs=0.1)


@pytest.mark.parametrize("change", [{"damping": 0.0}, {"probe_deg": -1.0}, {"rate_hz": np.nan}])
def test_parameters_of_the_loop_are_above_zero(change):
    with pytest.raises(MotionError, match="above 0"):
        ControlSettings(**change)


@pytest.mark.parametrize("names", [(), ("tail",)])
def test_unknown_or_missing_units_are_refused(names):
    with pytest.raises(MotionError, match="warping unit"):
        units_named(names)


def test_skeleton_without_arms_is_refused_by_name():
    skeleton = box_person().skeleton
    keep = [i for i, n in enumerate(skeleton.names) if "left_" not in n and "right_" not in n]
    bare = type(skeleton)(
        tuple(skeleton.names[i] for i in keep),
        np.array([keep.index(p) if p >= 0 else -1 for p in skeleton.parents[keep]]),
        skeleton.offsets_m[keep],
        skeleton.tips_m[keep],
    )
    turns = np.zeros((len(keep), 4))
    turns[:, 0] = 1.0
    with pytest.raises(MotionError, match="the skeleton lacks"):
        turned_by(bare, units_named(("right_arm",)), turns, np.ones(8))


@given(original=st.floats(0, 1), change=st.floats(-1, 3))
def test_wanted_features_stay_shares(original, change):
    target = (FeatureTarget("coverage", ("face",), change),)
    wanted = wanted_features(target, np.array([original]))
    assert 0 <= wanted[0] <= 1


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31 - 1), size=st.floats(0.01, 1.2))
def test_held_turns_are_those_of_the_joint_limits(seed, size):
    rng = np.random.default_rng(seed)
    skeleton, units = box_person().skeleton, units_named(("all",))
    _, turns = arm_raised()
    omega = size * rng.standard_normal((3, 22))
    free = turned_by(skeleton, units, turns, omega)
    held = turned_by(skeleton, units, turns, omega, is_limited=True)
    moved = (free != turns).any(axis=-1)
    # Turns of opposite sign are the same turn.
    expected = clamp_turns(free)
    same = np.abs(np.sum(expected * held, axis=-1))
    np.testing.assert_allclose(1.0, same[moved], atol=1e-9)
    np.testing.assert_array_equal(np.broadcast_to(turns, held.shape)[~moved], held[~moved])
    assert beyond_deg(held)[moved].max() < 1e-6
