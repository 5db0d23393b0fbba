"""Print how often each shipped study would find anything if nothing were there.

    python -m benchmarks.chance_findings [STUDY …] [--studies 200] [--participants 16] [--pool 48]
        [--test NAME] [--seed 20]

People to whom nothing shown makes a difference are simulated once (as by `visavis power STUDY
--effect none`). A study draws some of them, gives each person's conditions out anew among their
trials, and groups and scores anew among people: whatever is found is then false, and the chance
differences of these people are not found again and again. Printed is the share of studies in which
a primary claim, and in which any planned test finds something (an effect, a claim, in part or the
other way round), with 95 % Wilson intervals; of a study that plans one test, the share in which
that is significant. `--test` counts one test of the study alone (`visavis power STUDY --test
list`). Another `--seed` simulates other people and draws other studies, so that a long run may be
cut into pieces. Exits 1 where a primary claim is found too often.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from visavis.analysis.power import ANYTHING, PRIMARY
from visavis.analysis.statistics.power_estimates import proportion_interval
from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import UsageError
from visavis.results.opened_study import find_study
from visavis.results.power import KitPower
from visavis.running.quick import quick_study
from visavis.study.catalogue import SHIPPED_STUDIES

SEED = 20
MOST = 0.05


@dataclass(frozen=True)
class ChanceFindings:
    """How many studies of n people found anything where nothing was."""

    study: str
    studies: int
    n: int
    counts: Mapping[str, int]
    """How many by name of the test: `primary` and `anything`, or the only test."""


def without_effects(
    pool: pd.DataFrame, factors: Sequence[str], n: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Return n people of a pool, their conditions and groups given out anew.

    Combinations of `factors` are permuted among the rows of a person, and what is the same in all
    rows of a person among people.
    """
    rows_of = list(pool.groupby("participant", sort=True).indices.values())
    people = [rows_of[i] for i in rng.permutation(len(rows_of))[:n]]
    rows = np.concatenate(people)
    study = pool.iloc[rows].reset_index(drop=True)
    study["participant"] = np.repeat([f"{i:05d}" for i in range(n)], [len(p) for p in people])
    varies = pool.groupby("participant")[list(pool.columns)].nunique().max()
    within = [name for name in factors if name in pool and varies[name] > 1]
    of_people = [name for name in pool.columns if name != "participant" and varies[name] <= 1]
    permuted = np.concatenate([rng.permutation(p) for p in people])
    study[within] = pool[within].iloc[permuted].to_numpy()
    other_people = np.concatenate(
        [
            np.full(len(own), other[0])
            for own, other in zip(people, (people[i] for i in rng.permutation(n)), strict=True)
        ]
    )
    study[of_people] = pool[of_people].iloc[other_people].to_numpy()
    return study.astype(pool.dtypes.to_dict())


def chance_findings(
    name: str, studies: int, n: int, pool: int, test: str = "", seed: int = SEED
) -> ChanceFindings:
    """Simulate people without an effect and count studies that find something.

    Raises:
        UsageError: the study plans no comparison.
    """
    study = KitPower(name, tracker_of, quick_study)
    tests = [test] if test else [n for n in study.tests if n in (PRIMARY, ANYTHING)]
    tests = tests or list(study.tests)  # the only one
    study.prepare(lambda count, total: None)
    people = study.simulate_people(range(pool), effect=0.0, seed=seed)
    factors = list(find_study(name).experiment({}).levels)
    rng = np.random.default_rng(seed)
    counts = dict.fromkeys(tests, 0)
    for _ in range(studies):
        rows = without_effects(people, factors, n, rng)
        verdicts = study.verdicts_at(rows, [n], tests, 0.05)[n]
        for one in tests:
            counts[one] += verdicts[one].is_significant is True
    return ChanceFindings(name, studies, n, counts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per study; exit 1 where one finds something too often beyond chance."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="STUDY")
    parser.add_argument("--studies", type=int, default=200)
    parser.add_argument("--participants", type=int, default=16)
    parser.add_argument("--pool", type=int, default=48)
    parser.add_argument("--test", default="")
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args(arguments)
    print(f"{'study':14} {'n':>4} {'studies':>8}   find something, by test")
    is_wrong = False
    for name in options.names or SHIPPED_STUDIES:
        try:
            made = chance_findings(
                name,
                options.studies,
                options.participants,
                options.pool,
                options.test,
                options.seed,
            )
        except UsageError as error:
            print(f"{name:14} {error}", flush=True)
            continue
        shares = {t: proportion_interval(n, made.studies) for t, n in made.counts.items()}
        is_wrong |= next(iter(shares.values())).low > MOST
        words = ", ".join(
            f"{test} {made.counts[test] / made.studies:.3f} [{share.low:.3f}, {share.high:.3f}]"
            for test, share in shares.items()
        )
        print(f"{name:14} {made.n:4} {made.studies:8}   {words}", flush=True)
    return int(is_wrong)


if __name__ == "__main__":
    sys.exit(main())
