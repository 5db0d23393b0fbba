"""The body of a simulated person who sits or stands before a display and points."""

import numpy as np
import pytest

from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.errors import DataError
from visavis.lab.geometry import quat_from_yaw_pitch_deg, rotate, unit
from visavis.people.body import StandingBody, segments_of
from visavis.people.body_kernels import HALF_IPD_M
from visavis.people.person import StudyPerson
from visavis.stimuli.motion.skeleton import canonical_skeleton

STANDING_EYE_M, SEATED_EYE_M = 1.62, 1.2
EITHER = pytest.mark.parametrize("eye_m", [STANDING_EYE_M, SEATED_EYE_M], ids=["stands", "sits"])


def body_of(eye_m, *, yaw_deg=0.0, pitch_deg=0.0, moved_m=(0.0, 0.0, 0.0)):
    """Return where every segment is, and how it is turned, of somebody who looks and points."""
    eyes = np.array([[0.0, eye_m, 0.0]]) + moved_m
    turn = quat_from_yaw_pitch_deg(yaw_deg, pitch_deg)[None]
    hand = np.array([[0.26, eye_m - 0.42, -0.30]])
    at, turns = segments_of(
        BODY_JOINTS, np.array([0.0, eye_m, 0.0]), eyes, turn, hand, np.array([[0.3, 0.0, -1.0]])
    )
    return dict(zip(BODY_JOINTS, at[0], strict=True)), dict(zip(BODY_JOINTS, turns[0], strict=True))


def apart_m(body, one, other):
    """Return the distance of two segments."""
    return float(np.linalg.norm(body[one] - body[other]))


@EITHER
def test_the_feet_of_a_simulated_person_stand_on_the_floor(eye_m):
    body, _ = body_of(eye_m)

    assert (0, 0) == pytest.approx((body["left_toes"][1], body["right_toes"][1]), abs=0.05)


def test_who_stands_has_hips_above_the_feet_and_who_sits_has_them_behind():
    standing, sitting = body_of(STANDING_EYE_M)[0], body_of(SEATED_EYE_M)[0]

    assert 0 == pytest.approx(standing["hips"][2] - standing["left_foot"][2], abs=0.12)
    assert 0.85 < standing["hips"][1] < 1.05
    assert sitting["hips"][2] - sitting["left_foot"][2] > 0.3
    assert 0.4 < sitting["hips"][1] < 0.65


@EITHER
@pytest.mark.parametrize("yaw_deg", [0.0, 40.0])
@pytest.mark.parametrize("pitch_deg", [0.0, -20.0])
def test_the_head_sits_on_the_neck_however_it_is_turned_and_moved(eye_m, yaw_deg, pitch_deg):
    moved = (0.02, -0.01, 0.03)

    body, _ = body_of(eye_m, yaw_deg=yaw_deg, pitch_deg=pitch_deg, moved_m=moved)

    at_rest = apart_m(body_of(eye_m)[0], "head", "neck")
    assert at_rest == pytest.approx(apart_m(body, "head", "neck"), abs=0.005)
    assert 0.05 < at_rest < 0.15


@EITHER
def test_the_head_segment_is_where_and_as_the_headset_measures_it(eye_m):
    body, turns = body_of(eye_m, yaw_deg=30.0)
    wanted = quat_from_yaw_pitch_deg(30.0, 0.0)

    assert 1.0 == pytest.approx(abs(float(wanted @ turns["head"])))
    in_head = rotate(wanted * [1, -1, -1, -1], np.array([0.0, eye_m, 0.0]) - body["head"])
    assert 0.0 == pytest.approx(in_head[0], abs=1e-6)
    assert 0.03 < in_head[1] < 0.12
    assert in_head[2] < -0.03


@EITHER
def test_the_free_arm_hangs_or_lies_and_no_bone_is_stretched(eye_m):
    body, _ = body_of(eye_m)
    rest = canonical_skeleton()
    bone = {name: float(np.linalg.norm(rest.offsets_m[rest.index(name)])) for name in BODY_JOINTS}
    scale = apart_m(body, "left_lower_arm", "left_hand") / bone["left_hand"]
    limbs = (
        ("lower_leg", "upper_leg"),
        ("foot", "lower_leg"),
        ("hand", "lower_arm"),
        ("lower_arm", "upper_arm"),
    )

    assert body["left_hand"][1] < body["left_shoulder"][1] - 0.25
    assert abs(body["left_hand"][0]) < 0.4
    for side in ("left", "right"):
        for child, parent in limbs:
            length = apart_m(body, f"{side}_{child}", f"{side}_{parent}")
            assert scale * bone[f"{side}_{child}"] == pytest.approx(length, abs=0.01)


def test_the_body_of_a_study_s_person_follows_their_head():
    person = StudyPerson(1, 1, responses={})
    person.prepare(1, 0)
    t_ns = np.arange(0, 3_000_000_000, 50_000_000, dtype=np.int64)

    at, turns = person.segments(("head", "neck", "hips"), t_ns)

    heads = [person.head(int(t)) for t in t_ns]
    np.testing.assert_allclose(turns[:, 0], [turn for _, turn in heads], atol=1e-9)
    gap = np.linalg.norm(at[:, 0] - at[:, 1], axis=1)
    assert gap.max() - gap.min() < 0.01
    eyes = np.array([position for position, _ in heads])
    assert np.linalg.norm(eyes - at[:, 0], axis=1).max() < 0.15


def test_a_standing_body_answers_the_same_about_one_instant_and_about_many():
    eye_m = np.array([0.0, STANDING_EYE_M, 0.0])
    body = StandingBody(
        eye_m,
        np.array([0.3, 1.0, 2.0]),
        ahead_m=eye_m - [0.0, 0.0, 2.0],
        hand_m=eye_m + np.array([0.26, -0.42, -0.3]),
        rest_m=eye_m - [0.0, 0.6, 1.0],
    )
    for begin_s, x_m in ((0.2, 0.5), (0.7, -0.6), (1.9, 0.1)):
        body.look(begin_s, eye_m + np.array([x_m, 0.1, -2.0]))
        body.hand.point(begin_s, eye_m + np.array([x_m, -0.1, -2.0]))
    t_ns = np.arange(0, 3_000_000_000, 50_000_000, dtype=np.int64)

    eyes = body.eyes(t_ns)
    at, turns = body.segments(("head", "right_hand"), t_ns)

    for i, one in enumerate(t_ns):
        assert eyes[i] == body.eyes(t_ns[i : i + 1])[0]
        at_once, turned_once = body.segments(("head", "right_hand"), t_ns[i : i + 1])
        np.testing.assert_array_equal(at[i], at_once[0])
        np.testing.assert_array_equal(turns[i], turned_once[0])
        np.testing.assert_array_equal(turns[i, 0], body.head(int(one))[1])


def test_both_eyes_of_a_standing_body_meet_at_the_point_they_look_at():
    eye_m = np.array([0.0, STANDING_EYE_M, 0.0])
    goal_m = np.array([0.7, 1.3, -2.0])
    body = StandingBody(eye_m, np.zeros(3), ahead_m=goal_m, hand_m=eye_m, rest_m=goal_m)
    t_ns = np.arange(0, 2_000_000_000, 100_000_000, dtype=np.int64)

    eyes = body.eyes(t_ns)

    for i, t in enumerate(t_ns):
        middle_m, turn = body.head(int(t))
        for side, way in (("left", -1.0), ("right", 1.0)):
            from_m = middle_m + rotate(turn, np.array([way * HALF_IPD_M, 0.0, 0.0]))
            looks = rotate(turn, eyes[f"{side}_direction_head"][i])
            np.testing.assert_allclose(looks, unit(goal_m - from_m), atol=1e-7)


def test_a_segment_that_the_body_lacks_is_refused():
    still = np.zeros((1, 3))
    with pytest.raises(DataError, match="tail"):
        segments_of(("tail",), still[0], still, np.array([[1.0, 0, 0, 0]]), still, still - 1.0)
