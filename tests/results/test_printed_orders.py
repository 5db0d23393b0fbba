"""Orders that a source states: whether they hold in a table, and where they come from."""

from dataclasses import replace

import pandas as pd
import pytest

from visavis.lab.errors import DesignError
from visavis.results.opened_study import find_study
from visavis.results.printed_orders import order_holds, printed_orders_of
from visavis.study.source import PrintedOrder


def table(**columns: list[object]) -> pd.DataFrame:
    return pd.DataFrame(columns)


SPEEDS = table(
    participant=["a", "a", "a", "b", "b", "b"],
    place=["left", "left", "right", "left", "right", "right"],
    speed=[1.0, 3.0, 4.0, 5.0, 2.0, 2.0],
)
"""Means of people: left 2 and 5, right 4 and 2."""


def order(text: str, **options: object) -> PrintedOrder:
    return PrintedOrder(text, "speed", "p. 1", **options)  # type: ignore[arg-type]  # by name


def test_means_over_people_are_compared_not_over_trials() -> None:
    assert order_holds(order("left > right", factor="place"), SPEEDS)
    assert not order_holds(order("right > left", factor="place"), SPEEDS)


def test_sides_may_be_numbers_and_the_measure_itself() -> None:
    assert order_holds(order("left > 3.4 > right", factor="place"), SPEEDS)
    assert order_holds(order("speed > 2.8"), SPEEDS)


def test_equal_means_and_absent_levels_are_in_no_order() -> None:
    assert not order_holds(order("left > 3.5", factor="place"), SPEEDS)
    assert not order_holds(order("3.5 > left", factor="place"), SPEEDS)
    assert not order_holds(order("left > middle", factor="place"), SPEEDS)
    assert not order_holds(order("left > right", factor="place"), SPEEDS[:0])


def test_missing_values_are_left_out() -> None:
    without = SPEEDS.assign(speed=[1.0, 3.0, None, 5.0, 2.0, None])
    assert order_holds(order("left > 3.4 > right", factor="place"), without)


def test_shares_of_answers_are_compared_with_each_other_and_between_levels() -> None:
    names = {"much": 2.0, "some": 1.0, "none": 0.0}
    votes = SPEEDS.assign(speed=[2.0, 2.0, 1.0, 2.0, 0.0, 1.0])
    assert order_holds(order("much > some > none", answers=names), votes)
    assert not order_holds(order("some > much", answers=names), votes)
    both = {name: names[name] for name in ("much", "some")}
    assert order_holds(order("left > right", factor="place", answers=both), votes)
    assert not order_holds(
        order("left > right", factor="place", answers=both, only={"participant": "a"}), votes
    )


def test_gains_are_compared_between_levels() -> None:
    twice = pd.concat(
        [SPEEDS.assign(way="old"), SPEEDS.assign(way="new", speed=[2.0, 4.0, 9.0, 6.0, 8.0, 8.0])]
    )
    assert order_holds(order("right > left", factor="place", gain=("way", "new", "old")), twice)


def test_significant_published_results_with_a_direction_are_orders() -> None:
    crowd = {(o.measure, o.order) for o in printed_orders_of(find_study("crowd").study)}
    assert ("collisions", "NoHaptic1 > Haptic, NoHaptic2") in crowd
    stare = {(o.measure, o.order): o.where for o in printed_orders_of(find_study("stare").study)}
    assert "table 3.1" == stare["second_fixation_time_ms", "A > D"]
    assert ("first_fixation_time_ms", "A > D") not in stare


def test_an_order_of_several_factors_is_refused() -> None:
    with pytest.raises(DesignError, match="levels of one factor"):
        order("place: left > right; way: new > old")


def test_a_reason_for_an_order_that_the_source_does_not_state_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = find_study("waving").study
    source = study.report.source
    assert source is not None
    odd = replace(source, not_reproduced={"is_right: left > right": "no"})
    monkeypatch.setattr(study, "report", replace(study.report, source=odd))
    with pytest.raises(DesignError, match=r"is_right: left > right.*is_right: warping"):
        printed_orders_of(study)
