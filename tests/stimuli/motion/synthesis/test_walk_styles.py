"""Walks are what they are called: told apart by what can be seen of them, on legs that reach."""

import re
from pathlib import Path

import numpy as np
import pytest

from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward
from visavis.stimuli.motion.synthesis.walk_features import FEATURES, GROUPS, feature_table
from visavis.stimuli.motion.synthesis.walk_styles import (
    EMOTIONS,
    SPEEDS,
    WALK_JOINTS,
    WalkStyle,
    reduced,
    style_names,
    styled_walk,
    walk_set,
)


def test_sets_are_as_the_source_describes_them() -> None:
    a, b = walk_set("set_a"), walk_set("set_b")
    assert (10, 27, 20, 1 / 30) == (len(a), len(b), len(WALK_JOINTS), a.frame_s)
    speeds = -a.travel_m[:, 2] / a.cycle_s
    assert np.ptp(speeds) < 0.01
    assert b.names[:3] == ("neutral_slow", "neutral_normal", "neutral_fast")
    with pytest.raises(MotionError, match="set_a and set_b"):
        style_names("set_c")


def test_each_walk_is_nearest_to_one_of_its_mood_or_its_speed() -> None:
    table = feature_table(walk_set("set_b"))
    apart = np.linalg.norm(table.scaled_01[:, None] - table.scaled_01, axis=-1)
    np.fill_diagonal(apart, np.inf)
    right = 0
    for i, j in enumerate(apart.argmin(axis=1)):
        (mood, speed), (other, pace) = (table.names[k].split("_") for k in (i, j))
        right += mood == other or speed == pace
    assert right >= 25
    assert apart.min() > 0.3


def test_moods_differ_as_walks_of_these_moods_do() -> None:
    walks = walk_set("set_b")
    values = {n: feature_table(walks).values[:, FEATURES.index(n)] for n in FEATURES}

    def of(mood: str, feature: str) -> float:
        return float(values[feature][[walks.index(f"{mood}_{s}") for s in SPEEDS]].mean())

    for mood in set(EMOTIONS) - {"misery", "depression"}:
        assert of("misery", "mean_head_fb") > of(mood, "mean_head_fb") + 5
        assert of("depression", "sd_left_upper_arm_fb") < of(mood, "sd_left_upper_arm_fb")
    assert of("excitement", "sd_com_up") > 1.5 * of("neutral", "sd_com_up")
    assert of("sleepiness", "sd_torso_lr") > 1.5 * of("neutral", "sd_torso_lr")
    assert of("distress", "mean_left_forearm_fb") > of("neutral", "mean_left_forearm_fb") + 30


@pytest.mark.parametrize("which", ["set_a", "set_b"])
def test_legs_reach_and_soles_stay_on_the_floor(which: str) -> None:
    build = build_of_skeleton(canonical_skeleton())
    for name, style in style_names(which).items():
        clip, keys = styled_walk(style, build)
        body = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz)
        for side in ("left", "right"):
            knee = clip.orientation_wxyz[:, clip.skeleton.index(f"{side}_lower_leg")]
            bend = np.degrees(2 * np.arccos(np.clip(np.abs(knee[:, 0]), 0, 1)))
            assert 1.0 < bend.min(), name
            assert bend.max() < 125, name
            toes = body.position_m[:, clip.skeleton.index(f"{side}_toes"), 1]
            assert toes.min() > 0.008, name  # the ball's sole lies 10.5 mm below its joint
        assert keys[-1] == pytest.approx(clip.duration_s)


def test_twenty_joints_stand_where_those_of_the_whole_body_do() -> None:
    clip, _ = styled_walk(WalkStyle(lean_deg=20.0), build_of_skeleton(canonical_skeleton()))
    small = reduced(clip)
    whole = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz)
    few = forward(small.skeleton, small.root_m, small.orientation_wxyz)
    for name in ("hips", "left_foot", "right_toes", "left_lower_leg"):
        apart = (
            whole.position_m[:, clip.skeleton.index(name)]
            - few.position_m[:, small.skeleton.index(name)]
        )
        assert np.abs(apart).max() < 1e-9
    for name in ("head", "left_hand"):
        turns = (
            whole.orientation_wxyz[:, clip.skeleton.index(name)],
            few.orientation_wxyz[:, small.skeleton.index(name)],
        )
        assert np.abs(np.abs(np.sum(turns[0] * turns[1], axis=-1)) - 1).max() < 1e-12


def test_styles_out_of_bounds_are_named() -> None:
    with pytest.raises(MotionError, match="lean_deg of a walk is 90"):
        WalkStyle(lean_deg=90.0)
    with pytest.raises(MotionError, match="even number"):
        WalkStyle(frames=33)


def test_the_list_of_features_is_published_as_it_is() -> None:
    text = (Path(__file__).parents[4] / "docs" / "motion.md").read_text("utf-8")
    rows = [
        line for line in text.splitlines() if line.startswith(tuple(f"| `{g}`" for g in GROUPS))
    ]
    listed = [re.findall(r"`(\w+)`", row) for row in rows]
    assert {own[0]: tuple(own[1:]) for own in listed} == GROUPS


def test_features_are_the_sources_51_and_scaled_to_one() -> None:
    assert 51 == len(FEATURES) == len(set(FEATURES))
    assert [5, 12, 17, 17] == [len(group) for group in GROUPS.values()]
    table = feature_table(walk_set("set_b"))
    assert table.scaled_01.min() == 0.0
    assert table.scaled_01.max() == 1.0
    tells = np.isfinite(table.span)
    z = (table.values - table.values.mean(axis=0))[:, tells] / table.values.std(axis=0)[tells]
    z = (z - z.min(axis=0)) / np.ptp(z, axis=0)
    assert np.allclose(z, table.scaled_01[:, tells])
    # Walks of ours are alike on both sides: these tell none of them apart.
    silent = {name for name, tell in zip(FEATURES, tells, strict=True) if not tell}
    assert silent == {"mean_torso_lr", "mean_head_lr", "mean_com_speed_lr", "mean_com_lr"}
    assert set(table.group_of) == set(GROUPS)
    assert table.primary.shape == (27, 4)
    assert table.primary_of(table.scaled_01[3]) == pytest.approx(table.primary[3])
