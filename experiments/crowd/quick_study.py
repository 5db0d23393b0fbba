"""Simulate walks in memory, without session, wires or files: for calibration and power.

The walker is the one of a session, and what drives the bands is the same contact of arms; the
wire is without delay, tracking perfect, and the participant feels how much of every quarter
second an arm was in contact. `tests/experiments/crowd/test_quick_study.py` holds it to a session.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from visavis.analysis.gait import step_length_m
from visavis.experiments.crowd.design import DEFAULT_PARAMETERS, CrowdParameters
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.experiments.crowd.quick_measures import (
    Cell,
    QuickWalk,
    people_of_crowd,
    quick_measures,
)
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import Vector
from visavis.protocol.plan.questionnaires import Questionnaire, score
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.running.quick import answers_of
from visavis.stimuli.contact.body import ARM_JOINTS, capsule_body
from visavis.stimuli.contact.figures import crowd_figures
from visavis.stimuli.contact.touch import no_poses, rows_touching
from visavis.stimuli.scenes.station_crowd import (
    START_M,
    CrowdScene,
    can_read,
    station_crowd,
    station_frame,
)

STEP_NS: Final = 50 * NS_PER_MS
LOOK_NS: Final = 250 * NS_PER_MS
REST_NS: Final = 4 * NS_PER_S
BOTH_ARMS: Final = "arms"
_HEAD: Final = BODY_JOINTS.index("head")
_FLOOR: Final = [0, 2]


def quick_trials(
    participant: CrowdParticipant,
    questionnaires: Sequence[Questionnaire],
    params: CrowdParameters,
    plan: SessionPlan,
) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Perform a plan; yield every walk that counts with its measures and its block's ratings."""
    for block in block_walks(participant, plan, params):
        ratings: dict[str, Any] = {}
        for questions in questionnaires if block else ():
            ratings |= score(questions, answers_of(participant, questions))
        yield from ((trial, {**row, **ratings}) for trial, row, _ in block)


def block_walks(
    participant: CrowdParticipant, plan: SessionPlan, params: CrowdParameters
) -> Iterator[list[tuple[Trial, dict[str, Any], frozenset[Cell]]]]:
    """Yield the walks of every block with measures and cells; training is not measured."""
    step_m = step_length_m(participant.person.sex)
    now_ns = 0
    for block in plan.blocks:
        walks = []
        for trial in block.trials:
            walk = quick_walk(participant, trial, now_ns, params)
            now_ns += len(walk.t_s) * STEP_NS + REST_NS
            if not trial.is_practice:
                walks.append((trial, *quick_measures(walk, step_m)))
        yield walks


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
    last = no_poses(len(people))
    figures, arms = crowd_figures(), capsule_body(participant.person.stature_m, ARM_JOINTS)
    limit_ns = start_ns + round(params.limit_s * NS_PER_S)
    offsets = np.arange(0, LOOK_NS, STEP_NS)
    positions: list[Vector] = []
    turns: list[Vector] = []
    t_ns = start_ns
    n_touching = 0
    head = np.array(START_M)
    has_read = came_back = False
    # In steps of `LOOK_NS`: show the crowd, move, feel what touched in that time.
    while not came_back and t_ns < limit_ns:
        reads = can_read(*head.tolist())
        has_read |= reads
        track_read = "1" if reads else None
        participant.see(station_frame(scene, t_ns, t_ns - start_ns, track_read), t_ns)
        at, turn = participant.segments(BODY_JOINTS, t_ns + offsets)
        # The walk ends at the first step back within reach of the mark.
        if has_read:
            home_m = np.hypot(*(at[:, _HEAD][:, _FLOOR] - START_M).T)
            back = np.flatnonzero(home_m <= params.home_within_m)
            if back.size:
                came_back = True
                at, turn = at[: back[0] + 1], turn[: back[0] + 1]
        positions.append(at)
        turns.append(turn)
        head = at[-1, _HEAD, _FLOOR]
        if vibrates:
            n = rows_touching(
                at,
                turn,
                (t_ns - start_ns + offsets[: len(at)]) / NS_PER_S,
                arms.columns,
                arms.start_m,
                arms.end_m,
                arms.radius_m,
                people,
                last,
                figures,
            )
            n_touching += n
            participant.feel(BOTH_ARMS, [n / len(offsets)], t_ns + LOOK_NS - STEP_NS)
        t_ns += LOOK_NS
    if vibrates:
        participant.feel(BOTH_ARMS, [0.0], t_ns)
    position = np.concatenate(positions)
    return QuickWalk(
        crowd=crowd,
        t_s=np.arange(len(position), dtype=np.float64) * (STEP_NS / NS_PER_S),
        position_m=position,
        orientation_wxyz=np.concatenate(turns),
        stature_m=participant.person.stature_m,
        came_back=came_back,
        caution=participant.caution,
        touching_s=n_touching * STEP_NS / NS_PER_S,
    )
