"""The orders that a study's source states, and whether they hold in a table of trials."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
import pandas as pd

from visavis.lab.errors import DesignError
from visavis.protocol.plan.steps import Scalar
from visavis.results.family_tests import printed_pair_tests
from visavis.study.comparisons import trials_of
from visavis.study.declaration import Study
from visavis.study.expectations import orders_of
from visavis.study.measures import Aggregate
from visavis.study.pairs import Pairs
from visavis.study.source import PrintedOrder

MIN_HOLDS_01: Final = 0.9
"""Share of simulated studies in which an order must hold that is not declared otherwise."""


def printed_orders_of(study: Study) -> tuple[PrintedOrder, ...]:
    """Return every order that the study's source states: in words, and by significant results.

    Raises:
        DesignError: the study says of an order that it is not reproduced, and there is no such
            order.
    """
    source = study.report.source
    if source is None:
        return ()
    orders = (*source.orders, *_of_comparisons(study), *_of_families(study))
    by_name = {order.name: order for order in orders}
    for name in source.not_reproduced:
        if name not in by_name:
            raise DesignError(
                f"study {study.name} says why {name!r} is not reproduced, which is no order of its "
                f"source; there are: {'; '.join(by_name)}"
            )
    return tuple(
        replace(order, not_reproduced=source.not_reproduced.get(name, order.not_reproduced))
        for name, order in by_name.items()
    )


def _of_comparisons(study: Study) -> Iterator[PrintedOrder]:
    """Yield the orders of published effects that were significant."""
    for compare in study.analysis.compare:
        for term, printed in compare.published_terms.items():
            if printed.is_significant and printed.order and ":" not in term:
                yield PrintedOrder(
                    printed.order,
                    compare.dv,
                    printed.where,
                    factor=term,
                    only=_varying(study, compare.only),
                )


def _of_families(study: Study) -> Iterator[PrintedOrder]:
    """Yield the directions of published paired tests that were significant."""
    for family in study.analysis.families:
        if not isinstance(family, Pairs) or family.printed is None:
            continue
        for test in printed_pair_tests(study, family):
            printed = test.published_result
            if printed is None or not printed.is_significant or not printed.direction:
                continue
            greater, less = (test.first, test.second)[:: -printed.direction]
            yield PrintedOrder(
                f"{greater} > {less}",
                test.measure.column,
                printed.where,
                factor=family.factor,
                only={family.each: test.where} if family.each else {},
            )


def _varying(study: Study, only: Mapping[str, Scalar]) -> dict[str, Scalar]:
    """Return the levels of `only` but those of factors that have no other level."""
    levels = {f.name: f.levels for f in study.design.factors}
    return {name: level for name, level in only.items() if len(levels.get(name, ())) != 1}


def order_holds(order: PrintedOrder, rows: pd.DataFrame, aggregate: Aggregate = "mean") -> bool:
    """Tell whether an order holds in the trials that count (one row each).

    Every participant's trials of a level are aggregated, and the means over participants compared;
    equal means are in no order. A level that nobody has is in none, too.
    """
    rows = trials_of(rows, order.only)
    rows = rows[rows[order.measure].notna()]
    return all(
        _side(order, greater, rows, aggregate) > _side(order, less, rows, aggregate)
        for greater, less in orders_of(order.order, order.name)[0].pairs
    )


def _side(order: PrintedOrder, side: str, rows: pd.DataFrame, aggregate: Aggregate) -> float:
    """Return the value of one side of an order; NaN for a level that nobody has."""
    if order.factor and (at_level := rows[rows[order.factor].astype(str) == side]).size:
        if order.gain is None:
            return _mean(order, at_level, aggregate)
        factor, first, second = order.gain
        gains = [_mean(order, at_level[at_level[factor] == x], aggregate) for x in (first, second)]
        return gains[0] - gains[1]
    if not order.factor and side in order.answers:
        one = replace(order, answers={side: order.answers[side]})
        return _mean(one, rows, aggregate)
    if side == order.measure:
        return _mean(order, rows, aggregate)
    try:
        return float(side)
    except ValueError:
        return float("nan")


def _mean(order: PrintedOrder, rows: pd.DataFrame, aggregate: Aggregate) -> float:
    """Return the mean over participants of the measure, or of the share of the order's answers."""
    values = rows[order.measure]
    if order.answers:
        values = values.isin(list(order.answers.values()))
    of_people = pd.to_numeric(values, errors="coerce").astype(float).groupby(rows["participant"])
    is_median = aggregate == "median" and not order.answers
    each = of_people.median() if is_median else of_people.mean()
    return float(np.mean(each)) if len(each) else float("nan")
