"""Simulate walks in memory, without session, wires or files: for calibration and power.

The walker is the one of a session, and what drives the bands is the same contact of arms; the
wire is without delay, tracking perfect, and the participant feels how much of every quarter
second an arm was in contact. `tests/experiments/crowd/test_quick_study.py` holds it to a session.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from analysis.gait import step_length_m
from experiments.crowd.design import DEFAULT_PARAMETERS, CrowdParameters
from experiments.crowd.participant.participant import CrowdParticipant
from experiments.crowd.participant.traits import DEFAULT_POPULATION, Population
from experiments.crowd.quick_measures import (
    Cell,
    QuickWalk,
    people_of_crowd,
    quick_measures,
)
from experiments.crowd.study import study
from lab.clock import NS_PER_MS, NS_PER_S
from lab.geometry import Vector
from protocol.plan import Trial
from stimuli.contact.body import ARM_JOINTS, BODY_JOINTS, capsule_body
from stimuli.contact.figures import crowd_figures
from stimuli.contact.touch import REACH_M, rows_touching
from stimuli.scenes.station_crowd import CrowdFrame, CrowdScene, can_read, station_crowd
from visavis.experiment import StudyExperiment

STEP_NS: Final = 50 * NS_PER_MS
LOOK_NS: Final = 250 * NS_PER_MS
REST_NS: Final = 4 * NS_PER_S
FELT: Final = "arms"
_NO_GAZE = np.empty((0, 3))


@dataclass(frozen=True)
class QuickStudy:
    """One simulated study: `trials` one row per walk; `cells` the cells each walk visited."""

    trials: pd.DataFrame
    cells: list[frozenset[Cell]]


def quick_study(
    participants: int,
    seed: int,
    *,
    effect: bool = True,
    population: Population = DEFAULT_POPULATION,
    parameters: Mapping[str, Any] = MappingProxyType({}),
    on_participant: Callable[[int], None] | None = None,
) -> QuickStudy:
    """Simulate and measure a study; `effect=False` disconnects the vibration."""
    rows: list[dict[str, Any]] = []
    cells: list[frozenset[Cell]] = []
    for index in range(participants):
        for row, visited in quick_session(
            index, seed, effect=effect, population=population, parameters=parameters
        ):
            rows.append(row)
            cells.append(visited)
        if on_participant is not None:
            on_participant(index)
    return QuickStudy(pd.DataFrame(rows), cells)


def quick_session(
    index: int,
    seed: int,
    *,
    effect: bool = True,
    population: Population = DEFAULT_POPULATION,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> list[tuple[dict[str, Any], frozenset[Cell]]]:
    """Simulate and measure the walks of one participant; training is walked, not measured."""
    participant = CrowdParticipant(index, seed, effect, population=population)
    step_m = step_length_m(participant.person.sex)
    experiment = StudyExperiment(study, parameters)
    plan, params = experiment.plan(index, seed), CrowdParameters.of(experiment.parameters)
    measured = []
    now_ns = 0
    for trial in plan.trials:
        walk = quick_walk(participant, trial, now_ns, params)
        now_ns += len(walk.t_s) * STEP_NS + REST_NS
        if trial.is_practice:
            continue
        row, cells = quick_measures(walk, step_m)
        which = {"participant": index, "group": plan.group, "trial_id": trial.trial_id}
        measured.append(({**which, **trial.factors, **row}, cells))
    return measured


def quick_walk(
    participant: CrowdParticipant,
    trial: Trial,
    start_ns: int,
    params: CrowdParameters = DEFAULT_PARAMETERS,
) -> QuickWalk:
    """Let a participant walk through one trial's crowd."""
    configuration = int(trial.factors["configuration"])
    crowd = station_crowd(configuration, params.density_per_m2)
    scene = CrowdScene("quick", agents=(), crowd=crowd)
    participant.prepare(trial.number + (100_000 if trial.is_practice else 0), start_ns)
    vibrates = bool(trial.factors["vibrates"])
    people = people_of_crowd(crowd)
    figures, arms = crowd_figures(), capsule_body(participant.person.stature_m, ARM_JOINTS)
    limit_ns = start_ns + round(params.limit_s * NS_PER_S)
    offsets = np.arange(0, LOOK_NS, STEP_NS)
    positions: list[Vector] = []
    turns: list[Vector] = []
    t_ns = start_ns
    touched = 0
    x, z = 0.0, 0.0
    while not participant.is_home and t_ns < limit_ns:
        seen = "1" if positions and can_read(x, z) else None
        participant.see(
            CrowdFrame(
                scene, t_ns, _NO_GAZE, _NO_GAZE[:, 0], crowd_t_ns=t_ns - start_ns, track=seen
            ),
            t_ns,
        )
        at, turn = participant.segments(BODY_JOINTS, t_ns + offsets)
        positions.append(at)
        turns.append(turn)
        x, _, z = at[-1, 0].tolist()
        if vibrates:
            n = rows_touching(
                at,
                turn,
                (t_ns - start_ns + offsets) / NS_PER_S,
                arms.columns,
                arms.start_m,
                arms.end_m,
                arms.radius_m,
                people,
                REACH_M,
                figures,
            )
            touched += n
            participant.feel(FELT, [n / len(offsets)], t_ns + LOOK_NS - STEP_NS)
        t_ns += LOOK_NS
    if vibrates:
        participant.feel(FELT, [0.0], t_ns)
    position = np.concatenate(positions)
    return QuickWalk(
        crowd=crowd,
        t_s=np.arange(len(position), dtype=np.float64) * (STEP_NS / NS_PER_S),
        position_m=position,
        orientation_wxyz=np.concatenate(turns),
        stature_m=participant.person.stature_m,
        came_back=participant.is_home,
        caution=participant.caution,
        touching_s=touched * STEP_NS / NS_PER_S,
    )


def block_means(trials: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """Return means over participants of their block means, one row per condition."""
    per_person = trials.groupby(["condition", "participant"])[list(measures)].mean()
    means: pd.DataFrame = per_person.groupby("condition").mean()
    return means
