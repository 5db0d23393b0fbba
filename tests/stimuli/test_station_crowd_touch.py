"""Contact of arm capsules with idle people equals brute force over every pair of capsules."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from stimuli.contact.body import (
    ARM_JOINTS,
    BODY_JOINTS,
    CAPSULE_JOINTS,
    REFERENCE_STATURE_M,
    capsule_body,
)
from stimuli.contact.idle import crowd_poses, crowd_turns, people_of
from stimuli.contact.touch import REACH_M, TouchSensor, segment_distance
from stimuli.motion.skeleton import canonical_skeleton, forward
from stimuli.scenes.station_crowd import PHONING, station_crowd


def brute_force(crowd, starts, ends, radii, t_s):
    people = people_of(crowd)
    position, world = crowd_poses(people, t_s)
    found = {}
    for i in range(len(crowd)):
        body = capsule_body(float(crowd.stature_m[i]))
        theirs, their_ends = body.posed(position[i], world[i])
        for k in range(len(starts)):
            for c in range(len(theirs)):
                apart = np.sqrt(
                    segment_distance(starts[k], ends[k], theirs[c], their_ends[c], np.empty(3))
                )
                depth = radii[k] + body.radius_m[c] - apart
                if depth > 0:
                    found[k, i] = max(found.get((k, i), 0.0), depth)
    return found


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    configuration=st.integers(1, 8),
    t_s=st.floats(0, 100),
)
def test_touches_equal_brute_force_over_every_pair(seed, configuration, t_s):
    rng = np.random.default_rng(seed)
    crowd = station_crowd(configuration)
    person = people_of(crowd)[:1].copy()
    person[0, :3] = *rng.uniform(-4, 4, 2), rng.uniform(-np.pi, np.pi)
    arms = capsule_body(1.75, ARM_JOINTS)
    starts, ends = arms.posed(*(p[0] for p in crowd_poses(person, t_s)))
    touched = TouchSensor(crowd).touches(starts, ends, arms.radius_m, t_s)
    expected = brute_force(crowd, starts, ends, arms.radius_m, t_s)
    assert {(t.part, t.person): pytest.approx(t.depth_m, abs=1e-9) for t in touched} == expected


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_segment_distance_is_the_least_over_both_segments(seed):
    a, b, c, d = np.random.default_rng(seed).normal(size=(4, 3))

    def square(u):
        return float(np.sum((a + u[0] * (b - a) - c - u[1] * (d - c)) ** 2))

    best = min(
        minimize(square, start, bounds=[(0, 1), (0, 1)], tol=1e-14).fun
        for start in ([0.5, 0.5], [0.0, 0.0], [1.0, 1.0])
    )
    assert segment_distance(a, b, c, d, np.empty(3)) == pytest.approx(best, abs=1e-6)


def test_segment_distance_of_points_and_parallels():
    o, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 2.0, 0])
    assert segment_distance(o, o, y, y, np.empty(3)) == 4.0
    assert segment_distance(o, x, y, y + x, np.empty(3)) == 4.0
    assert segment_distance(o, x, 3 * x, 4 * x, np.empty(3)) == 4.0


def test_lost_segments_touch_nothing():
    crowd = station_crowd(1)
    arms = capsule_body(1.75, ARM_JOINTS)
    lost = np.full((6, 3), np.nan)
    assert TouchSensor(crowd).touches(lost, lost, arms.radius_m, 0.0) == ()


def test_nobody_reaches_farther_than_the_cull_assumes():
    for configuration in range(1, 9):
        people = people_of(station_crowd(configuration))
        for t_s in np.linspace(0, 60, 13):
            position, world = crowd_poses(people, float(t_s))
            for i, row in enumerate(people):
                body = capsule_body(float(row[3]))
                ends = np.concatenate(body.posed(position[i], world[i]))
                radius = np.tile(body.radius_m, 2)
                out = np.linalg.norm(ends[:, [0, 2]] - row[:2], axis=1) + radius
                assert out.max() < REACH_M


def test_idle_people_move_little_and_stand_on_the_floor():
    people = people_of(station_crowd(3))
    first, _ = crowd_poses(people, 0.0)
    for t_s in (3.0, 7.7, 31.0):
        now, _ = crowd_poses(people, t_s)
        assert np.linalg.norm(now[:, 0] - first[:, 0], axis=1).max() < 0.05
        toes = now[:, [BODY_JOINTS.index("left_toes"), BODY_JOINTS.index("right_toes")], 1]
        assert toes.min() > -0.03
        assert toes.max() < 0.06


def test_a_telephoning_hand_is_at_the_head():
    crowd = station_crowd(2)
    position, _ = crowd_poses(people_of(crowd), 5.0)
    head = position[:, BODY_JOINTS.index("head")]
    hands = np.stack([position[:, BODY_JOINTS.index(f"{s}_hand")] for s in ("left", "right")])
    nearest = np.linalg.norm(hands - head, axis=2).min(axis=0)
    phoning = crowd.behaviour == PHONING
    assert nearest[phoning].max() < 0.45
    assert nearest[~phoning].min() > 0.45


def test_turns_for_skinning_place_the_same_joints():
    people = people_of(station_crowd(4))[:5]
    roots, turns = crowd_turns(people, 4.2)
    position, _ = crowd_poses(people, 4.2)
    for i, row in enumerate(people):
        skeleton = canonical_skeleton(float(row[3]))
        local = np.tile([1.0, 0, 0, 0], (len(skeleton.names), 1))
        index = [skeleton.index(name) for name in BODY_JOINTS]
        local[index] = turns[i]
        placed = forward(skeleton, roots[i], local).position_m[index]
        np.testing.assert_allclose(position[i], placed, atol=1e-9)


def test_a_body_has_nineteen_capsules_and_hangs_on_known_joints():
    body = capsule_body(REFERENCE_STATURE_M)
    assert len(body.joint) == 19 == len(set(CAPSULE_JOINTS))
    assert set(ARM_JOINTS) < set(CAPSULE_JOINTS) < set(BODY_JOINTS)
    mirrored = [n.replace("left", "right") for n in body.joint if n.startswith("left")]
    assert set(mirrored) <= set(body.joint)
