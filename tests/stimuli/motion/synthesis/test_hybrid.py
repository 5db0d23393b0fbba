"""Hybrid motion passes through the poses it was made from, as its definitions say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.stimuli.motion.motions import wandering
from tests.stimuli.motion.rotation_cases import same
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.clip import mirror_clip, placed_joints
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import Walk
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.spring import Spring
from visavis.stimuli.motion.synthesis.hybrid import (
    Sprung,
    authored_poses,
    gait,
    hybrid,
    pose_counts,
    to_and_fro,
)

SEEDS = st.integers(0, 2**31)


@given(SEEDS, st.integers(0, 3))
def test_every_increment_keeps_the_poses_of_the_one_before(seed: int, increment: int) -> None:
    source = wandering(np.random.default_rng(seed), 33, swing_deg=40.0, rate_hz=16.0)
    for name in ("walk", "idle"):
        few = authored_poses(name, source, 0.0, 2.0, increment)
        more = authored_poses(name, source, 0.0, 2.0, increment + 1)
        assert same(few.orientation_wxyz, more.orientation_wxyz[::2], 1e-9)


@given(SEEDS, st.sampled_from(["shoemake", "neighbours"]))
def test_gait_meets_its_poses_and_half_a_round_later_their_mirror_images(
    seed: int, controls: str
) -> None:
    poses = wandering(np.random.default_rng(seed), 2, swing_deg=60.0, rate_hz=4.0)
    walk = gait(poses, 1.0, controls=controls)  # type: ignore[arg-type]  # drawn from the two
    assert same(poses.orientation_wxyz, walk.at([0.0, 0.25]).orientation_wxyz, 1e-9)
    assert same(mirror_clip(poses).orientation_wxyz, walk.at([0.5, 0.75]).orientation_wxyz, 1e-9)
    assert 0 == np.abs(walk.at(np.linspace(0, 1, 9)).root_m[:, 2]).max()


@given(SEEDS)
def test_to_and_fro_comes_back_the_way_it_went(seed: int) -> None:
    poses = wandering(np.random.default_rng(seed), 3, swing_deg=60.0, rate_hz=4.0)
    idle = to_and_fro(poses, 4.0)
    t = np.linspace(0.0, 2.0, 21)
    assert same(idle.at(t).orientation_wxyz, idle.at(4.0 - t).orientation_wxyz, 1e-9)
    assert same(poses.orientation_wxyz, idle.at([0.0, 1.0, 2.0]).orientation_wxyz, 1e-9)


def test_spring_goes_beyond_the_last_pose_along_the_same_arc_and_back_in_reverse() -> None:
    poses = wandering(np.random.default_rng(3), 2, swing_deg=30.0, rate_hz=1.0)
    crouch = Sprung(poses, back_s=5.0)
    weight = crouch.weight(np.linspace(0.0, 5.0, 5001))
    assert 0.0 == weight[0]
    assert 1.0459879102602678 == pytest.approx(weight.max(), abs=1e-6)
    assert 1.0 == pytest.approx(weight[-1], abs=1e-9)
    assert weight[::-1] == pytest.approx(crouch.weight(np.linspace(5.0, 10.0, 5001)), abs=1e-9)


def test_spring_is_a_round_that_comes_again_and_again() -> None:
    crouch = Sprung(wandering(np.random.default_rng(4), 2), Spring(), back_s=1.2)
    t_s = np.linspace(0.0, 2.4, 49)
    once = crouch.weight(t_s)
    assert once == pytest.approx(crouch.weight(t_s + 24.0), abs=1e-9)
    assert once.max() > 1.0


def test_walk_of_more_poses_lies_nearer_to_the_walk_they_were_taken_from() -> None:
    source = bake(
        Person(build_of_skeleton(canonical_skeleton(1.75)), Walk(1.3, stride_cv=0.0), seed=1),
        8.0,
        rate_hz=120.0,
    )
    foot_m = placed_joints(source, source.frame_times_s).position_m
    ahead_m = source.root_m[:, 2] - foot_m[:, source.skeleton.index("left_foot"), 2]
    first, second = (i + int(np.argmax(ahead_m[i : i + 150])) for i in (360, 480))
    period_s = (second - first) / 120
    t_s = np.linspace(0.0, period_s, 41)
    wanted = placed_joints(source, first / 120 + t_s).position_m
    wanted = wanted - source.at(first / 120 + t_s).root_m[:, None]
    errors_m = []
    for increment in (0, 1, 2):
        poses = authored_poses("walk", source, first / 120, first / 120 + period_s / 2, increment)
        walk = hybrid("walk", poses, period_s)
        got = placed_joints(walk, t_s).position_m - walk.at(t_s).root_m[:, None]
        errors_m.append(np.linalg.norm(got - wanted, axis=-1).mean())
    assert errors_m[2] < errors_m[1] < errors_m[0] < 0.04


def test_names_and_increments_that_are_not_there_are_refused() -> None:
    with pytest.raises(MotionError, match="walk, run, crouch, idle"):
        pose_counts("jump", 0)
    with pytest.raises(MotionError, match="increment -1"):
        pose_counts("walk", -1)
    with pytest.raises(MotionError, match="end later"):
        authored_poses("idle", wandering(np.random.default_rng(0), 3), 1.0, 1.0, 0)
    with pytest.raises(MotionError, match="two poses"):
        Sprung(wandering(np.random.default_rng(0), 1))
    with pytest.raises(MotionError, match="no hybrid motion"):
        hybrid("jump", wandering(np.random.default_rng(0), 2), 1.0)
