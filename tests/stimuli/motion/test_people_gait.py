"""Walking and running: footprints do not slip, ways end where they should, gaits look like one."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.motion.build import Build, build_of_skeleton
from visavis.stimuli.motion.kinds import Idle, Run, Walk, gait_duration_s
from visavis.stimuli.motion.people import Doing, PeopleMotion, Person
from visavis.stimuli.motion.posture import B_BALL_Y, B_HEEL, B_LEG
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

STEP_S = 1 / 240
SIDES = ("left", "right")


@lru_cache
def build(stature_m: float = 1.75) -> Build:
    return build_of_skeleton(canonical_skeleton(stature_m))


def contacts(motion: PeopleMotion, times_s: Vector) -> Vector:
    """Points (times, 4, 3) of the soles: below heel and ball of the left and the right foot."""
    own = motion.people[0].build
    skeleton, b = own.skeleton, own.lengths_m
    points = np.empty((len(times_s), 4, 3))
    for row, t in enumerate(times_s):
        pose = motion.at(float(t))
        body = forward(skeleton, pose.root_m[0], pose.orientation_wxyz[0])
        for k, side in enumerate(SIDES):
            foot, toes = skeleton.index(f"{side}_foot"), skeleton.index(f"{side}_toes")
            heel = np.array([0.0, -own.ankle_m, b[B_HEEL]])
            turn = body.orientation_wxyz[foot]
            points[row, 2 * k] = body.position_m[foot] + rotate(turn, heel)
            points[row, 2 * k + 1] = body.position_m[toes] - [0.0, b[B_BALL_Y], 0.0]
    return points


def slip_mm_s(points: Vector) -> Vector:
    """Horizontal speeds of points that rest on the floor in both of two frames."""
    on_floor = np.abs(points[..., 1]) < 5e-4
    pairs = on_floor[1:] & on_floor[:-1]
    moved = np.linalg.norm(np.diff(points[..., [0, 2]], axis=0), axis=-1) / STEP_S * 1e3
    slips: Vector = moved[pairs]
    return slips


@settings(deadline=None, max_examples=25)
@given(st.floats(0.6, 2.0), st.floats(1.4, 2.1), st.integers(0, 1000))
def test_feet_of_a_walker_do_not_slip(speed: float, stature_m: float, seed: int) -> None:
    motion = PeopleMotion((Person(build(round(stature_m, 2)), Walk(speed), seed),))
    slips = slip_mm_s(contacts(motion, np.arange(1.0, 4.0, STEP_S)))
    assert np.median(slips) == pytest.approx(0.0, abs=0.01)
    assert np.percentile(slips, 95) < 5.0
    assert len(slips) > 700


def test_feet_of_a_runner_do_not_slip() -> None:
    motion = PeopleMotion((Person(build(), Run(3.0), 3),))
    slips = slip_mm_s(contacts(motion, np.arange(2.0, 5.0, STEP_S)))
    assert np.median(slips) == pytest.approx(0.0, abs=0.01)
    assert np.percentile(slips, 95) < 5.0


def test_nothing_sinks_into_the_floor() -> None:
    for kind in (Walk(0.7), Walk(1.3), Walk(2.0), Run(3.0)):
        motion = PeopleMotion((Person(build(), kind, 3),))
        points = contacts(motion, np.arange(0.0, 4.0, 0.01))
        assert points[..., 1].min() > -0.004


def test_a_walker_has_one_foot_on_the_floor_and_a_runner_flies() -> None:
    times = np.arange(2.0, 5.0, 0.005)
    for kind, flies in ((Walk(1.3), False), (Run(3.0), True)):
        points = contacts(PeopleMotion((Person(build(), kind, 3),)), times)
        up = points[..., 1].min(axis=1) > 0.004
        assert up.any() == flies


def test_hips_go_at_the_speed_asked_for() -> None:
    even = Walk(1.4, stride_cv=0.0)
    motion = PeopleMotion((Person(build(), even, 3, heading_deg=90.0),))
    passed = motion.at(6.0).root_m[0] - motion.at(3.0).root_m[0]
    assert passed[0] == pytest.approx(-4.2, abs=0.01)
    assert abs(passed[2]) < 0.06


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.7, 8.0])
def test_a_way_ends_where_it_should_with_the_feet_side_by_side(distance: float) -> None:
    walk = Walk(1.2, distance)
    own = build()
    end_s = gait_duration_s(walk, float(own.lengths_m[B_LEG]))
    motion = PeopleMotion((Person(own, walk, 3),))
    last, later = contacts(motion, np.array([end_s, end_s + 9.0]))
    assert last == pytest.approx(later, abs=1e-9)
    ankle_z = [last[2 * k, 2] - own.lengths_m[B_HEEL] * np.cos(0.1) for k in (0, 1)]
    assert ankle_z == pytest.approx([-distance, -distance], abs=0.02)
    assert motion.at(end_s).root_m[0, 2] == pytest.approx(-distance, abs=0.02)
    assert distance / 1.2 < end_s < distance / 1.2 + 2.0


def test_legs_reach_their_footprints() -> None:
    """Knees bend and stretch without a jerk: a leg that could not reach would snap straight."""
    for kind in (Walk(1.3), Walk(1.9), Run(3.4)):
        motion = PeopleMotion((Person(build(), kind, 3),))
        knee = build().skeleton.index("left_lower_leg")
        turns = np.array([motion.at(t).orientation_wxyz[0, knee] for t in np.arange(2, 5, 0.01)])
        bend = np.degrees(2 * np.arccos(np.clip(turns[:, 0], -1, 1)))
        assert bend.min() > 0.3
        assert 45.0 < bend.max() < 130.0


def test_somebody_who_arrives_stays_there_and_stands_at_ease() -> None:
    walk = Walk(1.2, 3.0)
    own = build()
    end_s = gait_duration_s(walk, float(own.lengths_m[B_LEG]))
    plan = (Doing(Idle("hanging")), Doing(walk, 2.0), Doing(Idle("hanging"), 2.0 + end_s, 1.2))
    motion = PeopleMotion((Person(own, plan, 3, heading_deg=-90.0),))
    assert motion.at(1.0).root_m[0, [0, 2]] == pytest.approx([0.0, 0.0], abs=0.08)
    assert motion.at(2.0 + end_s + 5.0).root_m[0, [0, 2]] == pytest.approx([3.0, 0.0], abs=0.08)
    times = np.arange(1.5, 4.0 + end_s, STEP_S)
    hips = np.array([motion.at(t).root_m[0] for t in times])
    speed = np.linalg.norm(np.diff(hips, axis=0), axis=1) / STEP_S
    assert speed.max() < 1.2 * 1.35
    assert np.abs(np.diff(speed)).max() / STEP_S < 12.0


def strides_s(walk: Walk, seed: int, strides: int) -> Vector:
    """Return the time of every stride: from one landing of the left heel to the next."""
    own = build()
    motion = PeopleMotion((Person(own, walk, seed),))
    foot = own.skeleton.index("left_foot")
    times = np.arange(3.0, 3.0 + 1.15 * strides, 0.005)
    place = np.empty(len(times))
    for i, t in enumerate(times):
        pose = motion.at(float(t))
        body = forward(own.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
        place[i] = body.position_m[foot, 2] - pose.root_m[0, 2]
    ahead = (place[1:-1] < place[:-2]) & (place[1:-1] <= place[2:]) & (place[1:-1] < -0.2)
    at = np.flatnonzero(ahead) + 1
    late, now, soon = place[at - 1], place[at], place[at + 1]
    exact: Vector = times[at] + 0.0025 * (late - soon) / (late - 2 * now + soon)
    return np.diff(exact)


def test_strides_vary_as_peoples_do() -> None:
    varied = [strides_s(Walk(1.3), seed, 40) for seed in range(4)]
    cv = [float(s.std() / s.mean()) for s in varied]
    assert 0.02 < np.mean(cv) < 0.03
    assert min(cv) > 0.012
    assert max(cv) < 0.04
    even = strides_s(Walk(1.3, stride_cv=0.0), 1, 10)
    assert even.std() / even.mean() < 0.002
    assert even.mean() == pytest.approx(np.mean([s.mean() for s in varied]), rel=0.01)


@pytest.mark.parametrize("stature_m", [1.55, 1.75, 1.95])
@pytest.mark.parametrize("speed", [0.7, 1.3, 1.8])
def test_toes_clear_the_floor_while_a_foot_swings(stature_m: float, speed: float) -> None:
    own = build(stature_m)
    motion = PeopleMotion((Person(own, Walk(speed), 3),))
    toes = own.skeleton.index("left_toes")
    tip = own.skeleton.tips_m[toes] * [1.0, 0.0, 1.0] - [0.0, own.lengths_m[B_BALL_Y], 0.0]
    places = []
    for t in np.arange(3.0, 6.0, STEP_S):
        pose = motion.at(float(t))
        body = forward(own.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
        places.append(body.position_m[toes] + rotate(body.orientation_wxyz[toes], tip))
    path = np.array(places)
    moves = np.linalg.norm(np.diff(path[:, [0, 2]], axis=0), axis=1) / STEP_S
    assert path[:, 1].min() > -0.003
    assert path[1:, 1][moves > 2.0 * speed].min() > 0.009
