"""Gaze shared by eyes, lids, head and trunk: exact on the target, eyes first, 30° at most."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.geometry import (
    Vector,
    angle_deg,
    direction_from_yaw_pitch_deg,
    rotate,
    unit,
)
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.gaze.gaze_plan import GazePlan, LookAt
from visavis.stimuli.gaze.gaze_shift_kernels import MAX_TURN_S, shares_rad, turn_to
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.build import Build, build_of_skeleton
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import Idle, Kind, Sit
from visavis.stimuli.motion.people import HeldHeads, PeopleMotion, Person
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward
from visavis.stimuli.picture import PosedPeople

AHEAD = np.array([0.0, 0.0, -1.0])
EYES = ("left_eye", "right_eye")


@lru_cache
def build(stature_m: float = 1.75) -> Build:
    return build_of_skeleton(canonical_skeleton(stature_m))


def one(kind: Kind | None = None, seed: int = 1, stature_m: float = 1.75) -> PeopleMotion:
    return PeopleMotion((Person(build(stature_m), kind or Idle(), seed),))


def axes(motion: PeopleMotion, pose: PosedPeople, i: int = 0) -> tuple[Vector, Vector, Vector]:
    """Places (2, 3) and axes (2, 3) of the eyes in world, and their axes in the head (2, 3)."""
    skeleton = motion.people[i].build.skeleton
    body = forward(skeleton, pose.root_m[i], pose.orientation_wxyz[i])
    rows = [skeleton.index(name) for name in EYES]
    world = rotate(body.orientation_wxyz[rows], np.tile(AHEAD, (2, 1)))
    inside = rotate(pose.orientation_wxyz[i, rows], np.tile(AHEAD, (2, 1)))
    return body.position_m[rows], world, inside


def error_deg(motion: PeopleMotion, pose: PosedPeople, target: Vector, i: int = 0) -> float:
    """The larger angle between an eye's axis and the way from that eye to the target."""
    at, world, _ = axes(motion, pose, i)
    return float(angle_deg(world, unit(target - at)).max())


def head_yaw_deg(pose: PosedPeople, motion: PeopleMotion, i: int = 0) -> float:
    skeleton = motion.people[i].build.skeleton
    body = forward(skeleton, pose.root_m[i], pose.orientation_wxyz[i])
    front = rotate(body.orientation_wxyz[skeleton.index("head")], AHEAD)
    return float(np.degrees(np.arctan2(-front[0], -front[2])))


def looking_at(yaw_deg: float, pitch_deg: float = 0.0, far_m: float = 3.0) -> Vector:
    return np.array([0.0, 1.6, 0.0]) + far_m * direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)


def shift_to(target: Vector, at_s: float = 1.0) -> GazePlan:
    where = tuple(float(x) for x in target)
    return GazePlan.of(1, {0: [LookAt(0.0, "aside", (0.0, 0.0)), LookAt(at_s, "point", where)]})


@settings(deadline=None, max_examples=150)
@given(
    st.floats(-115.0, 115.0),
    st.floats(-35.0, 30.0),
    st.floats(0.6, 20.0),
    st.integers(0, 10_000),
    st.floats(1.4, 2.1),
    st.booleans(),
)
def test_both_eyes_meet_the_target_within_a_tenth_of_a_degree(
    yaw: float, pitch: float, far_m: float, seed: int, stature_m: float, sits: bool
) -> None:
    motion = one(Sit() if sits else Idle(), seed, round(stature_m, 2))
    eyes = axes(motion, motion.at(4.0))[0].mean(axis=0)
    target = eyes + far_m * direction_from_yaw_pitch_deg(yaw, pitch)
    pose = motion.at(4.0, shift_to(target))
    assert error_deg(motion, pose, target) < 0.1
    assert angle_deg(axes(motion, pose)[2], AHEAD).max() <= 30.0


@settings(deadline=None, max_examples=60)
@given(st.floats(-180, 180), st.floats(-80, 80), st.floats(0.0, 3.0), st.integers(0, 1000))
def test_eyes_never_turn_more_than_thirty_degrees_in_the_head(
    yaw: float, pitch: float, t_s: float, seed: int
) -> None:
    motion = one(seed=seed)
    pose = motion.at(t_s, shift_to(looking_at(yaw, pitch)))
    assert angle_deg(axes(motion, pose)[2], AHEAD).max() <= 30.0 + 1e-6


def test_eyes_stay_on_the_target_while_the_head_catches_up() -> None:
    motion, target = one(), looking_at(24.0)
    plan = shift_to(target)
    # A saccade of 24° lasts 21 + 2.2 × 24 ms; the head is under way for far longer.
    times = np.arange(1.0 + 0.078, 2.0, 0.01)
    poses = [motion.at(t, plan) for t in times]
    assert max(error_deg(motion, pose, target) for pose in poses) < 0.1
    head = np.array([head_yaw_deg(pose, motion) for pose in poses])
    assert np.ptp(head) > 5.0


def test_eyes_go_first_and_the_head_follows_with_its_own_peak_velocity() -> None:
    motion, plan = one(), shift_to(looking_at(40.0))
    times = np.arange(1.0, 2.2, 0.002)
    poses = [motion.at(t, plan) for t in times]
    gaze = np.array([axes(motion, pose)[1].mean(axis=0) for pose in poses])
    gaze_yaw = np.degrees(np.arctan2(-gaze[:, 0], -gaze[:, 2]))
    head = np.array([head_yaw_deg(pose, motion) for pose in poses])
    eye_starts = times[np.argmax(gaze_yaw - gaze_yaw[0] > 1.0)]
    head_starts = times[np.argmax(head - head[0] > 1.0)]
    assert 0.02 < head_starts - eye_starts < 0.2
    assert 300.0 < np.max(np.diff(gaze_yaw)) / 0.002 < 700.0
    assert 40.0 < np.max(np.diff(head)) / 0.002 < 250.0


@pytest.mark.parametrize("amplitude", [4.0, 10.0, 18.0])
def test_a_saccade_follows_the_main_sequence(amplitude: float) -> None:
    motion, plan = one(Idle(lively=0.0)), shift_to(looking_at(amplitude, far_m=400.0))
    duration_s = 1e-3 * (21.0 + 2.2 * amplitude)
    times = 1.0 + np.linspace(0.0, duration_s, 400)
    gaze = np.array([axes(motion, motion.at(t, plan))[1].mean(axis=0) for t in times])
    speed = angle_deg(gaze[1:], gaze[:-1]) / np.diff(times)
    passed = float(angle_deg(gaze[0], gaze[-1]))
    assert passed == pytest.approx(amplitude, abs=0.4)
    assert speed.max() == pytest.approx(1.875 * passed / duration_s, rel=0.02)
    assert angle_deg(gaze[200], gaze[0]) == pytest.approx(passed / 2, rel=0.03)


def test_the_trunk_joins_for_far_targets_only() -> None:
    motion = one(Idle(lively=0.0))
    chest = build().skeleton.index("chest")
    ahead, near, far = (
        motion.at(4.0, shift_to(looking_at(yaw))).orientation_wxyz[0, chest]
        for yaw in (0.0, 20.0, 95.0)
    )
    turned = [2 * np.degrees(np.linalg.norm(q - ahead)) for q in (near, far)]
    assert turned[0] < 0.6
    assert turned[1] > 2.0


def test_a_moving_person_is_followed_exactly() -> None:
    people = (Person(build(), Idle(), 1), Person(build(1.6), Idle(), 2, (0.6, 0.0, -2.0), 160.0))
    motion = PeopleMotion(people)
    plan = GazePlan.of(2, {0: [LookAt(0.0, "person", (1,))], 1: [LookAt(0.0, "person", (0,))]})
    for t in (1.0, 3.7, 12.2):
        pose = motion.at(t, plan)
        for i in (0, 1):
            other = axes(motion, pose, 1 - i)[0].mean(axis=0)
            assert error_deg(motion, pose, other, i) < 0.1


def test_the_observer_is_looked_in_the_eyes_wherever_they_are() -> None:
    motion, plan = one(), GazePlan.of(1, {0: [LookAt(0.0, "observer")]})
    for x in (-1.0, 0.0, 1.4):
        eyes = np.array([x, 1.7, -1.5])
        assert error_deg(motion, motion.at(5.0, plan.watched_from(eyes)), eyes) < 0.1


def test_an_unknown_observer_is_refused() -> None:
    plan = GazePlan.of(1, {0: [LookAt(0.0, "observer")]})
    with pytest.raises(MotionError, match="watched_from"):
        one().at(1.0, plan)


def test_looks_are_checked() -> None:
    with pytest.raises(MotionError, match="needs 3 finite numbers"):
        GazePlan.of(1, {0: [LookAt(0.0, "point", (1.0, 2.0))]})
    with pytest.raises(MotionError, match="who is not"):
        GazePlan.of(1, {0: [LookAt(0.0, "person", (1.0,))]})
    with pytest.raises(MotionError, match="out of order"):
        GazePlan.of(1, {0: [LookAt(2.0, "observer"), LookAt(1.0, "observer")]})


def test_a_dense_schedule_moves_head_and_eyes_without_a_jump() -> None:
    rng = np.random.default_rng(4)
    looks = [
        LookAt(0.35 * k, "aside", (float(y), float(q)))
        for k, (y, q) in enumerate(rng.uniform((-70, -20), (70, 15), (40, 2)))
    ]
    motion, plan = one(), GazePlan.of(1, {0: looks})
    step = 1 / 500
    head = np.array([head_yaw_deg(motion.at(t, plan), motion) for t in np.arange(2.0, 8.0, step)])
    assert np.abs(np.diff(head)).max() / step < 500.0
    assert np.abs(np.diff(head, 2)).max() / step**2 < 12_000.0


@pytest.mark.parametrize("seed", range(20))
def test_neither_trunk_nor_head_turns_for_a_target_straight_ahead(seed: int) -> None:
    assert (0.0, 0.0, 0.0) == shares_rad(0.0, 0.0, seed)


@settings(deadline=None, max_examples=300)
@given(
    st.sampled_from([0.0, np.pi]) | st.floats(-np.pi, np.pi),
    st.sampled_from([0.0]) | st.floats(-1.2, 1.2),
    st.floats(-1e-3, 1e-3),
    st.floats(-1e-3, 1e-3),
    st.integers(0, 10_000),
)
def test_a_small_step_of_the_target_is_a_small_step_of_trunk_and_head(
    yaw: float, pitch: float, aside: float, up: float, seed: int
) -> None:
    """Across straight ahead and straight behind, too, where left turns into right."""
    turns = np.array(shares_rad(yaw, pitch, seed))
    beside = (yaw + aside + np.pi) % (2.0 * np.pi) - np.pi
    step = np.array(shares_rad(beside, pitch + up, seed)) - turns
    assert 6.0 * float(np.hypot(aside, up)) + 1e-12 >= float(np.abs(step).max())


def test_nothing_is_left_of_a_look_after_the_longest_turn_to_the_next() -> None:
    rng = np.random.default_rng(1)
    rest = (1.0, 0.0, 0.0, 0.0)
    for person in range(2000):
        looks = np.column_stack([[-9.0, 0.0], unit(rng.normal(size=(2, 3))), np.full(2, np.inf)])
        just_before_s = np.nextafter(MAX_TURN_S, 0.0)

        alone = turn_to(just_before_s, looks[1:], rest, person)

        assert alone == pytest.approx(turn_to(just_before_s, looks, rest, person), abs=1e-15)


def test_somebody_passing_behind_does_not_make_the_head_jump() -> None:
    motion = one(Idle(lively=0.0))
    yaw = [
        head_yaw_deg(motion.at(4.0, shift_to(looking_at(angle))), motion)
        for angle in np.arange(100.0, 260.0, 0.5)
    ]
    assert np.abs(np.diff(yaw)).max() < 3.5


def test_a_study_gets_exactly_the_gaze_it_recorded() -> None:
    facing = np.array([[0.3, 0.0, np.sqrt(1 - 0.09)]])
    held = HeldHeads(np.array([[0.1, 1.2, -1.5]]), facing)
    motion = PeopleMotion((Person(build(), Sit(), 3, heading_deg=197.0),), held)
    turn = np.radians(20.0)
    gaze = np.array([[facing[0, 0] * np.cos(turn) + facing[0, 2] * np.sin(turn), 0.0,
                      facing[0, 2] * np.cos(turn) - facing[0, 0] * np.sin(turn)]])  # fmt: skip
    for openness in (1.0, 0.25):
        pose = motion.at(2.0, Aimed(gaze, np.array([openness])))
        at, world, _ = axes(motion, pose)
        assert angle_deg(world, gaze[0]).max() < 1e-6
        # A held head sways by millimetres.
        assert at.mean(axis=0) == pytest.approx(held.eyes_m[0], abs=5e-3)
        for name in ("left_blink", "right_blink"):
            assert pose.morphs_01[0, MORPHS.index(name)] == pytest.approx(1.0 - openness)


def test_lids_follow_the_eyes_up_and_down() -> None:
    motion = one(Idle(lively=0.0), seed=5)
    up, down = (MORPHS.index(name) for name in ("lids_up", "lids_down"))
    for pitch, lid, other in ((15.0, up, down), (-15.0, down, up)):
        pose = motion.at(4.0, shift_to(looking_at(0.0, pitch)))
        inside = axes(motion, pose)[2].mean(axis=0)
        expected = abs(np.degrees(np.arcsin(inside[1]))) / 30.0
        assert pose.morphs_01[0, lid] == pytest.approx(expected, abs=0.01)
        assert expected > 0.1
        assert pose.morphs_01[0, other] == 0.0


def test_people_blink_some_sixteen_times_a_minute() -> None:
    motion = PeopleMotion(tuple(Person(build(), Idle(), seed) for seed in range(20)))
    plan = GazePlan.of(20, {i: [LookAt(0.0, "aside", (0.0, 0.0))] for i in range(20)})
    blink = MORPHS.index("left_blink")
    shut = np.array([motion.at(t, plan).morphs_01[:, blink] for t in np.arange(0, 60, 0.03)])
    blinks = np.sum((shut[1:] > 0.5) & (shut[:-1] <= 0.5), axis=0)
    assert 14.0 < blinks.mean() < 18.0
    assert shut.max() > 0.95


def test_gaze_of_everybody_equals_gaze_of_one() -> None:
    people = tuple(Person(build(), Idle(), seed) for seed in range(5))
    whole = PeopleMotion(people).at(6.4)
    for i, person in enumerate(people):
        alone = PeopleMotion((person,)).at(6.4)
        assert np.array_equal(whole.orientation_wxyz[i], alone.orientation_wxyz[0])
        assert np.array_equal(whole.morphs_01[i], alone.morphs_01[0])
