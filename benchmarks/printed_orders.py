"""Simulate a study again and again: how often do the orders that its source states hold?

    python -m benchmarks.printed_orders STUDY [--studies N] [--people N] [--pool N]
                                        [--set NAME=VALUE] [--json]

As many people as the source had take part, over the quick path. With `--pool` only so many people
are simulated, and studies drawn from them with replacement: for studies that take a minute each.
What the pool has by chance is in all of these, so that shares near the limit need whole studies.
Every order that the study's source
states (`visavis fidelity`) must hold in 90 % of simulated studies, or the study says why it
is not reproduced. Exits with 1 where one holds too seldom without a reason, or holds well enough
and has one. An order of people whom nobody simulates is not measured, and is no fault.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import UsageError
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.printed_orders import (
    MIN_HOLDS_01,
    order_holds,
    printed_orders_of,
    rows_for,
)
from visavis.running.quick import quick_study
from visavis.running.sessions.study_folder import read_parameters
from visavis.study.experiment import StudyExperiment
from visavis.study.source import PrintedOrder


def shares_of(
    name: str,
    studies: int,
    people: int,
    overrides: Mapping[str, object],
    first_seed: int = 0,
    pool: int | None = None,
) -> dict[str, float]:
    """Return the share of simulated studies in which each order holds, by the order's name.

    It is of the studies in which the order is measured; NaN where it is in none.
    """
    opened = find_study(name)
    experiment = opened.experiment(overrides)
    orders = printed_orders_of(experiment)
    measures = {m.column: m for m in opened.measures(experiment)}
    holds: dict[str, list[bool]] = {order.name: [] for order in orders}
    groups = opened.study.analysis.groups
    for trials, answers in _studies(opened, experiment, studies, people, first_seed, pool):
        rows = rows_for(orders, trials, answers, groups)
        for order in orders:
            is_held = order_holds(order, rows, measures[order.measure].aggregate)
            holds[order.name] += [] if is_held is None else [is_held]
    return {name: float(np.mean(each)) if each else math.nan for name, each in holds.items()}


def _studies(
    opened: OpenedStudy,
    experiment: StudyExperiment,
    studies: int,
    people: int,
    first_seed: int,
    pool: int | None,
) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Yield trials and answers of study after study, each simulated or drawn from a pool."""
    if pool is None:
        for seed in range(first_seed, first_seed + studies):
            one = quick_study(opened, experiment, tracker_of, range(people), seed=seed)
            yield one.trials, one.people
        return
    whole = quick_study(opened, experiment, tracker_of, range(pool), seed=first_seed)
    tables = [
        {str(who): rows for who, rows in table.groupby("participant")}
        for table in (whole.trials, whole.people)
    ]
    names = sorted(tables[0])
    rng = np.random.default_rng(first_seed)
    for _ in range(studies):
        chosen = [names[k] for k in rng.integers(0, len(names), people)]
        trials, answers = (
            pd.concat([of[who].assign(participant=f"{k:03d}") for k, who in enumerate(chosen)])
            for of in tables
        )
        yield trials, answers


def is_as_declared(order: PrintedOrder, share: float) -> bool:
    """Tell whether an order holds often enough, or seldom and with a reason, or is not measured."""
    return math.isnan(share) or (share >= MIN_HOLDS_01) != bool(order.not_reproduced)


def main(arguments: Sequence[str]) -> int:
    """Print how often each order holds."""
    parser = argparse.ArgumentParser(prog="benchmarks.printed_orders", description=__doc__)
    parser.add_argument("study")
    parser.add_argument("--studies", type=int, default=100)
    parser.add_argument("--people", type=int, help="those of the source where left out")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--pool", type=int, help="people of whom studies are drawn")
    parser.add_argument("--set", dest="assignments", action="append", default=[])
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    opened = find_study(options.study)
    source = opened.study.report.source
    people = options.people or (None if source is None else source.participants)
    if people is None:
        raise UsageError(f"{options.study} names no number of its source's participants: --people")
    overrides = read_parameters(options.assignments)
    shares = shares_of(
        options.study, options.studies, people, overrides, options.first_seed, options.pool
    )
    orders = printed_orders_of(opened.experiment(overrides))
    if options.json:
        there = {name: None if math.isnan(share) else share for name, share in shares.items()}
        print(json.dumps(there, indent=2))
    else:
        of = "" if options.pool is None else f", drawn from {options.pool}"
        print(f"SIMULATED: {options.studies} studies of {people} people{of}")
        for order in orders:
            verdict = "" if is_as_declared(order, shares[order.name]) else "  NOT AS DECLARED"
            why = f"  (not reproduced: {order.not_reproduced})" if order.not_reproduced else ""
            share = shares[order.name]
            held = "not measured" if math.isnan(share) else f"{100 * share:5.1f} %"
            print(f"{held}  {order.name}{why}{verdict}")
        print(f"limit {100 * MIN_HOLDS_01:g} %, or a reason")
    return int(not all(is_as_declared(order, shares[order.name]) for order in orders))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
