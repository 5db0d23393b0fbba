"""Who sits where, and what their eyes do, in one trial of the stare study."""

import numpy as np

from visavis.analysis.report.notation import decimal
from visavis.experiments.stare.design import AVERTED, AVERTED_THEN_DIRECTED
from visavis.protocol.plan.session_plan import Trial
from visavis.stimuli.gaze.behaviour import EyeBehaviour
from visavis.stimuli.gaze.blinks import draw_blinks
from visavis.stimuli.scene import Scene
from visavis.stimuli.scenes.audience import (
    PARTICIPANT_EYE_M,
    PLACES,
    SEATS,
    SPEAKER_EYE_M,
    audience_scene,
    black_scene,
    training_scene,
)

CHARACTERS: tuple[str, ...] = (
    *(f"female_{i:02d}" for i in range(1, 7)),
    *(f"male_{i:02d}" for i in range(1, 6)),
)
"""The eleven models of the audience, six women and five men; smaller audiences draw from them."""

_SHUFFLE, _BLINKS = range(2)


def characters_of(trial: Trial, agents: int = len(CHARACTERS)) -> tuple[str, ...]:
    """Return the model at each of the first places, shuffled anew for every trial by its seed."""
    characters = [CHARACTERS[i] for i in trial.rng(_SHUFFLE).permutation(len(CHARACTERS))]
    return tuple(characters[:agents])


def scene_of(trial: Trial, agents: int = len(CHARACTERS)) -> Scene:
    """Return the lit scene of a trial."""
    characters = characters_of(trial, agents)
    return training_scene(characters) if trial.is_practice else audience_scene(characters)


def dark_scene_of(trial: Trial, agents: int = len(CHARACTERS)) -> Scene:
    """Return the dark scene before a trial, with the mark."""
    return black_scene(characters_of(trial, agents))


def active_index_of(trial: Trial) -> int:
    """Return the index of the active agent; in condition A it is drawn but behaves like all."""
    return PLACES.index(str(trial.factors["place"]))


def opening_eyes(trial: Trial, scene: Scene, duration_s: float) -> EyeBehaviour:
    """Return what all eyes do from the trial's start until a gaze change, times from the start.

    Everyone looks at the speaker, but for the active agent of D and DA, who looks at the
    participant. In practice nobody does.
    """
    blinks = draw_blinks(trial.rng(_BLINKS), len(scene.agents), duration_s)
    eyes = EyeBehaviour.of_scene(scene, target_m=SPEAKER_EYE_M, blinks=blinks)
    if trial.is_practice or trial.factors["condition"] in (AVERTED, AVERTED_THEN_DIRECTED):
        return eyes
    return eyes.staring(active_index_of(trial))


def distances() -> str:
    """Return how far the heads are, in words."""
    eye_height_m = float(PARTICIPANT_EYE_M[1])
    far = [float(np.hypot(s.distance_m, s.head_height_m - eye_height_m)) for s in SEATS.values()]
    return (
        f"agents' heads {decimal(min(far), 1)} to {decimal(max(far), 1)} m from the eyes "
        "(seating plan)"
    )
