"""Simulate the study `hybrid` again and again, and hold its votes against the source's bars.

    python -m benchmarks.hybrid_votes [--studies N] [--people N] [--json]

The source prints bars without figures; its text says in which order they stand. Of 200 studies of
31 people: in how many each of these orders holds (limit 90 %). Without the limp of the run's clip
(`limp=0`) its hybrid is not preferred any more. Exits with 1 where an order holds too seldom.
"""

import argparse
import json
import sys

import numpy as np
import pandas as pd

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.hybrid.clips import CLIPS
from visavis.experiments.hybrid.study import study
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study

MIN_HELD_01 = 0.90
LEVELS = (-2, -1, 0, 1, 2)
MANY_01 = 0.2
"""From which share on votes of a kind are many."""


def held(rows: pd.DataFrame) -> dict[str, bool]:
    """Return which of the orders that the source describes hold in a study's votes."""
    cells = [(clip, k) for clip in CLIPS for k in (0, 1)]
    of = {}
    for clip, k in cells:
        own = rows.loc[(rows["clip"] == clip) & (rows["increment"] == k), "preference"]
        of[clip, k] = np.array([(own == level).mean() for level in LEVELS])
    mean = {cell: float(shares @ LEVELS) for cell, shares in of.items()}
    positive = {cell: 1.0 - float(shares[0]) for cell, shares in of.items()}

    def most(clip: str, increment: int) -> int:
        return LEVELS[int(of[clip, increment].argmax())]

    def is_for_clip(clip: str) -> bool:
        much, some = of[clip, 0][:2]
        return bool(much + some > 0.5 and min(much, some) >= MANY_01)

    walk, walk_1 = of["walk", 0], of["walk", 1]
    return {
        "walk, two poses: slightly for the clip most often": most("walk", 0) == -1,
        "walk, two poses: equal comes next": bool(walk[2] >= max(walk[0], walk[3], walk[4])),
        "run, two poses: slightly for the hybrid most often": most("run", 0) == 1,
        "run is the only hybrid that wins": all(
            (m > 0) == (cell[0] == "run") for cell, m in mean.items() if cell != ("run", 1)
        ),
        "crouch, two poses: the clip, slightly and significantly": is_for_clip("crouch"),
        "idle, two poses: the clip, slightly and significantly": is_for_clip("idle"),
        "walk, a pose more: slightly for the clip most often": most("walk", 1) == -1,
        "walk, a pose more: some significantly for the clip": bool(walk_1[0] > 0),
        "crouch, a pose more: from significantly for the clip to slightly for the hybrid": bool(
            of["crouch", 1][0] > 0 and of["crouch", 1][3] > 0
        ),
        "idle, a pose more: significantly for the clip most often": most("idle", 1) == -2,
        "share that is positive: walk falls": positive["walk", 0] > positive["walk", 1],
        "share that is positive: run falls, if little": positive["run", 0] >= positive["run", 1],
        "share that is positive: crouch rises": positive["crouch", 1] > positive["crouch", 0],
        "share that is positive: idle falls": positive["idle", 1] < positive["idle", 0],
        "walk and run are positive in both": min(
            positive[c, k] for c in ("walk", "run") for k in (0, 1)
        )
        > 0.5,
    }


def main(arguments: list[str]) -> int:
    """Print how often each order holds."""
    parser = argparse.ArgumentParser(prog="benchmarks.hybrid_votes", description=__doc__)
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--people", type=int, default=31)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    opened = OpenedStudy(study)
    experiment, sound = opened.experiment({}), opened.experiment({"limp": 0.0})
    people = range(options.people)
    found: list[dict[str, bool]] = []
    for seed in range(options.studies):
        found.append(held(quick_study(opened, experiment, tracker_of, people, seed=seed).trials))
        rows = quick_study(opened, sound, tracker_of, people, seed=seed).trials
        vanished = rows.loc[rows["clip"] == "run", "preference"].mean() <= 0
        found[-1]["run without the limp: the hybrid is not preferred"] = bool(vanished)
    shares = {name: float(np.mean([one[name] for one in found])) for name in found[0]}
    if options.json:
        print(json.dumps(shares, indent=2))
    else:
        print(f"SIMULATED: {options.studies} studies of {options.people} people")
        for name, share in shares.items():
            print(f"{100 * share:5.1f} %  {name}")
        print(f"limit of each {100 * MIN_HELD_01:g} %")
    return int(min(shares.values()) < MIN_HELD_01)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
