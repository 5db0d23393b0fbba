"""Compare QUEST+ with another implementation, trial after trial, and find planted functions again.

python -m benchmarks.quest_plus [--trials 1000] [--people 200] [--oracle PYTHON]

`--oracle` is a Python in which the package questplus (GPL, never a part of Visavis) is installed,
in an environment of its own; it gets the same answers in a process of its own. Without it only the
planted functions are found again.
"""

import argparse
import json
import subprocess
from collections.abc import Sequence

import numpy as np

from visavis.analysis.psychometric import share_right
from visavis.study.quest_plus import QuestPlus

RULE = QuestPlus(
    "contrast",
    levels=np.geomspace(0.002, 0.6, 41).tolist(),
    thresholds=np.geomspace(0.004, 0.4, 41).tolist(),
    slopes=(1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0),
    lapses=(0.0, 0.02, 0.04),
)
PLANTED = (0.05, 3.0, 0.02)
"""Threshold, slope and lapses of the simulated people."""
ORACLE = """
import json, sys
import questplus
grid, answers = json.load(sys.stdin)
levels = grid.pop("levels")
qp = questplus.QuestPlus(stim_domain={"intensity": levels}, param_domain={
    "threshold": grid["thresholds"], "slope": grid["slopes"],
    "lower_asymptote": [grid["guess"]], "lapse_rate": grid["lapses"]},
    outcome_domain={"response": ["right", "wrong"]}, func="weibull", stim_scale="linear",
    param_estimation_method="mean")
rows = []
for level, is_right in answers:
    level_of_theirs = qp.next_stim["intensity"]
    qp.update(stim={"intensity": level}, outcome={"response": "right" if is_right else "wrong"})
    e = qp.param_estimate
    rows.append((level_of_theirs, e["threshold"], e["slope"], e["lapse_rate"]))
json.dump(rows, sys.stdout)
"""


def run(trials: int, seed: int) -> tuple[list[tuple[float, bool]], list[tuple[float, ...]]]:
    """Return the answers of a simulated person, and level, threshold, slope, lapse after each."""
    rng, posterior = np.random.default_rng(seed), RULE.first
    answers: list[tuple[float, bool]] = []
    rows: list[tuple[float, ...]] = []
    threshold, slope, lapse = PLANTED
    for _ in range(trials):
        level = posterior.next_level
        is_right = bool(rng.random() < share_right(level, threshold, slope, RULE.guess, lapse))
        posterior = posterior.after(level, is_right)
        answers.append((level, is_right))
        rows.append((level, *(posterior.mean(axis) for axis in range(3))))
    return answers, rows


def difference_from(oracle: str, trials: int) -> tuple[float, int, float]:
    """Return the largest difference of an estimate, how many levels differ, and by how much the
    expected entropies of two such levels differ at most: where they are equal, rounding decides.
    """
    answers, ours = run(trials, 1)
    grid = {
        name: getattr(RULE, name) for name in ("levels", "thresholds", "slopes", "lapses", "guess")
    }
    result = subprocess.run(  # the Python that the caller named
        [oracle, "-c", ORACLE],
        input=json.dumps([grid, answers]),
        capture_output=True,
        text=True,
        check=True,
    )
    theirs = np.array(json.loads(result.stdout))
    mine = np.array(ours)
    posterior, count, apart = RULE.first, 0, 0.0
    for (level, is_right), other in zip(answers, theirs[:, 0], strict=True):
        if level != other:
            count += 1
            at, there = (RULE.levels.index(v) for v in (level, other))
            apart = max(apart, abs(posterior.entropies[at] - posterior.entropies[there]))
        posterior = posterior.after(level, is_right)
    return float(np.abs(mine[:, 1:] - theirs[:, 1:]).max()), count, apart


def main(words: Sequence[str] | None = None) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--people", type=int, default=200)
    parser.add_argument("--oracle", default="")
    options = parser.parse_args(words)
    if options.oracle:
        off, levels, apart = difference_from(options.oracle, options.trials)
        print(
            f"{options.trials} trials: estimates differ from questplus by {off:.1e} at most, "
            f"{levels} levels differ, in expected entropy by {apart:.1e} at most"
        )
    if options.people:
        last = np.array([run(60, seed)[1][-1] for seed in range(options.people)])
        bias = np.exp(np.log(last[:, 1]).mean()) / PLANTED[0] - 1
        print(f"{options.people} people of 60 trials: threshold off by {bias:+.1%} on average")


if __name__ == "__main__":
    main()
