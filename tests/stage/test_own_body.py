"""The participant's own body: their size, their posture, no head, and only where it is tracked."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stage import figures
from visavis.devices.contracts import body_schema
from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg, quat_multiply, rotate
from visavis.lab.schema import SampleBatch
from visavis.stage.own_body import EYES_BEHIND_M, OwnBody, headless
from visavis.stimuli.characters.body_parts import GROUPS, PART_INDEX
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.sizing import LEG_BONES, with_limbs
from visavis.stimuli.motion.skeleton import forward

SEGMENTS = (
    "hips",
    "spine",
    "upper_chest",
    "neck",
    "head",
    "left_upper_arm",
    "left_lower_arm",
    "left_hand",
    "left_upper_leg",
    "left_lower_leg",
    "left_foot",
)
WALK_TO = np.array([2.0, 0.0, -1.0])


def character() -> Character:
    return figures.picture(1).cast[0]


def sample(scale: float = 1.0, *, lost: tuple[str, ...] = (), arm_deg: float = 0.0) -> SampleBatch:
    """Return a person `scale` times the character's size who raises the left upper arm."""
    skeleton = character().skeleton
    index = [skeleton.index_of[name] for name in SEGMENTS]
    local = np.tile([1.0, 0.0, 0.0, 0.0], (1, len(skeleton.names), 1))
    local[0, 0] = quat_from_yaw_pitch_deg(30.0, 0.0)
    local[0, skeleton.index_of["left_upper_arm"]] = quat_from_yaw_pitch_deg(arm_deg, 0.0)
    placed = forward(
        replace(skeleton, offsets_m=scale * skeleton.offsets_m, tips_m=scale * skeleton.tips_m),
        np.array([[0.0, 0.95 * scale, 0.0]]) + WALK_TO,
        local,
    )
    schema = body_schema(SEGMENTS, 100.0)
    values = np.zeros(1, schema.dtype)
    values["position_m"][0] = placed.position_m[0, index]
    values["orientation_wxyz"][0] = placed.orientation_wxyz[0, index]
    values["valid"][0] = [name not in lost for name in SEGMENTS]
    values["position_m"][0][~values["valid"][0]] = np.nan
    zero = np.zeros(1, np.int64)
    return SampleBatch(schema, zero, zero, zero, values)


def head_of(scale: float) -> Pose:
    return Pose(WALK_TO + np.array([0.0, 1.6 * scale, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))


def shape_of(body: OwnBody, scale: float = 1.0) -> tuple[Vector, Vector]:
    picture = body.add_to(figures.picture(2), head_of(scale))
    mine = picture.cast[-1]
    placed = forward(
        mine.skeleton, picture.people.root_m[-1:], picture.people.orientation_wxyz[-1:]
    )
    return placed.position_m[0], placed.orientation_wxyz[0]


@pytest.mark.parametrize("scale", [0.85, 1.0, 1.12])
def test_body_is_as_tall_as_its_participant(scale: float) -> None:
    body = OwnBody(character(), SEGMENTS)
    assert body.stature_m is None
    body.take(sample(scale))
    assert body.stature_m == pytest.approx(scale * character().stature_m, abs=2e-3)


def test_tracked_joints_turn_as_they_are_tracked_and_fingers_with_their_hand() -> None:
    body = OwnBody(character(), SEGMENTS)
    body.take(sample(arm_deg=40.0))
    _, turns = shape_of(body)
    names = character().skeleton.index_of
    hips = quat_from_yaw_pitch_deg(30.0, 0.0)
    raised = quat_multiply(hips, quat_from_yaw_pitch_deg(40.0, 0.0))
    for name, expected in (
        ("hips", hips),
        ("left_upper_arm", raised),
        ("left_hand", raised),
        ("left_index_proximal", raised),
        ("right_hand", hips),
    ):
        assert abs(float(turns[names[name]] @ expected)) == pytest.approx(1.0, abs=1e-6), name


def test_eyes_of_the_body_are_right_behind_those_of_its_participant() -> None:
    body = OwnBody(character(), SEGMENTS)
    body.take(sample())
    places, _ = shape_of(body)
    names = character().skeleton.index_of
    middle = (places[names["left_eye"]] + places[names["right_eye"]]) / 2
    back = rotate(quat_from_yaw_pitch_deg(30.0, 0.0), np.array([0.0, 0.0, EYES_BEHIND_M]))
    expected = head_of(1.0).position_m + back
    assert middle[[0, 2]] == pytest.approx(expected[[0, 2]], abs=1e-6)


def test_nobody_is_added_before_the_hips_are_tracked_or_in_the_dark() -> None:
    body = OwnBody(character(), SEGMENTS)
    picture = figures.picture(2)
    body.take(sample(lost=("hips",)))
    assert body.add_to(picture, head_of(1.0)) is picture
    body.take(sample())
    dark = replace(picture, brightness_01=0.0)
    assert body.add_to(dark, head_of(1.0)) is dark
    assert len(body.add_to(picture, head_of(1.0)).cast) == 3


def test_lost_segment_keeps_to_its_parent() -> None:
    body = OwnBody(character(), SEGMENTS)
    body.take(sample())
    body.take(sample(lost=("left_hand", "left_lower_arm"), arm_deg=40.0))
    places, turns = shape_of(body)
    names = character().skeleton.index_of
    assert np.isfinite(places).all()
    same = turns[names["left_hand"]] @ turns[names["left_upper_arm"]]
    assert abs(float(same)) == pytest.approx(1.0, abs=1e-6)


def test_headless_body_has_everything_but_head_and_neck() -> None:
    hidden = {PART_INDEX[p] for p in (*GROUPS["head"], "neck")}
    whole, without = character(), headless(character())
    for before, after in zip(whole.levels, without.levels, strict=True):
        assert not hidden & set(after.triangle_part.tolist())
        kept = ~np.isin(before.triangle_part, list(hidden))
        assert kept.sum() == len(after.triangles) > 0


@pytest.mark.parametrize(("arms", "legs"), [(1.1, 0.95), (0.9, 1.05)])
def test_arms_and_legs_are_as_long_as_their_participants(arms: float, legs: float) -> None:
    body = OwnBody(character(), SEGMENTS)
    batch = sample()
    long = replace(character().skeleton, offsets_m=character().skeleton.offsets_m.copy())
    for name, k in (("lower_arm", arms), ("hand", arms), ("lower_leg", legs), ("foot", legs)):
        for side in ("left", "right"):
            long.offsets_m[long.index_of[f"{side}_{name}"]] *= k
    index = [long.index_of[name] for name in SEGMENTS]
    local = np.tile([1.0, 0.0, 0.0, 0.0], (1, len(long.names), 1))
    placed = forward(long, np.array([[0.0, 0.95, 0.0]]) + WALK_TO, local)
    batch.values["position_m"][0] = placed.position_m[0, index]
    body.take(batch)
    mine = body.add_to(figures.picture(2), head_of(1.0)).cast[-1].skeleton
    measured = {name: long.offsets_m[long.index_of[name]] for name in long.names}
    for bone in ("left_lower_arm", "left_hand", "right_hand", "left_foot"):
        length = np.linalg.norm(mine.offsets_m[mine.index_of[bone]])
        assert np.linalg.norm(measured[bone]) == pytest.approx(length, abs=1e-3), bone


def test_longer_limbs_keep_their_girth_and_hands_their_size() -> None:
    own, longer = character(), with_limbs(character(), 1.1, 1.1)
    hand, before, after = PART_INDEX["left_hand"], own.levels[0], longer.levels[0]
    rows = np.unique(before.triangles[before.triangle_part == hand])
    assert np.ptp(before.vertices_m[rows], axis=0) == pytest.approx(
        np.ptp(after.vertices_m[rows], axis=0), abs=0.004
    )
    thigh = np.unique(before.triangles[before.triangle_part == PART_INDEX["left_thigh"]])
    girth = [np.ptp(mesh.vertices_m[thigh][:, [0, 2]], axis=0) for mesh in (before, after)]
    assert girth[0] == pytest.approx(girth[1], abs=0.004)
    low = [mesh.vertices_m[:, 1].min() for mesh in (before, after)]
    bones = [own.skeleton.offsets_m[own.skeleton.index_of[f"left_{n}"]] for n in LEG_BONES]
    assert 0.1 * sum(np.linalg.norm(b) for b in bones) == pytest.approx(low[0] - low[1], abs=0.004)
