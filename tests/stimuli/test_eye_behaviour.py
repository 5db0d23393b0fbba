"""Agents' eyes: limits, saccades, blinks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.geometry import angle_deg, unit
from visavis.stimuli.gaze.behaviour import (
    MAXIMUM_TURN_DEG,
    NEVER_NS,
    EyeBehaviour,
    saccade_duration_ms,
)
from visavis.stimuli.gaze.blinks import Blinks, draw_blinks
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M, SPEAKER_EYE_M, audience_scene

MS = 1_000_000
SCENE = audience_scene([f"c{i}" for i in range(11)])
EYES = np.array([a.eye_centre_m for a in SCENE.agents])
FACING = np.array([a.facing for a in SCENE.agents])
NO_BLINKS = Blinks(*np.empty((3, 0), np.int64))
AVERTED = EyeBehaviour.of_scene(SCENE, target_m=SPEAKER_EYE_M, blinks=NO_BLINKS)
LEFT_CLOSE, CENTRE_CLOSE = 0, 3


def test_averted_eyes_point_at_the_speaker() -> None:
    gaze, openness, moving = AVERTED.at(0, PARTICIPANT_EYE_M)

    np.testing.assert_allclose(gaze, unit(SPEAKER_EYE_M - EYES), atol=1e-12)
    assert [1.0] * 11 == openness.tolist()
    assert not moving


def test_staring_eyes_follow_the_observer_and_nobody_else_does() -> None:
    moved = PARTICIPANT_EYE_M + np.array([0.1, 0.05, 0.0])
    gaze, *_ = AVERTED.staring(CENTRE_CLOSE).at(5 * MS, moved)
    others = np.arange(11) != CENTRE_CLOSE

    np.testing.assert_allclose(gaze[CENTRE_CLOSE], unit(moved - EYES[CENTRE_CLOSE]), atol=1e-12)
    np.testing.assert_allclose(gaze[others], unit(SPEAKER_EYE_M - EYES[others]), atol=1e-12)


@pytest.mark.parametrize("to_observer", [True, False])
def test_turn_goes_from_one_target_to_the_other_in_the_main_sequence_time(
    to_observer: bool,
) -> None:
    turn = AVERTED.turning(LEFT_CLOSE, 1000 * MS, to_observer=to_observer)
    at_observer = unit(PARTICIPANT_EYE_M - EYES[LEFT_CLOSE])
    at_speaker = unit(SPEAKER_EYE_M - EYES[LEFT_CLOSE])
    first, last = (at_speaker, at_observer) if to_observer else (at_observer, at_speaker)
    duration_ns = round(saccade_duration_ms(float(angle_deg(first, last))) * MS)

    before, _, still_before = turn.at(1000 * MS - 1, PARTICIPANT_EYE_M)
    middle, _, on_the_way = turn.at(1000 * MS + duration_ns // 2, PARTICIPANT_EYE_M)
    after, _, still_after = turn.at(1000 * MS + duration_ns + 1, PARTICIPANT_EYE_M)

    np.testing.assert_allclose(before[LEFT_CLOSE], first, atol=1e-12)
    np.testing.assert_allclose(after[LEFT_CLOSE], last, atol=1e-12)
    np.testing.assert_allclose(middle[LEFT_CLOSE], unit(first + last), atol=1e-6)
    assert (False, True, False) == (still_before, on_the_way, still_after)


def test_twenty_degree_saccade_lasts_65_ms() -> None:
    assert pytest.approx(65.0) == saccade_duration_ms(20.0)


def test_saccade_speeds_up_and_slows_down_without_overshoot() -> None:
    turn = AVERTED.turning(LEFT_CLOSE, 0, to_observer=True)
    first = unit(SPEAKER_EYE_M - EYES[LEFT_CLOSE])
    amplitude = float(angle_deg(first, unit(PARTICIPANT_EYE_M - EYES[LEFT_CLOSE])))
    duration_ms = saccade_duration_ms(amplitude)
    t_ns = np.linspace(0, duration_ms * MS, 400).astype(np.int64)
    passed = np.array([angle_deg(first, turn.at(int(t), PARTICIPANT_EYE_M)[0][0]) for t in t_ns])
    speed = np.diff(passed) / np.diff(t_ns) * 1e9

    assert np.all(np.diff(passed) > -1e-9)
    assert pytest.approx(amplitude, abs=1e-3) == passed[-1]
    assert pytest.approx(1.875 * amplitude / duration_ms * 1000, rel=0.01) == speed.max()
    assert speed[0] < 0.05 * speed.max() > speed[-1]


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.floats(-5, 5), min_size=3, max_size=3),
    st.integers(0, 200),
)
def test_eyes_never_turn_beyond_the_limit_and_are_always_unit(
    target: list[float], t_ms: int
) -> None:
    behaviour = EyeBehaviour.of_scene(SCENE, target_m=np.array(target), blinks=NO_BLINKS)
    for each in (behaviour, behaviour.turning(2, 10 * MS, to_observer=True)):
        gaze, *_ = each.at(t_ms * MS, PARTICIPANT_EYE_M)

        assert MAXIMUM_TURN_DEG + 1e-6 >= angle_deg(gaze, FACING).max()
        np.testing.assert_allclose(np.linalg.norm(gaze, axis=1), 1.0, atol=1e-9)


def test_target_too_far_round_is_looked_towards_up_to_the_limit() -> None:
    side = np.cross(FACING[0], [0.0, 1.0, 0.0])
    behaviour = EyeBehaviour.of_scene(SCENE, target_m=EYES[0] + 3 * side, blinks=NO_BLINKS)
    gaze = behaviour.at(0, PARTICIPANT_EYE_M)[0][0]

    assert pytest.approx(MAXIMUM_TURN_DEG) == angle_deg(gaze, FACING[0])
    assert gaze @ side > 0
    assert pytest.approx(0.0, abs=1e-12) == gaze @ np.cross(FACING[0], side)


def test_behaviours_derive_from_each_other_without_changing_the_first() -> None:
    AVERTED.turning(1, 5, to_observer=True)
    AVERTED.staring(2)

    assert NEVER_NS == AVERTED.turn_ns.min()
    assert not AVERTED.follows_observer.any()


def test_blink_closes_fully_and_opens_again() -> None:
    blinks = Blinks(np.array([4]), np.array([100 * MS]), np.array([300 * MS]))
    behaviour = EyeBehaviour.of_scene(SCENE, target_m=SPEAKER_EYE_M, blinks=blinks)

    def openness(t_ms: float) -> float:
        return float(behaviour.at(int(t_ms * MS), PARTICIPANT_EYE_M)[1][4])

    assert 1.0 == openness(99) == openness(300)
    assert 0.0 == openness(170)
    assert 0.0 < openness(130) < 1.0
    assert 0.0 < openness(250) < 1.0
    assert 1.0 == behaviour.at(170 * MS, PARTICIPANT_EYE_M)[1][5]
    assert behaviour.at(170 * MS, PARTICIPANT_EYE_M)[2]


def test_blinks_come_at_a_natural_rate_and_length() -> None:
    blinks = draw_blinks(np.random.default_rng(5), 11, 600.0)
    per_minute = len(blinks.agent) / 11 / 10
    duration_ms = (blinks.end_ns - blinks.start_ns) / MS

    assert 12 < per_minute < 20
    assert 100 < duration_ms.min()
    assert duration_ms.max() < 600


def test_blinks_of_one_agent_do_not_overlap_and_are_sorted() -> None:
    blinks = draw_blinks(np.random.default_rng(6), 11, 60.0)

    assert np.all(np.diff(blinks.start_ns) >= 0)
    for agent in range(11):
        mine = blinks.agent == agent
        assert np.all(blinks.start_ns[mine][1:] >= blinks.end_ns[mine][:-1] + 799 * MS)


def test_blinks_are_as_frequent_at_the_start_as_later() -> None:
    rng = np.random.default_rng(7)
    starts = np.concatenate([draw_blinks(rng, 11, 16.0).start_ns for _ in range(300)]) / 1e9
    first, later = np.sum((starts >= 0) & (starts < 2)), np.sum((starts >= 8) & (starts < 10))

    assert 0.85 < first / later < 1.15


def test_same_seed_gives_the_same_blinks() -> None:
    one, two = (draw_blinks(np.random.default_rng(8), 11, 16.0) for _ in range(2))

    np.testing.assert_array_equal(one.start_ns, two.start_ns)
    np.testing.assert_array_equal(one.agent, two.agent)
