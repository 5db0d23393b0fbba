"""Speakers: what is planted is learnt again; bodies follow their scripts on planted feet."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stimuli.motion.speaking.test_gesturing import CANONICAL
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip, placed_joints
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward
from visavis.stimuli.motion.speaking.body_plan import (
    Fill,
    Turn,
    plan_body,
    sample_postures,
    trunk_of,
)
from visavis.stimuli.motion.speaking.body_track import RATE_HZ, YAW, centre_of_mass, measure_body
from visavis.stimuli.motion.speaking.gesture_script import GesturePhrase, GestureScript
from visavis.stimuli.motion.speaking.gesturing import gesture_arms
from visavis.stimuli.motion.speaking.performance import perform
from visavis.stimuli.motion.speaking.speaker import Speaker, Take, com_class, yaw_class
from visavis.stimuli.motion.speaking.synthetic_speaker import (
    Planted,
    synthetic_speaker,
    synthetic_take,
)
from visavis.stimuli.motion.synthesis.phrase_posture import Habits, Phrase

MINUTES = 4.0


@pytest.fixture(scope="module")
def learnt() -> tuple[Speaker, Planted]:
    return synthetic_speaker(3, MINUTES)


@pytest.fixture(scope="module")
def script() -> GestureScript:
    return synthetic_take(9, 0.5)[1]


def test_the_centre_of_mass_of_somebody_upright_is_in_the_middle() -> None:
    skeleton = canonical_skeleton()
    turns = np.zeros((1, len(skeleton.names), 4))
    turns[..., 0] = 1.0
    at = centre_of_mass(skeleton, forward(skeleton, np.zeros((1, 3)), turns))[0]
    assert at[0] == pytest.approx(0.0, abs=1e-12)
    # A little above the hips (Winter: .56 of stature above the floor with arms at the side; arms
    # that are spread raise it).
    floor = skeleton.rest_m[:, 1].min() - 0.01
    assert 0.55 < (at[1] - floor) / 1.75 < 0.62


@pytest.mark.parametrize(
    ("com", "yaw_deg", "classes"),
    [
        (0.149, 7.9, ("centre", "front")),
        (0.151, 8.1, ("right", "left")),
        (-0.151, -8.1, ("left", "right")),
    ],
)
def test_classes_begin_where_they_are_defined(
    com: float, yaw_deg: float, classes: tuple[str, str]
) -> None:
    assert (com_class(com), yaw_class(float(np.radians(yaw_deg)))) == classes


def test_planted_postures_are_found_at_the_end_of_every_phrase(
    learnt: tuple[Speaker, Planted],
) -> None:
    speaker, planted = learnt
    assert speaker.postures == planted.postures


def test_planted_delays_are_found(learnt: tuple[Speaker, Planted]) -> None:
    speaker, planted = learnt
    assert speaker.com_delay.mean_s == pytest.approx(planted.com_after_s, abs=0.03)
    assert speaker.yaw_delay.mean_s == pytest.approx(-planted.yaw_before_s, abs=0.03)
    assert speaker.trunk_delay.mean_s == pytest.approx(planted.trunk_after_s, abs=0.03)


def test_a_phrase_beyond_its_recording_is_named(learnt: tuple[Speaker, Planted]) -> None:
    take = learnt[0].takes[0]
    late = replace(take.script.phrases[-1], end_s=60 * MINUTES + 5)
    longer = replace(take.script, phrases=(*take.script.phrases[:-1], late))
    with pytest.raises(MotionError, match=r"synthetic: phrase \d+ ends at 245 s"):
        Speaker((Take(take.name, take.track, longer),))


def test_nothing_follows_across_recordings(learnt: tuple[Speaker, Planted]) -> None:
    take = learnt[0].takes[0]
    two = Speaker((take, Take("again", take.track, take.script)))
    for posture in ("left", "centre", "right"):
        assert two.habits.chain("com", posture) == pytest.approx(
            learnt[0].habits.chain("com", posture)
        )


def test_one_seed_gives_the_same_bytes_and_another_another_body(
    learnt: tuple[Speaker, Planted], script: GestureScript
) -> None:
    def bytes_of(seed: int) -> bytes:
        clip = perform(script, learnt[0], CANONICAL, fill="F", seed=seed)
        return clip.root_m.tobytes() + clip.orientation_wxyz.tobytes()

    assert bytes_of(1) == bytes_of(1) != bytes_of(2)


@pytest.mark.parametrize("fill", ["F", "I"])
def test_planted_feet_do_not_move(
    learnt: tuple[Speaker, Planted], script: GestureScript, fill: str
) -> None:
    clip = perform(script, learnt[0], CANONICAL, fill=fill, seed=1)  # type: ignore[arg-type]
    for joint in ("left_foot", "right_foot", "left_toes", "right_toes"):
        at = placed_joints(clip, clip.frame_times_s).position_m[:, CANONICAL.skeleton.index(joint)]
        assert 1000 * np.ptp(at, axis=0).max() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("fill", ["F", "I"])
def test_phrases_end_in_the_postures_that_were_drawn(
    learnt: tuple[Speaker, Planted], script: GestureScript, fill: str
) -> None:
    plan = plan_body(learnt[0], script, fill, 4)  # type: ignore[arg-type]
    clip = perform(script, learnt[0], CANONICAL, fill=fill, seed=4)  # type: ignore[arg-type]
    track = measure_body(clip, "performed")
    rows = [round(p.end_s * RATE_HZ) for p in script.phrases]
    reached = [(com_class(track.com[r]), yaw_class(track.yaw[r])) for r in rows]
    alike = np.mean([a == b for a, b in zip(reached, plan.postures, strict=True)])
    assert alike >= 0.9


def jumps(speaker: Speaker, hips: Vector, junctions: tuple[int, ...]) -> Vector:
    speed = np.diff(hips[:, [0, YAW]], axis=0) * RATE_HZ / speaker.scale / speaker.fast
    return np.array(
        [np.abs(np.diff(speed[max(0, k - 2) : k + 1], axis=0)).max() for k in junctions]
    )


@pytest.mark.parametrize("fill", ["F", "I"])
def test_velocity_hardly_jumps_wherever_pieces_meet(
    learnt: tuple[Speaker, Planted], script: GestureScript, fill: Fill
) -> None:
    plans = [plan_body(learnt[0], script, fill, seed) for seed in range(8)]
    assert 1.2 >= max(jumps(learnt[0], plan.hips, plan.junctions).max() for plan in plans)


def test_without_a_body_nothing_below_the_arms_moves(
    learnt: tuple[Speaker, Planted], script: GestureScript
) -> None:
    plan = plan_body(learnt[0], script, "none", 1)
    assert np.ptp(plan.hips, axis=0).max() == 0.0
    assert plan.turns == ()


def test_without_rules_postures_follow_the_chain_alone(
    learnt: tuple[Speaker, Planted], script: GestureScript
) -> None:
    chain = replace(learnt[0], beta=0.0)
    script = replace(script, phrases=script.phrases[:1])
    followers = [sample_postures(chain, script, np.random.default_rng(k))[0][1] for k in range(200)]
    share = [followers.count(c) / 200 for c in ("left", "front", "right")]
    assert share == pytest.approx(chain.habits.chain("yaw", "front").tolist(), abs=0.1)


def test_somebody_who_listens_shifts_and_moves_no_arm(
    learnt: tuple[Speaker, Planted], script: GestureScript
) -> None:
    silent = [replace(p, hand="none", lexeme="") for p in script.phrases]
    listening = replace(script, phrases=tuple(silent))
    clip = perform(listening, learnt[0], CANONICAL, fill="F", seed=4)
    track = measure_body(clip, "listens")
    rows = [round(p.end_s * RATE_HZ) for p in script.phrases]
    reached = [(com_class(track.com[r]), yaw_class(track.yaw[r])) for r in rows]
    drawn = plan_body(learnt[0], listening, "F", 4).postures
    assert np.mean([a == b for a, b in zip(reached, drawn, strict=True)]) >= 0.9
    assert len(set(drawn)) > 3
    arms = gesture_arms(listening, clip.frame_times_s, CANONICAL.lengths_m, 4)
    assert np.ptp(arms) == 0.0


def test_one_speakers_habits_move_anothers_body(
    learnt: tuple[Speaker, Planted], script: GestureScript
) -> None:
    own, _ = synthetic_speaker(3, 0.5)
    other = replace(own, model=learnt[0])
    assert other.habits is learnt[0].habits
    assert other.takes is own.takes
    stays = replace(learnt[0])
    vars(stays)["habits"] = Habits((Phrase("RH", "cup", "centre", "front"),) * 9, 0.0)
    postures = sample_postures(replace(own, model=stays), script, np.random.default_rng(1))
    assert {("centre", "front")} == set(postures)


def test_the_spine_turns_smoothly_and_stays() -> None:
    phrase = GesturePhrase(1.0, 1.5, 2.0, 2.2, 3.0, "R", "cup")
    turns = plan_of_turns(phrase)
    t_s = np.array([0.0, 1.0, 1.5, 2.0, 5.0])
    assert trunk_of(turns, t_s) == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.2])


def plan_of_turns(phrase: GesturePhrase) -> tuple[Turn, ...]:
    return (Turn(phrase.start_s, phrase.stroke_end_s, 0.2),)


def test_a_corpus_without_a_posture_to_go_to_is_refused(script: GestureScript) -> None:
    clip, own, _ = synthetic_take(3, 0.2)
    one = Speaker(
        (Take("short", measure_body(clip, "short"), replace(own, phrases=own.phrases[:1])),)
    )
    with pytest.raises(DataError, match="annotate more speech"):
        plan_body(one, script, "F", 1)


def test_somebody_who_does_not_stand_is_refused() -> None:
    skeleton = canonical_skeleton()
    turns = np.zeros((60, len(skeleton.names), 4))
    turns[..., 0] = 1.0
    clip = Clip(skeleton, 1 / 30, 100 * np.ones((60, 3)), turns)
    big = replace(skeleton, offsets_m=100 * skeleton.offsets_m)
    with pytest.raises(MotionError, match=r"feet are 18.* m apart"):
        measure_body(replace(clip, skeleton=big), "take")
