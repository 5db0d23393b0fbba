"""Simulate studies in memory, without session, wires or files: for calibration and power.

People, judgements and measures are those of a session; only the head stands still where a
customer's head is supposed, so that every wave has to be rendered once.
`tests/experiments/waving/test_session.py` holds it to a session.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final

import pandas as pd

from experiments.waving.clips import digest_of, eye_at, keep, read_kept, study_wave
from experiments.waving.design import (
    DEFAULT_PARAMETERS,
    DIRECTIONS,
    TECHNIQUES,
    WavingParameters,
    plan_session,
)
from experiments.waving.judgement import DEFAULT_POPULATION, Population, judge
from experiments.waving.participant import TRIAL_STREAM, WavingParticipant
from experiments.waving.perception import Evidence, evidence_of, surroundings_sha256
from experiments.waving.scene import gaze_of
from stimuli.scenes.office import CLERKS, CUSTOMERS, PARTICIPANT_PLACES, neighbour

PLACES: Final = tuple(c.name for c in CUSTOMERS)
Stimulus = tuple[str, str, str, str]
"""Technique, direction, clerk, participant's place."""


def stimuli() -> tuple[Stimulus, ...]:
    """Return the 54 situations of the study."""
    return tuple(
        (technique, direction, clerk.name, place)
        for technique in TECHNIQUES
        for direction in DIRECTIONS
        for clerk in CLERKS
        for place in PARTICIPANT_PLACES
    )


@cache
def evidence_for(stimulus: Stimulus, params: WavingParameters = DEFAULT_PARAMETERS) -> Evidence:
    """Return what a customer who stands still sees of a wave; rendered once on a computer."""
    technique, direction, clerk, place = stimulus
    target = neighbour(place, direction).name
    wave = study_wave(clerk, target, technique, params)
    key = digest_of(said="|".join((wave.sha256, clerk, target, place, surroundings_sha256())))
    kept = read_kept(key)
    if kept is not None:
        return Evidence(**kept)
    gaze = gaze_of(wave.waving, place, target)
    found = evidence_of(wave.waving, place, eye_at(place), gaze)
    keep(key, vars(found))
    return found


def quick_session(
    index: int, seed: int, *, effect: bool = True, population: Population = DEFAULT_POPULATION,
    params: WavingParameters = DEFAULT_PARAMETERS,
) -> list[dict[str, Any]]:  # fmt: skip
    """Return the rows of one participant's 54 trials."""
    person = WavingParticipant(index, seed, effect, population=population)
    rows = []
    for trial in plan_session(index, seed, params=params).trials:
        if trial.is_practice:
            continue
        f = {name: str(value) for name, value in trial.factors.items()}
        stimulus = (f["technique"], f["direction"], f["clerk"], f["participant_place"])
        judgement = judge(
            evidence_for(stimulus, params), PLACES.index(f["participant_place"]), person.person,
            population, person.rng(TRIAL_STREAM, trial.number), effect=effect,
        )  # fmt: skip
        who = PLACES[judgement.place]
        rows.append({
            "participant": f"{index:02d}", "trial_id": trial.trial_id, **f, "who": who,
            "is_right": who == f["target_place"], "realism": judgement.realism,
            "who_ms": 1000.0 * judgement.who_s, "realism_ms": 1000.0 * judgement.realism_s,
            "is_practice": False, "status": "complete",
        })  # fmt: skip
    return rows


def quick_study(
    participants: int, seed: int, *, effect: bool = True,
    population: Population = DEFAULT_POPULATION, params: WavingParameters = DEFAULT_PARAMETERS,
    on_participant: Callable[[int], None] | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Simulate a study; one row per trial, as a session's measures have them."""
    rows: list[dict[str, Any]] = []
    for index in range(participants):
        rows += quick_session(index, seed, effect=effect, population=population, params=params)
        if on_participant is not None:
            on_participant(index)
    return pd.DataFrame(rows)
