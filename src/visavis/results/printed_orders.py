"""The orders that a study's source states, and whether they hold in a table of trials."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.lab.errors import DesignError
from visavis.protocol.plan.steps import Scalar
from visavis.results.family_tests import printed_pair_tests
from visavis.study.comparisons import trials_of
from visavis.study.conditions import Groups, columns_asked, condition_of, fulfils, with_people
from visavis.study.declaration import Study
from visavis.study.expectations import orders_of
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import Aggregate
from visavis.study.pairs import Pairs
from visavis.study.source import PrintedOrder

MIN_HOLDS_01: Final = 0.9
"""Share of simulated studies in which an order must hold that is not declared otherwise."""


def printed_orders_of(experiment: StudyExperiment) -> tuple[PrintedOrder, ...]:
    """Return every order that the study's source states: in words, and by significant results.

    Those of published results are about the trials and people of their comparison. Of several of
    one name the first is taken, which is the declared one.

    Raises:
        DesignError: the study says of an order that it is not reproduced, and there is no such
            order.
    """
    study = experiment.study
    source = study.report.source
    if source is None:
        return ()
    by_name: dict[str, PrintedOrder] = {}
    for order in (*source.orders, *_of_comparisons(experiment), *_of_families(study)):
        by_name.setdefault(order.name, order)
    # Parameters, and a study derived from another, may leave out what an order is about.
    is_whole = study.base is None and not experiment.overrides
    for name in source.not_reproduced:
        if is_whole and name not in by_name:
            raise DesignError(
                f"study {study.name} says why {name!r} is not reproduced, which is no order of its "
                f"source; there are: {'; '.join(by_name)}"
            )
    levels: dict[str, Sequence[Scalar]] = {f.name: f.levels for f in study.design.factors}
    levels |= {name: tuple(of) for name, of in study.analysis.groups.items()}
    return tuple(
        replace(
            order,
            not_reproduced=source.not_reproduced.get(name, order.not_reproduced),
            levels=order.levels or levels.get(order.factor, ()),
        )
        for name, order in by_name.items()
    )


def _of_comparisons(experiment: StudyExperiment) -> Iterator[PrintedOrder]:
    """Yield the orders of published effects that were significant, with whom they are about."""
    for compare in experiment.compare:
        for term, result in compare.published_terms.items():
            if result.is_significant and result.order and ":" not in term:
                yield PrintedOrder(
                    result.order,
                    compare.dv,
                    result.where,
                    factor=term,
                    only=compare.only,
                    conditions=tuple(compare.where),
                )


def _of_families(study: Study) -> Iterator[PrintedOrder]:
    """Yield the directions of published paired tests that were significant."""
    for family in study.analysis.families:
        if not isinstance(family, Pairs) or family.printed is None:
            continue
        for test in printed_pair_tests(study, family):
            result = test.published_result
            if result is None or not result.is_significant or not result.direction:
                continue
            greater, less = (test.first, test.second)[:: -result.direction]
            yield PrintedOrder(
                f"{greater} > {less}",
                test.measure.column,
                result.where,
                factor=family.factor,
                only={family.each: test.where} if family.each else {},
            )


def rows_for(
    orders: Sequence[PrintedOrder],
    trials: pd.DataFrame,
    people: pd.DataFrame | None,
    groups: Groups,
) -> pd.DataFrame:
    """Return trials with every column that orders read, answers and groups of people among them."""
    conditions = [text for order in orders for text in order.conditions]
    names = [name for order in orders for name in (order.factor, *order.only) if name]
    condition_columns = {condition_of(text, "an order of the source").column for text in conditions}
    of_orders = {name: of for name, of in groups.items() if name in (*names, *condition_columns)}
    return with_people(trials, people, columns_asked(conditions, names, groups), of_orders)


def order_holds(
    order: PrintedOrder, rows: pd.DataFrame, aggregate: Aggregate = "mean"
) -> bool | None:
    """Tell whether an order holds in the trials that count (one row each); None if not measured.

    Every participant's trials of a level are aggregated, and the means over participants compared;
    equal means are in no order. Where nobody has one of its levels, it is not measured. `rows` have
    the columns of its factor and conditions (`rows_for`).
    """
    gain = () if order.gain is None else order.gain[:1]
    if not {order.measure, order.factor, *order.only, *gain} - {""} <= set(rows):
        return None
    rows = trials_of(rows, order.only)
    for text in order.conditions:
        rows = rows[fulfils(rows, condition_of(text, order.name))]
    rows = rows[rows[order.measure].notna()]
    stated_order = orders_of(order.order, order.name)[0]
    values = {side: _side(order, side, rows, aggregate) for side in stated_order.names}
    if any(np.isnan(value) for value in values.values()):
        return None
    return all(values[greater] > values[less] for greater, less in stated_order.pairs)


def _side(order: PrintedOrder, side: str, rows: pd.DataFrame, aggregate: Aggregate) -> float:
    """Return the value of one side of an order; NaN for a level that nobody has."""
    if order.factor and _is_level(order, side, rows):
        at_level = rows[_has_level(rows[order.factor], side)]
        if order.gain is None:
            return _mean(order, at_level, aggregate)
        factor, first, second = order.gain
        gains = [
            _mean(order, at_level[_has_level(at_level[factor], x)], aggregate)
            for x in (first, second)
        ]
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


def _is_level(order: PrintedOrder, side: str, rows: pd.DataFrame) -> bool:
    """Tell whether a side is a level of the order's factor, also one that nobody here has.

    Levels of derived columns are not declared; where all that are there are numbers, a number is a
    level, too.
    """
    declared_levels = pd.Series(list(order.levels), dtype=object)
    there = rows[order.factor].dropna()
    if _has_level(declared_levels, side).any() or _has_level(there, side).any():
        return True
    is_of_numbers = bool(pd.to_numeric(there, errors="coerce").notna().all())
    return not order.levels and is_of_numbers


def _has_level(cells: "pd.Series[Any]", level: Scalar) -> "pd.Series[bool]":
    """Tell of every cell whether it is this level; a table may hold 4 as 4, "4" or 4.0."""
    try:
        number = float(level)
    except ValueError:
        return cells.astype(str) == str(level)
    numbers = pd.to_numeric(cells, errors="coerce").astype(float)
    return (cells.astype(str) == str(level)) | (numbers == number)


def _mean(order: PrintedOrder, rows: pd.DataFrame, aggregate: Aggregate) -> float:
    """Return the mean over participants of the measure, or of the share of the order's answers."""
    values = rows[order.measure]
    if order.answers:
        values = values.isin(list(order.answers.values()))
    of_people = pd.to_numeric(values, errors="coerce").astype(float).groupby(rows["participant"])
    is_median = aggregate == "median" and not order.answers
    each = of_people.median() if is_median else of_people.mean()
    return float(np.mean(each)) if len(each) else float("nan")
