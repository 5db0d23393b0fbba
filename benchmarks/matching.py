"""How often four sliders beat 27 in simulated studies of matching, and what a study costs.

    python -m benchmarks.matching [--studies N] [--json]

Studies of 13 people each, by the quick path; without `--studies` there are 100 (some minutes). Of
each the pooled Wilcoxon tests of guesses and times, by the normal approximation as in the source:
the share of studies with p < .001 in which four sliders are nearer, and sooner. Then failures with
each interface, at how many targets guesses by adjectives are nearer than those by features on
average, and CPU time of a study simulated and tested.
"""

import argparse
import json
import sys
from dataclasses import asdict, dataclass

import numpy as np

from visavis.cli.quick_tracker import tracker_of
from visavis.experiments.matching.interfaces import INTERFACES, TARGETS
from visavis.experiments.matching.outcomes import Outcomes, PairTest, outcomes_of
from visavis.experiments.matching.published import ALL
from visavis.experiments.matching.study import study
from visavis.lab.clock import cpu_time_s
from visavis.results.opened_study import OpenedStudy
from visavis.running.quick import quick_study

PEOPLE = 13
ALPHA = 0.001


@dataclass(frozen=True)
class Figures:
    """What is printed: shares of studies, shares of adjustments, and seconds."""

    studies: int
    nearer_by_adjectives_01: float
    nearer_by_features_01: float
    sooner_by_adjectives_01: float
    sooner_by_features_01: float
    all_four_01: float
    failures_weights_01: float
    failures_weights_least_01: float
    failures_adjectives_01: float
    failures_features_01: float
    guessed_weights_01: float
    guessed_adjectives_01: float
    guessed_features_01: float
    adjectives_nearer_targets: int
    cpu_s_a_study: float


def _is_beaten(test: PairTest) -> bool:
    return test.p_normal < ALPHA and test.better == test.first


def _outcomes(seed: int) -> Outcomes:
    opened = OpenedStudy(study)
    made = opened.experiment({})
    rows = quick_study(opened, made, tracker_of, range(PEOPLE), seed=seed).trials
    return outcomes_of(rows, {"target": TARGETS, "interface": INTERFACES})


def figures(studies: int) -> Figures:
    """Simulate and test so many studies."""
    beaten, failures, guesses, saved, spent = [], [], [], [], []
    for seed in range(studies):
        begin_s = cpu_time_s()
        outcomes = _outcomes(seed)
        tests = {
            (t.measure, t.first, t.second): t
            for m in ("guess_m", "time_s")
            for t in outcomes.tests(m)
            if t.target == ALL
        }
        beaten.append(
            [
                _is_beaten(tests[measure, first, "weights"])
                for measure in ("guess_m", "time_s")
                for first in ("adjectives", "features")
            ]
        )
        failures.append([1 - outcomes.values("is_matched", i, ALL).mean() for i in INTERFACES])
        guesses.append([outcomes.values("is_guessed", i, ALL).mean() for i in INTERFACES])
        saved.append(
            [outcomes.pairs("guess_m", "features", "adjectives", t).mean() for t in TARGETS]
        )
        spent.append(cpu_time_s() - begin_s)
    share, failed = np.mean(beaten, axis=0), np.mean(failures, axis=0)
    signs = np.sign(np.mean(saved, axis=0))
    guessed = np.mean(guesses, axis=0)
    return Figures(
        studies=studies,
        nearer_by_adjectives_01=float(share[0]),
        nearer_by_features_01=float(share[1]),
        sooner_by_adjectives_01=float(share[2]),
        sooner_by_features_01=float(share[3]),
        all_four_01=float(np.all(beaten, axis=1).mean()),
        failures_weights_01=float(failed[0]),
        failures_weights_least_01=float(np.min(failures, axis=0)[0]),
        failures_adjectives_01=float(failed[1]),
        failures_features_01=float(failed[2]),
        guessed_weights_01=float(guessed[0]),
        guessed_adjectives_01=float(guessed[1]),
        guessed_features_01=float(guessed[2]),
        adjectives_nearer_targets=int((signs < 0).sum()),
        cpu_s_a_study=float(np.median(spent)),
    )


def main() -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--studies", type=int, default=100)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    found = asdict(figures(arguments.studies))
    if arguments.json:
        print(json.dumps(found, indent=2))
        return 0
    for name, value in found.items():
        print(f"{name:<26} {value:.3g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
