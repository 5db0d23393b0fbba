from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.stimuli.warping.bodies import arm_raised, box_person
from visavis.lab.geometry import unit
from visavis.stimuli.gaze.turning import Aimed
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import Idle, Talk, Walk, Wave
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.warping.outlook import looking_at, outlook
from visavis.stimuli.motion.warping.reaction import (
    SeenMotion,
    WaveCues,
    WaveRule,
    WaveWatcher,
    judge,
    looked_at,
    wave_cues,
)
from visavis.stimuli.rooms.solids import box

WAVE = Wave(hand="right")


@cache
def clip_of(kind, gaze_deg=0.0, heading_deg=0.0):
    """Return 1.5 s of somebody at the origin who looks at an angle left of −z."""
    yaw = np.radians(gaze_deg)
    gaze = Aimed(np.array([[-np.sin(yaw), 0.0, -np.cos(yaw)]]), np.ones(1))
    person = Person(build_of_skeleton(canonical_skeleton(1.75)), kind, 5, heading_deg=heading_deg)
    return bake(person, 1.5, gaze=gaze)


def observer_at(bearing_deg, distance_m=3.0):
    yaw = np.radians(bearing_deg)
    return np.array([-distance_m * np.sin(yaw), 1.62, -distance_m * np.cos(yaw)])


def seen(clip, eye, *, face=True, trunk=True, hands=(True, True)):
    n = len(clip.root_m)
    return SeenMotion(
        clip.frame_times_s,
        clip.root_m,
        clip.orientation_wxyz,
        np.repeat(eye[None], n, axis=0),
        np.full(n, face),
        np.full(n, trunk),
        np.repeat([hands], n, axis=0),
    )


def judgement(kind, bearing_deg, *, distance_m=3.0, gaze_deg=0.0, heading_deg=0.0, **shown):
    clip = clip_of(kind, gaze_deg, heading_deg)
    return judge(
        wave_cues(clip.skeleton, seen(clip, observer_at(bearing_deg, distance_m), **shown))
    )


@pytest.mark.parametrize("distance_m", [1.5, 3.0, 9.0])
@pytest.mark.parametrize("hand", ["left", "right"])
def test_wave_at_the_observer_is_meant(hand, distance_m):
    found = judgement(Wave(hand=hand), 0.0, distance_m=distance_m)
    assert found.waves
    assert found.is_meant
    assert hand == found.cues.hand


@pytest.mark.parametrize("bearing_deg", [-60.0, -40.0, 40.0, 60.0])
def test_wave_past_the_observer_is_not_meant(bearing_deg):
    found = judgement(WAVE, bearing_deg)
    assert found.waves
    assert not found.is_meant


@pytest.mark.parametrize("bearing_deg", [-35.0, 35.0])
def test_gaze_outweighs_a_body_that_is_turned_aside(bearing_deg):
    assert judgement(WAVE, bearing_deg, gaze_deg=bearing_deg).is_meant
    assert not judgement(WAVE, bearing_deg, gaze_deg=0.0).is_meant


def test_body_decides_where_the_face_cannot_be_seen():
    at, past = (judgement(WAVE, b, face=False) for b in (0.0, 60.0))
    assert np.isnan(at.cues.gaze_deg)
    assert at.is_meant
    assert not past.is_meant


def test_swing_alone_does_not_say_whom_it_is_for():
    found = judgement(WAVE, 0.0, face=False, trunk=False)
    assert found.waves
    assert not found.is_meant


@pytest.mark.parametrize("kind", [Idle(), Talk(), Walk()])
def test_who_does_something_else_does_not_wave(kind):
    found = judgement(kind, 0.0)
    assert not found.waves
    assert np.isnan(found.score_01)


def test_hidden_hand_does_not_wave():
    assert not judgement(WAVE, 0.0, hands=(True, False)).waves


def test_wave_too_small_to_be_noticed_is_none():
    assert not judgement(Wave(hand="right", swing_deg=6.0), 0.0).waves
    assert not judgement(WAVE, 0.0, distance_m=150.0).waves


def test_cues_are_angles_in_degrees():
    cues = judgement(WAVE, 40.0).cues
    assert cues.body_deg == pytest.approx(40.0, abs=12.0)
    assert cues.gaze_deg == pytest.approx(40.0, abs=6.0)
    # Two thirds of a metre at 3 m are 13°; a wave swings some 0.2 m.
    assert 1.0 < cues.amplitude_deg < 12.0


@given(gaze=st.floats(0, 90), more=st.floats(0, 90), body=st.floats(0, 180))
def test_looking_further_away_never_raises_the_score(gaze, more, body):
    scores = [
        judge(WaveCues("right", 0.9, 5.0, 4, 1.0, body, g)).score_01 for g in (gaze, gaze + more)
    ]
    assert 0 <= scores[1] <= scores[0] <= 1


def test_watcher_reacts_once_and_again_only_after_a_rest():
    clip, eye = clip_of(WAVE), observer_at(0.0)
    watcher = WaveWatcher(clip.skeleton, window_s=1.0, rest_s=2.0)
    reactions = []
    for k in range(150):  # 5 s at 30 Hz: the clip to and fro
        t_ns, row = k * 33_333_333, k % (len(clip.root_m))
        found = watcher.observe(t_ns, clip.root_m[row], clip.orientation_wxyz[row], eye)
        if watcher.reacts(t_ns, found):
            reactions.append(t_ns / 1e9)
    assert 2 <= len(reactions) <= 3
    assert reactions[0] >= 0.5
    assert np.diff(reactions).min() >= 2.0


def test_watcher_says_nothing_before_it_has_seen_enough():
    clip = clip_of(WAVE)
    watcher = WaveWatcher(clip.skeleton)
    assert watcher.observe(0, clip.root_m[0], clip.orientation_wxyz[0], observer_at(0.0)) is None
    assert not watcher.reacts(0, None)


def test_what_an_observer_sees_comes_from_the_rendered_view():
    root, turns = arm_raised()
    centre = np.array([0.0, 1.1, 0.0])
    camera = looking_at(centre + np.array([0.0, 0.1, -3.0]), centre, 1.15)
    free = looked_at(box_person(), outlook(camera, 96), root, turns)
    assert (True, True, (True, True)) == free
    # A board before everything from the neck upwards.
    board = box((0.0, 1.85, -1.2), (4.0, 1.1, 0.02), (0, 0, 0))
    covered = looked_at(box_person(), outlook(camera, 96, occluders=[board]), root, turns)
    assert not covered[0]
    assert covered[1]
    assert not covered[2][1]
    assert covered[2][0]


def test_single_moment_is_refused():
    clip = clip_of(WAVE)
    one = seen(clip, unit(np.ones(3)))
    with pytest.raises(MotionError, match="two or more"):
        wave_cues(clip.skeleton, SeenMotion(*(value[:1] for value in vars(one).values())))


def test_rule_of_zeros_is_refused():
    with pytest.raises(MotionError, match="above 0"):
        WaveRule(gaze_width_deg=0.0)
