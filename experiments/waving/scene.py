"""Who stands where in a trial of the waving study, who waves, and where everybody looks."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

import numpy as np

from experiments.waving.clips import Making, StudyWave, study_wave
from lab.chance import generator
from lab.clock import NS_PER_S
from stimuli.dressing.office import agents_of
from stimuli.gaze.behaviour import EyeBehaviour
from stimuli.gaze.blinks import draw_blinks
from stimuli.scene import Agent
from stimuli.scenes.office import (
    CLERKS,
    STANDING_EYE_M,
    OfficeScene,
    Waving,
    place,
    shift_m,
)
from visavis.scenes import places

SCENE_SEED: Final = 7
"""Of what everybody does beside the wave: the same in all trials."""
SCREEN_FROM_CLERK_M: Final = (-0.52, 0.95, 0.57)


def wave_of(factors: Mapping[str, Any], making: Making, eye_height_m: float) -> StudyWave:
    """Return the wave of a trial; one at the participant is made for their planned eye height."""
    is_own = factors["target_place"] == factors["participant_place"]
    return study_wave(
        str(factors["clerk"]),
        str(factors["target_place"]),
        str(factors["technique"]),
        making,
        eye_height_m if is_own else STANDING_EYE_M,
    )


def scene_of(participant_place: str, waving: Waving | None) -> OfficeScene:
    """Return the office of a trial, seen from the participant's place."""
    return OfficeScene(
        name=f"office_{participant_place}",
        agents=agents_in(participant_place, waving),
        participant_place=participant_place,
        waving=waving,
        seed=SCENE_SEED,
    )


@lru_cache(maxsize=128)
def agents_in(participant_place: str, waving: Waving | None) -> tuple[Agent, ...]:
    """Return everybody as agents, with heads where they are in the middle of the wave."""
    middle_s = 0.0 if waving is None else (waving.start_s + waving.end_s) / 2
    return agents_of(participant_place, waving, SCENE_SEED, middle_s)


def office_eyes(
    scene: OfficeScene, target_place: str, seed: int, duration_s: float, wave_s: float
) -> EyeBehaviour:
    """Return what all eyes do, times from the onset, the same for both techniques.

    Clerks look at their screens, others before them; the waving clerk turns the eyes to the
    addressee `wave_s` after the onset: to the participant wherever they are, or to the eyes of a
    customer.
    """
    by = shift_m(scene.participant_place)
    blinks = draw_blinks(generator(seed, 1), len(scene.agents), duration_s)
    eyes = EyeBehaviour.of_scene(scene, target_m=np.zeros(3), blinks=blinks)
    targets = eyes.targets_m.copy()
    for i, agent in enumerate(scene.agents):
        targets[:, i] = agent.eye_centre_m + 3.0 * agent.facing
        if agent.place in (c.name for c in CLERKS):
            targets[:, i] = place(agent.place).floor_m + by + np.array(SCREEN_FROM_CLERK_M)
    who = scene.waver
    if who is None:
        return replace(eyes, targets_m=targets)
    follows, turn_ns = eyes.follows_observer.copy(), eyes.turn_ns.copy()
    turn_ns[who] = round(wave_s * NS_PER_S)
    if target_place == scene.participant_place:
        follows[1, who] = True
    else:
        targets[1, who] = scene.agents[places(scene)[target_place]].eye_centre_m
    return replace(eyes, targets_m=targets, follows_observer=follows, turn_ns=turn_ns)
