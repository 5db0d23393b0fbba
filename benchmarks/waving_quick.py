"""Simulate studies in memory, without session, wires or files: for calibration and power.

People, judgements and measures are those of a session; only the head stands still where a
customer's head is supposed, so that every wave has to be rendered once.
`tests/experiments/waving/test_session.py` holds it to a session.
"""

from collections.abc import Mapping
from functools import cache
from itertools import product
from typing import Any, Final

import pandas as pd

from experiments.waving.clips import (
    DEFAULT_MAKING,
    KEPT_AS,
    TECHNIQUES,
    Making,
    study_wave,
)
from experiments.waving.judgement import DEFAULT_POPULATION, Population, judge
from experiments.waving.participant import TRIAL_STREAM, WavingParticipant
from experiments.waving.perception import (
    CUE_PARTS,
    LOOKS,
    PIXELS_PER_DEG,
    REACH_PARTS,
    REACH_PX,
    Evidence,
    evidence_of,
)
from experiments.waving.scene import office_eyes, scene_of
from experiments.waving.study import CLERK_NAMES, DIRECTIONS, PLACES, making_of, study
from lab.clock import NS_PER_S
from lab.geometry import Vector
from lab.kept import digest_of, keep, read_kept
from stimuli.dressing.office import PARTS as ROLES
from stimuli.dressing.office import roles_of
from stimuli.dressing.office_view import body_mesh, eye_at, seen_body_of
from stimuli.rooms.office import office
from stimuli.scenes.office import (
    CLERKS,
    CUSTOMERS,
    PARTICIPANT_PLACES,
    Waving,
    neighbour,
    shift_m,
)
from visavis.analysis import StudyAnalysis
from visavis.experiment import StudyExperiment
from visavis.opened import OpenedStudy

STIMULI: Final = tuple(product(TECHNIQUES, DIRECTIONS, CLERK_NAMES, PARTICIPANT_PLACES))
"""The 54 situations of the study: technique, direction, clerk, participant's place."""


def gaze_of(waving: Waving, participant_place: str, target_place: str) -> Vector:
    """Return where the waving clerk's eyes point (3,), at a participant who stands still."""
    scene = scene_of(participant_place, waving)
    eyes = office_eyes(scene, target_place, 0, 1.0, 0.0)
    standing = eye_at(participant_place) + shift_m(participant_place)
    gaze, _, _ = eyes.at(10 * NS_PER_S, standing)
    pointing: Vector = gaze[roles_of(participant_place).index(waving.clerk)]
    return pointing


@cache
def surroundings_sha256() -> str:
    """Return the hash of everything that decides what can be seen of a given wave."""
    meshes = [p.mesh for p in office().props] + [body_mesh(role) for role in ROLES]
    bodies = [seen_body_of(c.name) for c in CLERKS]
    return digest_of(
        *(m.vertices_m for m in meshes),
        *(b.rest for b in bodies),
        *(eye_at(c.name) for c in CUSTOMERS),
        said="|".join(map(str, (PIXELS_PER_DEG, LOOKS, REACH_PX, CUE_PARTS, REACH_PARTS))),
    )


@cache
def evidence_for(stimulus: tuple[str, str, str, str], making: Making = DEFAULT_MAKING) -> Evidence:
    """Return what a customer who stands still sees of a wave; rendered once on a computer."""
    technique, direction, clerk, place = stimulus
    target = neighbour(place, direction).name
    wave = study_wave(clerk, target, technique, making)
    key = digest_of(said="|".join((wave.sha256, clerk, target, place, surroundings_sha256())))
    kept = read_kept(KEPT_AS, key)
    if kept is not None:
        return Evidence(**kept)
    gaze = gaze_of(wave.waving, place, target)
    found = evidence_of(wave.waving, place, eye_at(place), gaze)
    keep(KEPT_AS, key, vars(found))
    return found


def quick_session(
    experiment: StudyExperiment, index: int, seed: int, *, effect: bool = True,
    population: Population = DEFAULT_POPULATION,
) -> list[dict[str, Any]]:  # fmt: skip
    """Return the rows of one participant's trials, practice left out."""
    person = WavingParticipant(index, seed, effect, population=population)
    making = making_of(experiment.parameters)
    rows = []
    for trial in experiment.plan(index, seed).trials:
        if trial.is_practice:
            continue
        f = {name: str(value) for name, value in trial.factors.items()}
        stimulus = (f["technique"], f["direction"], f["clerk"], f["participant_place"])
        judgement = judge(
            evidence_for(stimulus, making), PLACES.index(f["participant_place"]), person.person,
            population, person.rng(TRIAL_STREAM, trial.number), effect=effect,
        )  # fmt: skip
        who = PLACES[judgement.place]
        rows.append({
            "participant": f"{index:02d}", "trial_id": trial.trial_id, **f, "who": who,
            "is_right": who == f["target_place"], "realism": judgement.realism,
            "who_ms": 1000.0 * judgement.who_s, "realism_ms": 1000.0 * judgement.realism_s,
            "is_practice": False, "status": "complete", "session": 1, "attempt": 1,
            "is_simulated": True,
        })  # fmt: skip
    return rows


def quick_study(
    participants: int, seed: int, *, effect: bool = True,
    population: Population = DEFAULT_POPULATION, parameters: Mapping[str, Any] | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Simulate a study; one row per trial, as a session's measures have them."""
    experiment = OpenedStudy(study).experiment(parameters or {})
    people = range(participants)
    return pd.DataFrame([
        row
        for i in people
        for row in quick_session(experiment, i, seed, effect=effect, population=population)
    ])  # fmt: skip


def quick_analysis(
    trials: pd.DataFrame, parameters: Mapping[str, Any] | None = None
) -> StudyAnalysis:
    """Analyse trials of `quick_study` as those of sessions are."""
    opened = OpenedStudy(study)
    planned = trials.groupby("participant").size()
    return opened.analysis_of_rows(
        opened.experiment(parameters or {}), trials, trials[["participant"]].drop_duplicates(),
        planned={str(name): int(n) for name, n in planned.items()},
    )  # fmt: skip
