"""Measure how long the walks of a whole crowd study take, posing and skinning included.

    python -m benchmarks.crowd_speed [--walks N] [--surface characters] [--json]

Walks are simulated in memory, then measured as recordings are: bodies of 15,000 triangles posed
every 10 ms, volumes, collisions, cells, gait. CPU time on one thread, as the machine may be busy;
one person (24 walks as long as those here) and the study (23 people, by walked seconds, on two
cores) are extrapolated. The floor of a person's walks poses everybody near at every step, compares
boxes and measures nothing. Ratio is limit / value: 1 or more is within the limit.
"""

import argparse
import sys
from collections.abc import Sequence
from typing import get_args

import numpy as np

from benchmarks.table import Row, show
from visavis.analysis.gait import resample
from visavis.experiments.crowd.collision_measures import volumes_or_nearness
from visavis.experiments.crowd.measures import MeasureParameters, measure_walk
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.experiments.crowd.quick_study import quick_walk
from visavis.experiments.crowd.study import plan_session
from visavis.experiments.crowd.surfaces import MeshSurface, avatar_of
from visavis.experiments.crowd.walks import STEP_NS, Walk
from visavis.lab.clock import NS_PER_S, cpu_time_s

PEOPLE, WALKS_EACH, CORES = 23, 24, 2
WALK_S = 60.0
LIMIT_MIN = 40.0
PERSON_LIMIT_S = 60.0
STEP_M = 0.7


def simulated_walks(n: int) -> list[Walk]:
    """Return the first walks of one simulated participant, each through another crowd."""
    participant = CrowdParticipant(0, 1, effect=True)
    found = []
    now_ns = 0
    for trial in plan_session(0, 1).trials:
        if trial.is_practice:
            continue
        quick = quick_walk(participant, trial, now_ns)
        t_ns = np.rint(quick.t_s * NS_PER_S).astype(np.int64)
        now_ns += int(t_ns[-1]) + 4 * NS_PER_S
        grid = np.arange(0, t_ns[-1], STEP_NS, dtype=np.int64)
        position, turn = resample(t_ns, quick.position_m, quick.orientation_wxyz, grid)
        row = {"t_start_ns": 0, "trial_id": trial.trial_id, **trial.factors}
        found.append(Walk(trial.trial_id, row, quick.crowd, grid, position, turn, quick.stature_m))
        if len(found) == n:
            break
    return found


def measure(n: int, surface: MeshSurface) -> list[Row]:
    """Measure so many walks; return every figure."""
    params = MeasureParameters(surface=surface)
    walks = simulated_walks(n + 1)
    measure_walk(walks[0], STEP_M, params)  # compiles, loads characters
    began_s = cpu_time_s()
    measured = [measure_walk(walk, STEP_M, params) for walk in walks[1:]]
    cpu_s = cpu_time_s() - began_s
    began_s = cpu_time_s()
    for walk in walks[1:]:
        avatar = avatar_of(None, walk.stature_m)
        volumes_or_nearness(walk, surface, avatar, only_near=True)
    near_s = cpu_time_s() - began_s
    walked_s = sum(len(walk.t_ns) * 0.01 for walk in walks[1:])
    per_walk_s = cpu_s / walked_s * WALK_S
    study_min = per_walk_s * PEOPLE * WALKS_EACH / CORES / 60
    actual_min = cpu_s / len(measured) * PEOPLE * WALKS_EACH / CORES / 60
    person_s = cpu_s / len(measured) * WALKS_EACH
    collisions = sum(m.row["collisions"] for m in measured) / len(measured)
    return [
        Row("CPU per 10 ms step", cpu_s / walked_s * 10, "ms"),
        Row("CPU per walk of a minute", per_walk_s, "s"),
        Row("walks measured, mean length", walked_s / len(measured), "s"),
        Row("collisions per walk", collisions, ""),
        Row(
            "one person, 24 walks of that length",
            person_s,
            "s",
            PERSON_LIMIT_S,
            floor=near_s / len(measured) * WALKS_EACH,
            floor_name="everybody near posed and boxes compared, nothing measured",
            floor_is_ours=True,
        ),
        Row("study of 23 × 24 walks of a minute on two cores", study_min, "min", LIMIT_MIN),
        Row("the same at the length walked here", actual_min, "min"),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when the limit is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--walks", type=int, default=3)
    parser.add_argument("--surface", default="characters", choices=get_args(MeshSurface))
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    return show(measure(options.walks, options.surface), as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
