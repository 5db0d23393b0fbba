"""Nobody turns a joint farther than a person can."""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.build import Build, build_of_skeleton
from visavis.stimuli.motion.joint_limits import (
    LOWER_DEG,
    UPPER_DEG,
    beyond_deg,
    clamp_turns,
    joint_angles_deg,
    turns_of_angles,
)
from visavis.stimuli.motion.kinds import (
    Crouch,
    Idle,
    Kind,
    Phone,
    Run,
    Sit,
    Talk,
    Text,
    Walk,
    WatchBoard,
    Wave,
)
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.motion.skeleton import canonical_skeleton

NAMES = canonical_skeleton().names
SHARE = st.floats(0.0, 1.0)


@lru_cache
def build(stature_m: float) -> Build:
    return build_of_skeleton(canonical_skeleton(stature_m))


KINDS: st.SearchStrategy[Kind] = st.one_of(
    st.builds(Idle, st.sampled_from(["hanging", "clasped", "folded", "behind"])),
    st.builds(Sit, st.floats(0.38, 0.55), st.sampled_from(["thighs", "lap", "folded"])),
    st.builds(
        Wave,
        st.sampled_from(["left", "right", "both"]),
        st.floats(1.0, 2.5),
        st.floats(10.0, 70.0),
        SHARE,
    ),
    st.builds(Phone, st.sampled_from(["left", "right"])),
    st.builds(Text, st.sampled_from(["left", "right"])),
    st.builds(WatchBoard, st.floats(-60.0, 60.0), st.floats(-20.0, 35.0)),
    st.builds(Talk, st.floats(0.0, 1.4)),
    st.builds(Crouch, SHARE),
    st.builds(Walk, st.floats(0.6, 2.0)),
    st.builds(Run, st.floats(2.0, 4.0)),
)


def worst(turns: Vector) -> str:
    out = beyond_deg(turns).max(axis=-1)
    row = int(np.argmax(out))
    angles = np.round(joint_angles_deg(turns)[row], 1)
    return f"{NAMES[row]} is {out[row]:.1f}° too far: {angles}"


@settings(deadline=None, max_examples=400)
@given(KINDS, st.integers(0, 100_000), st.floats(1.4, 2.1), st.floats(0.0, 300.0))
def test_no_motion_turns_a_joint_too_far(
    kind: Kind, seed: int, stature_m: float, t_s: float
) -> None:
    motion = PeopleMotion((Person(build(round(stature_m, 1)), kind, seed),))
    turns = motion.at(t_s).orientation_wxyz[0]
    assert beyond_deg(turns).max() < 1e-6, worst(turns)


@given(st.integers(0, 10_000))
def test_angles_and_turns_are_each_others_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(np.maximum(LOWER_DEG, -80.0), np.minimum(UPPER_DEG, 80.0))
    assert joint_angles_deg(turns_of_angles(angles)) == pytest.approx(angles, abs=1e-9)


def test_left_and_right_are_read_alike() -> None:
    skeleton = canonical_skeleton()
    elbow = np.zeros((55, 3))
    for side in ("left", "right"):
        elbow[skeleton.index(f"{side}_lower_arm")] = (0.0, -70.0, 0.0)
    left, right = (
        turns_of_angles(elbow)[skeleton.index(f"{side}_lower_arm")] for side in ("left", "right")
    )
    assert left[2] == pytest.approx(-np.sin(np.radians(35.0)))
    assert right[2] == pytest.approx(np.sin(np.radians(35.0)))


def test_what_is_too_far_is_held_at_the_end_of_its_range() -> None:
    skeleton = canonical_skeleton()
    angles = np.zeros((55, 3))
    knee = skeleton.index("right_lower_leg")
    angles[knee] = (-170.0, 0.0, 0.0)
    held = clamp_turns(turns_of_angles(angles))
    assert joint_angles_deg(held)[knee] == pytest.approx([-152.0, 0.0, 0.0], abs=1e-9)
    assert beyond_deg(held).max() < 1e-9


def test_what_is_possible_stays_exactly_as_it_is() -> None:
    turns = PeopleMotion((Person(build(1.7), Idle(), 4),)).at(2.0).orientation_wxyz
    assert np.array_equal(clamp_turns(turns), turns)
