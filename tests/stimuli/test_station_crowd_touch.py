"""Contact of arm capsules with idle people equals brute force over every pair of capsules."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from visavis.lab.body_joints import BODY_JOINTS
from visavis.stimuli.characters.closing import collision_mesh, volume_m3
from visavis.stimuli.contact.body import (
    ARM_JOINTS,
    CAPSULE_JOINTS,
    REFERENCE_STATURE_M,
    CapsuleBody,
    capsule_body,
)
from visavis.stimuli.contact.figures import crowd_figures, over_capsules
from visavis.stimuli.contact.idle import crowd_poses, people_of
from visavis.stimuli.contact.touch import (
    ASIDE_M,
    BACK_M,
    ELBOW_ASIDE_M,
    ELBOW_BACK_M,
    FRONT_M,
    NEARER_WAITING_M,
    REACH_M,
    TELEPHONING_M_S,
    WAITING_M_S,
    TouchSensor,
    segment_distance,
)
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.station import station_picture
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.scenes.station_crowd import (
    CHARACTERS,
    PHONING,
    Crowd,
    CrowdFrame,
    CrowdScene,
    station_crowd,
)


def figure_of(crowd, person):
    figures, k = crowd_figures(), int(crowd.character[person])
    return CapsuleBody(CAPSULE_JOINTS, figures.start_m[k], figures.end_m[k], figures.radius_m[k])


def brute_force(crowd, starts, ends, radii, t_s):
    people = people_of(crowd)
    position, world = crowd_poses(people, t_s)
    found = {}
    for i in range(len(crowd)):
        body = figure_of(crowd, i)
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


def test_a_sensor_asked_before_finds_what_a_fresh_one_finds():
    crowd = station_crowd(2)
    arms, sensor = capsule_body(1.75, ARM_JOINTS), TouchSensor(crowd)
    person = people_of(crowd)[:1].copy()
    rng = np.random.default_rng(4)
    t_s, found = 0.0, 0
    for step in range(1000):
        # Steps of a frame, now and then a stop, a leap in time, also back.
        t_s += (0.0, 30.0, -12.0)[step // 70 % 3] if step % 70 == 0 else 1 / 90
        person[0, :3] = *(np.sin(step / 150 + np.arange(2)) * 3), rng.uniform(-np.pi, np.pi)
        starts, ends = arms.posed(*(p[0] for p in crowd_poses(person, t_s)))
        fresh = TouchSensor(crowd).touches(starts, ends, arms.radius_m, t_s)
        assert fresh == sensor.touches(starts, ends, arms.radius_m, t_s)
        found += len(fresh)
    assert found > 200


def test_nobody_moves_faster_than_a_pose_is_trusted():
    apart_s = 1 / 90
    for configuration in range(1, 9):
        crowd = station_crowd(configuration)
        people = people_of(crowd)
        phones = people[:, 4] > 0.5
        for t_s in np.linspace(0, 600, 16):
            ends_m = np.empty((2, len(crowd), 38, 3))
            for k in range(2):
                position, world = crowd_poses(people, float(t_s) + k * apart_s)
                for i in range(len(crowd)):
                    body = figure_of(crowd, i)
                    ends_m[k, i] = np.concatenate(body.posed(position[i], world[i]))
            m_s = np.linalg.norm(ends_m[1] - ends_m[0], axis=-1).max(axis=1) / apart_s
            assert m_s[~phones].max() < WAITING_M_S
            assert m_s[phones].max() < TELEPHONING_M_S


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_segment_distance_is_the_least_over_both_segments(seed):
    a, b, c, d = np.random.default_rng(seed).normal(size=(4, 3))

    least = lsq_linear(np.stack([b - a, c - d], axis=1), c - a, (0.0, 1.0), method="bvls")
    best = 2 * least.cost  # half the square is what it reports
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
        crowd = station_crowd(configuration)
        people = people_of(crowd)
        for t_s in np.linspace(0, 60, 13):
            position, world = crowd_poses(people, float(t_s))
            for i, row in enumerate(people):
                body = figure_of(crowd, i)
                ends = np.concatenate(body.posed(position[i], world[i]))
                radius = np.tile(body.radius_m, 2)
                out = np.linalg.norm(ends[:, [0, 2]] - row[:2], axis=1) + radius
                nearer = 0.0 if row[4] > 0.5 else NEARER_WAITING_M
                assert out.max() < REACH_M - nearer
                facing = np.array([[-np.sin(row[2]), -np.cos(row[2])]])
                right = np.array([[np.cos(row[2]), -np.sin(row[2])]])
                off = ends[:, [0, 2]] - row[:2]
                ahead, aside = (off * facing).sum(axis=1), (off * right).sum(axis=1)
                assert (ahead + radius).max() < FRONT_M
                phones = row[4] > 0.5
                assert (radius - ahead).max() < (ELBOW_BACK_M if phones else BACK_M)
                limit = ELBOW_ASIDE_M if phones else ASIDE_M
                assert (np.abs(aside) + radius).max() < limit


def test_an_elbow_far_behind_who_telephones_is_touched():
    """The cull ended 30 cm behind people; this one's elbow reaches 31."""
    one = np.zeros(1, np.int64)
    crowd = Crowd(
        1, np.zeros((1, 2)), np.zeros(1), np.full(1, 1.85), one + PHONING, one + 8, one + 263, one
    )
    position, world = crowd_poses(people_of(crowd), 0.0)
    body = figure_of(crowd, 0)
    starts, ends = body.posed(position[0], world[0])
    axes = np.concatenate([starts, ends])
    back_m = axes[:, 2] + np.tile(body.radius_m, 2)
    elbow = int(back_m.argmax())
    point = np.array([[axes[elbow, 0], axes[elbow, 1], back_m[elbow] - 0.002]])
    radius = np.array([0.001])

    assert brute_force(crowd, point, point, radius, 0.0)
    assert len(TouchSensor(crowd).touches(point, point, radius, 0.0)) == 1


def test_idle_people_move_little_and_stand_on_the_floor():
    people = people_of(station_crowd(3))
    first, _ = crowd_poses(people, 0.0)
    for t_s in (3.0, 7.7, 31.0):
        now, _ = crowd_poses(people, t_s)
        assert np.linalg.norm(now[:, 0] - first[:, 0], axis=1).max() < 0.15
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


def test_who_is_drawn_stands_where_contact_is_computed():
    crowd = station_crowd(4)
    picture = station_picture(
        CrowdFrame(
            CrowdScene("station", agents=(), crowd=crowd),
            0,
            np.empty((0, 3)),
            np.empty(0),
            crowd_t_ns=4_200_000_000,
        )
    )
    position, _ = crowd_poses(people_of(crowd), 4.2)
    for i, person in enumerate(picture.cast):
        assert crowd.stature_m[i] == person.stature_m
        index = [person.skeleton.index(name) for name in BODY_JOINTS]
        drawn = forward(
            person.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i]
        )
        np.testing.assert_allclose(position[i], drawn.position_m[index], atol=1e-6)


@pytest.mark.parametrize("part", range(len(CHARACTERS)))
def test_capsules_of_a_figure_follow_its_surface_and_hold_its_volume(part):
    person, figures = default_casting(CHARACTERS[part]), crowd_figures()
    mesh = collision_mesh(person)
    at = np.array([person.skeleton.rest_m[person.skeleton.index(n)] for n in CAPSULE_JOINTS])
    shape = figures.start_m[part] + at, figures.end_m[part] + at, figures.radius_m[part]
    over = over_capsules(mesh.vertices_m.astype(float), *shape).min(axis=1)
    assert np.abs(over).mean() < 0.015
    low, high = mesh.vertices_m.min(axis=0) - 0.05, mesh.vertices_m.max(axis=0) + 0.05
    points = np.random.default_rng(part).uniform(low, high, (40_000, 3))
    inside = np.mean(over_capsules(points, *shape).min(axis=1) < 0) * np.prod(high - low)
    assert volume_m3(mesh.vertices_m, mesh.triangles) == pytest.approx(inside, rel=0.10)


def test_a_body_has_nineteen_capsules_and_hangs_on_known_joints():
    body = capsule_body(REFERENCE_STATURE_M)
    assert len(body.joint) == 19 == len(set(CAPSULE_JOINTS))
    assert set(ARM_JOINTS) < set(CAPSULE_JOINTS) < set(BODY_JOINTS)
    mirrored = [n.replace("left", "right") for n in body.joint if n.startswith("left")]
    assert set(mirrored) <= set(body.joint)
