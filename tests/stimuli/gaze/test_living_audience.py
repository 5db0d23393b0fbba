"""Eyes that stare meet, and whoever sits there lives: measured in the scene of the stare study."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.stimuli.gaze.lines import lines_of_gaze
from visavis.lab.geometry import Vector, angle_deg, rotate, unit
from visavis.stimuli.dressing.audience import audience_picture
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.dressing.gathering import gathering_picture
from visavis.stimuli.gaze.behaviour import EyeBehaviour
from visavis.stimuli.gaze.blinks import Blinks
from visavis.stimuli.motion.people import PeopleMotion
from visavis.stimuli.motion.seating import seated_under_eyes
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.rooms.audience_room import HIP_BEHIND_EYES_M, step_height_m
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M, SPEAKER_EYE_M, audience_scene
from visavis.study.scenes import Staging, WithEyes, two_people

NAMES = [f"{g}_{i:02d}" for g, n in (("female", 6), ("male", 5)) for i in range(1, n + 1)]
OBSERVER_M = PARTICIPANT_EYE_M + np.array([0.05, -0.02, 0.03])
STEP_NS = 50_000_000
NO_BLINKS = Blinks(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64))


def _seen(times_ns: range) -> tuple[Vector, Vector, Vector]:
    """Return eyes (t, 11, 2, 3), lines of gaze and shoulders of eleven who stare."""
    scene = audience_scene(NAMES)
    eyes = EyeBehaviour.of_scene(scene, target_m=SPEAKER_EYE_M, blinks=NO_BLINKS)
    for agent in range(len(NAMES)):
        eyes = eyes.staring(agent)
    shown = WithEyes(scene, {}, eyes, OBSERVER_M)
    centres, lines, shoulders = [], [], []
    for t_ns in times_ns:
        shown.look(eyes)  # so that every frame is a new one
        frame = shown.frame(SimpleNamespace(head_valid=False, t_ns=t_ns), t_ns)
        picture = audience_picture(frame)
        at, along = lines_of_gaze(picture)
        centres.append(at[:-1])
        lines.append(along[:-1])
        body = [
            forward(c.skeleton, picture.people.root_m[i], picture.people.orientation_wxyz[i])
            for i, c in enumerate(picture.cast[:-1])
        ]
        shoulders.append(
            [
                b.position_m[c.skeleton.index("left_upper_arm"), 1]
                - b.position_m[c.skeleton.index("upper_chest"), 1]
                for b, c in zip(body, picture.cast, strict=False)
            ]
        )
    return np.array(centres), np.array(lines), np.array(shoulders)


@pytest.fixture(scope="module")
def watched() -> tuple[Vector, Vector, Vector]:
    """Eyes (t, 11, 2, 3), lines of gaze and shoulders of eleven who stare for 16 s."""
    return _seen(range(0, 16_000_000_000, STEP_NS))


def test_both_staring_eyes_meet_the_observer_within_a_tenth_of_a_degree(watched):
    centres, lines, _ = watched
    off = lines - unit(OBSERVER_M - centres)

    assert 0.1 > np.degrees(np.linalg.norm(off.mean(axis=0), axis=-1)).max()
    # At every moment both miss alike: their lines meet in one point.
    assert 0.02 > np.degrees(np.linalg.norm(off[:, :, 0] - off[:, :, 1], axis=-1)).max()


def test_eyes_at_rest_meet_the_observer_at_every_moment_while_heads_sway(monkeypatch):
    """A gaze taken from where the study has the eyes would miss by the head's sway."""
    monkeypatch.setattr("visavis.stimuli.gaze.turning.fixation_rows", lambda *_: None)
    centres, lines, _ = _seen(range(0, 16_000_000_000, 10 * STEP_NS))

    assert 0.01 > angle_deg(lines, unit(OBSERVER_M - centres)).max()


def test_fixating_eyes_drift_and_jump_but_stay_within_half_a_degree(watched):
    centres, lines, _ = watched
    off_deg = angle_deg(lines, unit(OBSERVER_M - centres))

    assert 0.5 > off_deg.max()
    assert 0.03 < off_deg.std(axis=0).min()


@pytest.mark.parametrize("active", ["left", "right"])
def test_eyes_of_people_who_sit_together_meet_the_observer_too(active, monkeypatch):
    monkeypatch.setattr("visavis.stimuli.gaze.turning.fixation_rows", lambda *_: None)
    shown = two_people(Staging(np.random.default_rng(1), 2.0), active=active, eyes="directed")
    view = SimpleNamespace(
        head_valid=True, head=SimpleNamespace(position_m=OBSERVER_M), t_ns=STEP_NS
    )
    picture = gathering_picture(shown.frame(view, STEP_NS))
    centres, lines = lines_of_gaze(picture)
    who = shown.roles["active"]

    assert 0.1 > angle_deg(lines[who], unit(OBSERVER_M - centres[who])).max()


def test_the_gaze_never_rests_between_its_micro_saccades(watched):
    centres, lines, _ = watched
    off = lines - unit(OBSERVER_M - centres)
    steps_deg = np.degrees(np.linalg.norm(np.diff(off, axis=0), axis=-1))

    assert 0.001 < np.median(steps_deg, axis=0).min()
    # Some twenty jumps of each eye in 16 s, which pass from one frame of 50 ms to the next.
    assert 10 < (steps_deg > 0.05).sum(axis=0).min()


def test_heads_sway_by_millimetres(watched):
    centres, _, _ = watched
    head_m = centres.mean(axis=2)
    spread_m = np.linalg.norm(head_m.std(axis=0), axis=-1)

    assert 0.001 < spread_m.min()
    assert 0.005 > spread_m.max()


def test_shoulders_rise_and_fall_with_the_breath(watched):
    _, _, shoulders = watched

    assert 0.001 < np.ptp(shoulders, axis=0).min()


def test_nobody_of_the_cast_sits_on_tiptoe_wherever_they_are_seated():
    raised_deg = {}
    for i, agent in enumerate(audience_scene(NAMES).agents):
        floor_m = step_height_m(agent.eye_centre_m - HIP_BEHIND_EYES_M * agent.facing)
        for name in NAMES:
            build = build_of(default_casting(name))
            person = seated_under_eyes(
                build, agent.eye_centre_m, facing=agent.facing, seed=i, floor_m=floor_m
            )
            still = PeopleMotion((person,)).at(0.0)
            body = forward(build.skeleton, still.root_m[0], still.orientation_wxyz[0])
            feet = [build.skeleton.index(f"{side}_foot") for side in ("left", "right")]
            ahead = [rotate(body.orientation_wxyz[f], np.array([0.0, 0.0, -1.0])) for f in feet]
            raised_deg[agent.place, name] = float(np.degrees(-np.arcsin(np.min(ahead, axis=0)[1])))

    assert {} == {who: deg for who, deg in raised_deg.items() if deg > 15.0}
