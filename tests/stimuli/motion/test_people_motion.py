"""People as functions of time: repeatable, independent of each other, planted on the floor."""

from functools import lru_cache
from typing import Literal, get_args

import numpy as np
import pytest

from tests.stimuli.motion.holding import held_in_hand
from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.build import Build, build_of_skeleton
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import (
    Crouch,
    Hand,
    Idle,
    Kind,
    Phone,
    Recorded,
    Run,
    Sit,
    Talk,
    Text,
    Walk,
    WatchBoard,
    Wave,
)
from visavis.stimuli.motion.people import Alone, Doing, HeldHeads, PeopleMotion, Person
from visavis.stimuli.motion.seating import eyes_of, seated_under_eyes
from visavis.stimuli.motion.skeleton import Placement, Skeleton, canonical_skeleton, forward

KINDS: tuple[Kind, ...] = (
    Idle("hanging"),
    Idle("clasped"),
    Idle("folded"),
    Idle("behind"),
    Sit(hands="thighs"),
    Sit(hands="lap"),
    Sit(hands="folded"),
)


@lru_cache
def build(stature_m: float = 1.75) -> Build:
    return build_of_skeleton(canonical_skeleton(stature_m))


def recorded_bow(skeleton: Skeleton) -> Clip:
    """A clip of a second: bowing and rising, written down every thirtieth."""
    turns = np.zeros((31, 55, 4))
    turns[..., 0] = 1.0
    half = np.radians(20.0) * np.sin(np.linspace(0.0, np.pi, 31)) ** 2
    turns[:, skeleton.index("spine"), 0] = np.cos(half)
    turns[:, skeleton.index("spine"), 1] = -np.sin(half)
    root = np.tile([0.0, 0.53 * 1.75, 0.0], (31, 1))
    return Clip(skeleton, 1 / 30, root, turns)


def crowd() -> PeopleMotion:
    return PeopleMotion(
        tuple(
            Person(build(1.5 + 0.05 * i), kind, 40 + i, (0.7 * i, 0.0, -2.0), 35.0 * i)
            for i, kind in enumerate(KINDS)
        )
    )


def placed(motion: PeopleMotion, i: int, t_s: float) -> Placement:
    pose = motion.at(t_s)
    return forward(motion.people[i].build.skeleton, pose.root_m[i], pose.orientation_wxyz[i])


def joints(motion: PeopleMotion, i: int, times_s: Vector, *names: str) -> Vector:
    """Places (times, names, 3) of joints in world."""
    rows = [motion.people[i].build.skeleton.index(name) for name in names]
    return np.stack([placed(motion, i, float(t)).position_m[rows] for t in times_s])


def test_a_frame_asked_for_again_is_the_same() -> None:
    motion = crowd()
    first = motion.at(7.3)
    motion.at(100.0)
    again = crowd().at(7.3)
    assert np.array_equal(first.root_m, again.root_m)
    assert np.array_equal(first.orientation_wxyz, again.orientation_wxyz)


def test_everybody_at_once_equals_one_at_a_time() -> None:
    motion = crowd()
    pose = motion.at(3.21)
    for i, person in enumerate(motion.people):
        alone = PeopleMotion((person,)).at(3.21)
        assert np.array_equal(pose.root_m[i], alone.root_m[0])
        assert np.array_equal(pose.orientation_wxyz[i], alone.orientation_wxyz[0])


@pytest.mark.parametrize("kind", [*KINDS, Wave()], ids=repr)
def test_one_thing_at_many_times_at_once_equals_one_time_after_the_other(kind: Kind) -> None:
    alone = PeopleMotion((Person(build(), kind, 7, (0.3, 0.0, -2.0), 20.0),))
    times_s = np.linspace(-0.5, 3.0, 16).reshape(4, 4)
    at_rest = Aimed(np.full((1, 3), np.nan), np.ones(1))
    expected = [alone.at(float(t_s), at_rest) for t_s in times_s.ravel()]
    frames = Alone(alone).at(times_s)
    assert (4, 4, 3) == frames.root_m.shape
    root_m = np.concatenate([one.root_m for one in expected])
    assert np.array_equal(root_m, frames.root_m.reshape(-1, 3))
    turns = np.concatenate([one.orientation_wxyz for one in expected])
    assert np.array_equal(turns, frames.orientation_wxyz.reshape(turns.shape))


def test_everybody_may_be_asked_for_at_a_time_of_their_own() -> None:
    motion = crowd()
    times_s = np.linspace(0.0, 5.0, len(motion.people))
    expected = [motion.posture(float(t_s))[i] for i, t_s in enumerate(times_s)]
    assert np.array_equal(np.stack(expected), motion.posture(times_s))


def test_another_seed_is_another_person() -> None:
    poses = PeopleMotion(tuple(Person(build(), Idle(), seed) for seed in (1, 2))).at(4.0)
    assert not np.allclose(poses.orientation_wxyz[0], poses.orientation_wxyz[1], atol=1e-3)


def test_turns_are_unit_quaternions() -> None:
    lengths = np.linalg.norm(crowd().at(2.0).orientation_wxyz, axis=-1)
    assert lengths == pytest.approx(1.0, abs=1e-12)


def test_feet_of_those_who_stay_do_not_move() -> None:
    motion, times = crowd(), np.arange(0.0, 60.0, 1.7)
    for i in range(len(KINDS)):
        ankles = joints(motion, i, times, "left_foot", "right_foot")
        assert np.ptp(ankles, axis=0).max() < 1e-3
        lowest = ankles[..., 1].min() - motion.people[i].build.ankle_m
        # Short sitters have their heels up.
        assert -1e-3 < lowest < (0.1 if isinstance(KINDS[i], Sit) else 2e-3)


def test_place_and_heading_carry_the_whole_person() -> None:
    here = PeopleMotion((Person(build(), Idle(), 5),)).at(9.0)
    there = PeopleMotion((Person(build(), Idle(), 5, (2.0, 0.4, -3.0), 90.0),)).at(9.0)
    x, y, z = here.root_m[0]
    # Facing −x, what was to the right is now towards −z.
    assert there.root_m[0] == pytest.approx([2.0 + z, 0.4 + y, -3.0 - x], abs=1e-9)
    assert there.orientation_wxyz[0, 1:] == pytest.approx(here.orientation_wxyz[0, 1:], abs=1e-9)


def test_quiet_standing_sways_and_breathes_like_a_person() -> None:
    motion = PeopleMotion((Person(build(), Idle("hanging"), 8),))
    times = np.arange(0.0, 8.0, 0.1)
    shoulder = joints(motion, 0, times, "left_upper_arm", "hips")
    breath = shoulder[:, 0, 1] - shoulder[:, 1, 1]
    assert 0.001 < np.ptp(breath) < 0.015
    assert 0.001 < np.ptp(shoulder[:, 1, 0]) < 0.12


def test_a_still_person_only_breathes() -> None:
    motion = PeopleMotion((Person(build(), Idle("hanging", lively=0.0), 8),))
    hips = joints(motion, 0, np.arange(0.0, 30.0, 1.3), "hips")
    assert np.ptp(hips, axis=0).max() == 0.0


def test_held_heads_stay_where_the_study_put_them() -> None:
    eyes = np.array([[0.2, 1.12, -1.4], [np.nan] * 3])
    facing = np.array([[np.sin(0.3), 0.0, -np.cos(0.3)], [np.nan] * 3])
    people = (Person(build(), Sit(), 3, heading_deg=-17.0), Person(build(), Sit(), 4))
    motion = PeopleMotion(people, HeldHeads(eyes, facing))
    for t in (0.0, 5.5, 31.0):
        pose = motion.at(t)
        body = forward(people[0].build.skeleton, pose.root_m[0], pose.orientation_wxyz[0])
        index = people[0].build.skeleton.index
        middle = body.position_m[[index("left_eye"), index("right_eye")]].mean(axis=0)
        assert middle == pytest.approx(eyes[0], abs=0.010)
        w, x, y, z = body.orientation_wxyz[index("head")]
        front = -np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        assert front == pytest.approx(facing[0], abs=np.radians(1.0))


def test_changing_from_one_thing_to_the_next_does_not_pop() -> None:
    plan = (Doing(Idle("hanging")), Doing(Idle("folded"), 2.0), Doing(Idle("clasped"), 4.0, 1.0))
    motion = PeopleMotion((Person(build(), plan, 9),))
    step_s = 1 / 240
    path = joints(motion, 0, np.arange(1.8, 5.2, step_s), "left_hand", "right_hand", "hips")
    acceleration = np.diff(path, 2, axis=0) / step_s**2
    assert np.linalg.norm(acceleration, axis=-1).max() < 40.0
    after = PeopleMotion((Person(build(), Idle("folded"), 9),))
    assert motion.posture(3.5)[0, 0:12] == pytest.approx(after.posture(1.5)[0, 0:12], abs=1e-12)


EVERY_KIND: tuple[Kind, ...] = (
    *KINDS,
    *(Wave(hand=hand) for hand in get_args(Hand)),
    Wave(seat_m=0.45),
    Phone(),
    Phone("left", talk_01=1.0),
    Text(),
    WatchBoard(),
    Talk(),
    Crouch(),
    Walk(),
    Walk(distance_m=4.0),
    Run(),
    Run(distance_m=9.0),
    Recorded(recorded_bow(build().skeleton)),
)
FRAMES_HZ = 90.0
POSE = ("root_m", "orientation_wxyz")


def steps_m(motion: PeopleMotion, times_s: Vector) -> Vector:
    """Return how far each person's farthest joint moves from time to time (times - 1, n)."""
    skeleton = build().skeleton
    poses = [motion.at(float(t)) for t in times_s]
    roots, turns = (np.array([getattr(pose, name) for pose in poses]) for name in POSE)
    path = forward(skeleton, roots, turns).position_m
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=-1).max(axis=-1), np.float64)


def test_every_kind_is_among_those_that_are_looked_at_for_jumps() -> None:
    assert set(get_args(Kind)) == {type(kind) for kind in EVERY_KIND}


def test_nothing_that_people_do_jumps() -> None:
    motion = PeopleMotion(tuple(Person(build(), kind, 3) for kind in EVERY_KIND))
    slow, fast = (
        steps_m(motion, np.arange(0.7, 3.4, 1 / rate_hz)).max(axis=0)
        for rate_hz in (FRAMES_HZ, 4 * FRAMES_HZ)
    )
    # Looked at four times as often, movements are a quarter as large; jumps stay.
    assert (fast < 0.3 * slow + 1e-3).all(), [EVERY_KIND[i] for i in (fast - 0.3 * slow).argsort()]


@pytest.mark.parametrize("seed", [3, 4])
def test_hands_do_not_turn_over_where_one_thing_leads_to_the_next(seed: int) -> None:
    staying = [kind for kind in EVERY_KIND if not isinstance(kind, Walk | Run | Recorded)]
    changes = [(one, other) for one in staying for other in staying if one != other]
    people = [Person(build(), (Doing(a), Doing(b, 2.0)), seed) for a, b in changes]
    steps = steps_m(PeopleMotion(tuple(people)), np.arange(1.9, 2.9, 1 / FRAMES_HZ)).max(axis=0)
    assert steps.max() < 0.08, changes[int(steps.argmax())]  # 7 m/s; it was .34 m in one frame


def test_a_change_before_the_last_one_has_ended_is_refused() -> None:
    plan = (Doing(Idle()), Doing(Sit(), 2.0, 1.0), Doing(Idle(), 2.5))
    with pytest.raises(MotionError, match="before a fade ends"):
        PeopleMotion((Person(build(), plan, 1),))


def test_nobody_is_nobody() -> None:
    assert PeopleMotion(()).at(1.0).orientation_wxyz.shape == (0, 55, 4)


def test_somebody_is_seated_under_given_eyes() -> None:
    eyes, facing = np.array([0.4, 1.5, -2.2]), np.array([-0.5, 0.0, np.sqrt(0.75)])
    person = seated_under_eyes(build(1.6), eyes, facing=facing, seed=3, sit=Sit(lively=0.0))
    pair = joints(PeopleMotion((person,)), 0, np.array([0.0]), "left_eye", "right_eye")[0]
    assert pair.mean(axis=0) == pytest.approx(eyes, abs=1e-9)
    # The left eye is to the left of somebody who looks along `facing`.
    assert np.cross(facing, pair[0] - pair[1])[1] > 0.05


def test_a_given_floor_decides_the_height_of_the_seat() -> None:
    eyes, facing = np.array([0.0, 1.3, 0.0]), np.array([0.0, 0.0, -1.0])
    person = seated_under_eyes(build(), eyes, facing=facing, seed=3, floor_m=0.1)
    assert isinstance(person.does, Sit)
    assert person.place_m[1] == 0.1
    assert eyes_of(person.build, person.does, 3)[1] == pytest.approx(1.2, abs=1e-6)
    with pytest.raises(MotionError, match="another size"):
        seated_under_eyes(build(), eyes, facing=facing, seed=3, floor_m=0.9)


def test_a_clip_is_one_of_the_things_people_do() -> None:
    own = build()
    clip = recorded_bow(own.skeleton)
    plan = (Doing(Idle("hanging")), Doing(Recorded(clip), 2.0, 0.3), Doing(Idle("hanging"), 3.0))
    motion = PeopleMotion((Person(own, plan, 6, (1.0, 0.0, 0.5), 90.0),))
    pose = motion.at(2.5)
    spine = own.skeleton.index("spine")
    expected = clip.at(0.5).orientation_wxyz[spine]
    assert pose.orientation_wxyz[0, spine] == pytest.approx(expected, abs=1e-9)
    assert pose.root_m[0] == pytest.approx([1.0, 0.53 * 1.75, 0.5], abs=1e-9)
    step_s = 1 / 240
    path = joints(motion, 0, np.arange(1.5, 4.5, step_s), "left_hand", "right_hand", "neck")
    assert np.linalg.norm(np.diff(path, 2, axis=0), axis=-1).max() / step_s**2 < 120.0


def test_a_clip_of_other_joints_is_refused() -> None:
    own = build().skeleton
    other = Skeleton(own.names[:9], own.parents[:9], own.offsets_m[:9], own.tips_m[:9])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (2, 9, 1))
    with pytest.raises(MotionError, match="retarget"):
        Recorded(Clip(other, 0.1, np.zeros((2, 3)), turns))


@pytest.mark.parametrize("hand", ["left", "right"])
@pytest.mark.parametrize("stature_m", [1.45, 1.75, 2.0])
def test_a_phone_is_at_the_ear_of_the_side_it_is_held(
    hand: Literal["left", "right"], stature_m: float
) -> None:
    own = build(stature_m)
    for seed in range(5):
        motion = PeopleMotion((Person(own, Phone(hand), seed),))
        for t in (0.0, 4.3):
            phone = held_in_hand(own, motion.at(t), 0, hand)
            head = placed(motion, 0, t)
            row = own.skeleton.index("head")
            ear_side = -0.08 if hand == "left" else 0.08
            ear = head.position_m[row] + rotate(
                head.orientation_wxyz[row],
                np.array([ear_side, 0.053, 0.0]) * [1.0, stature_m, 1.0],
            )
            # Half the length of a phone and of an ear.
            assert np.linalg.norm(phone.position_m - ear) < 0.135


def test_a_wave_goes_to_and_fro_at_the_rate_asked_for() -> None:
    motion = PeopleMotion((Person(build(), Wave("right", rate_hz=2.0), 4),))
    path = joints(motion, 0, np.arange(0.0, 10.0, 0.02), "right_hand", "right_lower_arm")
    sideways = path[:, 0, 0] - path[:, 1, 0]
    crossings = np.sum(np.diff(np.sign(sideways - np.median(sideways))) != 0)
    assert crossings / 2 / 10.0 == pytest.approx(2.0, abs=0.15)
    assert (path[:, 0, 1] > path[:, 1, 1] + 0.15).all()


@pytest.mark.parametrize("seat_m", [0.19, 1.01])
def test_a_seat_that_fits_nobody_is_told_by_the_eyes_that_would_need_it(seat_m: float) -> None:
    eyes = eyes_of(build(), Sit(seat_m=0.5), 3) + np.array([0.0, seat_m - 0.5, 0.0])
    with pytest.raises(MotionError, match=f"would need a seat at {seat_m:.2f} m"):
        seated_under_eyes(build(), eyes, facing=np.array([0.0, 0, -1]), seed=3, floor_m=0.0)
