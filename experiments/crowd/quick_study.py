"""Simulate walks in memory, without session, wires or files: for calibration and power.

The walker, the contact rule that drives the bands and the measures are those of a session; the
wire is a fixed delay, the motor follows without lag, tracking is perfect, and collisions are
measured on capsules. `tests/experiments/crowd/test_quick_study.py` holds it to a session.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from analysis.gait import step_length_m
from experiments.crowd.design import DEFAULT_PARAMETERS, HAPTIC, CrowdParameters, plan_session
from experiments.crowd.haptics import MOTORS, ContactAnswer
from experiments.crowd.measures import MeasuredWalk, MeasureParameters, measure_walk
from experiments.crowd.participant.participant import CrowdParticipant
from experiments.crowd.participant.traits import DEFAULT_POPULATION, Population
from experiments.crowd.replay import STEP_NS, Walk
from experiments.crowd.trial import track_of
from lab.clock import NS_PER_MS, NS_PER_S
from protocol.plan import Trial
from stimuli.contact.body import BODY_JOINTS
from stimuli.scenes.station_crowd import CrowdFrame, CrowdScene, can_read, station_crowd

LINK_NS: Final = 15 * NS_PER_MS
"""From the sample to the motor: two frames' worth less than the published quarter second."""
LOOK_NS: Final = 100 * NS_PER_MS
QUICK_MEASURES: Final = MeasureParameters(surface="capsules")
_NO_GAZE = np.empty((0, 3))


@dataclass(frozen=True)
class QuickStudy:
    """One simulated study: `trials` one row per walk, `cells` the cells visited per walk."""

    trials: pd.DataFrame
    cells: list[tuple[tuple[int, int, int] | None, ...]]


def quick_study(
    participants: int,
    seed: int,
    *,
    effect: bool = True,
    population: Population = DEFAULT_POPULATION,
    params: CrowdParameters = DEFAULT_PARAMETERS,
    on_participant: Callable[[int], None] | None = None,
) -> QuickStudy:
    """Simulate and measure a study; `effect=False` disconnects the vibration."""
    rows: list[dict[str, Any]] = []
    cells = []
    for index in range(participants):
        for measured in quick_session(
            index, seed, effect=effect, population=population, params=params
        ):
            rows.append(measured.row)
            cells.append(measured.cells)
        if on_participant is not None:
            on_participant(index)
    return QuickStudy(pd.DataFrame(rows), cells)


def quick_session(
    index: int,
    seed: int,
    *,
    effect: bool = True,
    population: Population = DEFAULT_POPULATION,
    params: CrowdParameters = DEFAULT_PARAMETERS,
    step_ns: int = STEP_NS,
) -> list[MeasuredWalk]:
    """Simulate and measure the walks of one participant."""
    participant = CrowdParticipant(index, seed, effect, population=population)
    step_m = step_length_m(participant.person.sex)
    plan = plan_session(index, seed, params=params)
    measured = []
    now_ns = 0
    for trial in plan.trials:
        walk = quick_walk(participant, trial, now_ns, params, step_ns)
        now_ns = int(walk.t_ns[-1]) + 4 * NS_PER_S
        if not trial.is_practice:
            one = measure_walk(walk, step_m, QUICK_MEASURES)
            one.row["participant"] = index
            measured.append(one)
    return measured


def quick_walk(
    participant: CrowdParticipant,
    trial: Trial,
    start_ns: int,
    params: CrowdParameters = DEFAULT_PARAMETERS,
    step_ns: int = STEP_NS,
) -> Walk:
    """Let a participant walk through one trial's crowd and return the walk."""
    crowd = station_crowd(int(trial.factors["configuration"]))
    scene = CrowdScene("quick", agents=(), crowd=crowd)
    stretch = trial.number + (100_000 if trial.is_practice else 0)
    participant.prepare(stretch, start_ns)
    track = track_of(trial)
    vibrates = trial.factors["condition"] == HAPTIC and bool(trial.factors["vibrates"])
    contacts = ContactAnswer(
        crowd,
        BODY_JOINTS,
        params.vibration,
        nearest_motor=params.nearest_motor,
        update_hz=params.haptic_update_hz,
    )
    limit_ns = start_ns + round(params.limit_s * NS_PER_S)
    t_ns = start_ns
    is_fitted = False
    while not participant.is_home and t_ns < limit_ns:
        x, _, z = participant.head(t_ns)[0].tolist()
        seen = track if can_read(x, z) else None
        view = CrowdFrame(
            scene, t_ns, _NO_GAZE, _NO_GAZE[:, 0], crowd_t_ns=t_ns - start_ns, track=seen
        )
        participant.see(view, t_ns)
        if not vibrates:
            t_ns += LOOK_NS
            continue
        for sample_ns in range(t_ns, t_ns + LOOK_NS, STEP_NS):
            at, turn = participant.segments(BODY_JOINTS, np.array([sample_ns]))
            if not is_fitted:
                contacts.fit(at[0])
                is_fitted = True
            orders = contacts.sample(sample_ns, (sample_ns - start_ns) / NS_PER_S, at[0], turn[0])
            for order in orders:
                strength = 0.0 if order.kind == "end" else 1.0
                participant.feel(order.role, [strength] * len(MOTORS), sample_ns + LINK_NS)
        t_ns += LOOK_NS
    grid = np.arange(start_ns, t_ns, step_ns, dtype=np.int64)
    position, orientation = participant.segments(BODY_JOINTS, grid)
    row = {
        "trial_id": trial.trial_id,
        "number": trial.number,
        **trial.factors,
        "t_start_ns": start_ns,
        "came_back": participant.is_home,
        "caution": participant.caution,
    }
    return Walk(
        trial.trial_id, row, crowd, grid, position, orientation, participant.person.stature_m
    )


def block_means(trials: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """Return means over participants of their block means, one row per condition."""
    per_person = trials.groupby(["condition", "participant"])[list(measures)].mean()
    means: pd.DataFrame = per_person.groupby("condition").mean()
    return means
