"""Orders that a source states: whether they hold in a table, and where they come from."""

from dataclasses import replace

import pandas as pd
import pytest

from visavis.lab.errors import DesignError
from visavis.results.opened_study import find_study
from visavis.results.printed_orders import order_holds, printed_orders_of, rows_for
from visavis.study.experiment import StudyExperiment
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
    crowd = {(o.measure, o.order) for o in printed_orders_of(find_study("crowd").experiment({}))}
    assert ("collisions", "NoHaptic1 > Haptic, NoHaptic2") in crowd
    of_stare = printed_orders_of(find_study("stare").experiment({}))
    stare = {(o.measure, o.order): o.where for o in of_stare}
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
    with pytest.raises(
        DesignError, match=r"is_right: left > right.*is_right by technique: warping"
    ):
        printed_orders_of(StudyExperiment(study))


NUMBERS = table(participant=["a", "a", "b", "b"], people=[1, 4, 1, 4], speed=[1.0, 8.0, 1.0, 8.0])
"""Of the levels 1, 2 and 4 nobody has 2."""


@pytest.mark.parametrize("levels", [(1, 2, 4), ()])
def test_a_level_with_a_number_for_its_name_is_never_read_as_a_number(
    levels: tuple[int, ...],
) -> None:
    above_2 = order("4 > 2", factor="people", levels=levels)
    assert order_holds(above_2, NUMBERS) is None
    assert order_holds(order("4 > 1", factor="people", levels=levels), NUMBERS) is True


def test_levels_that_a_table_holds_as_decimal_numbers_are_matched() -> None:
    as_decimals = NUMBERS.assign(people=NUMBERS["people"].astype(float), way=[1.0, 1.0, 2.0, 2.0])
    assert order_holds(order("1 > 4", factor="people"), as_decimals) is False
    assert order_holds(order("4 > 1", factor="people"), as_decimals) is True
    gain = order("a > b", factor="who", gain=("people", 4, 1))
    faster = as_decimals.assign(who=["a", "a", "b", "b"], speed=[1.0, 9.0, 1.0, 3.0])
    assert order_holds(gain, faster) is True


def test_a_number_that_is_no_declared_level_is_compared_as_a_number() -> None:
    assert order_holds(order("4 > 2.5 > 1", factor="people", levels=(1, 2, 4)), NUMBERS) is True


def test_an_order_about_a_level_that_nobody_has_is_not_measured() -> None:
    assert order_holds(order("left > middle", factor="place"), SPEEDS) is None
    assert order_holds(order("left > right", factor="place"), SPEEDS[:0]) is None
    assert order_holds(order("right > left", factor="place"), SPEEDS) is False


def test_conditions_of_an_order_choose_people_by_what_they_answered() -> None:
    people = table(participant=["a", "b"], age=[20, 40])
    of_old = order("left > right", factor="place", conditions=("age >= 30",))
    of_young = order("right > left", factor="place", only={"years": "young"})
    groups = {"years": {"young": "age < 30", "old": "age >= 30"}}
    rows = rows_for((of_old, of_young), SPEEDS, people, groups)
    assert order_holds(of_old, rows) is True
    assert order_holds(of_young, rows) is True
    assert order_holds(of_young, rows_for((of_young,), SPEEDS, None, groups)) is None
    with pytest.raises(DesignError, match=r"conditions.*no number"):
        order("left > right", factor="place", conditions=("age >> 3",))


def test_the_name_of_an_order_says_factor_gain_and_whom_it_is_about() -> None:
    of = {"only": {"k": 1}, "conditions": ("age > 3",)}
    whole = order("a > b", factor="way", gain=("place", "left", "right"), **of)
    assert "speed by way; place left minus right: a > b (k 1, age > 3)" == whole.name


def test_orders_of_published_results_are_about_those_of_their_comparison() -> None:
    orders = printed_orders_of(find_study("interpolation").experiment({}))
    squad = [o for o in orders if o.order == "squad > slerp, lineuler"]
    assert {"method"} == {o.factor for o in squad}
    whom = [(*o.only.items(), *o.conditions) for o in squad]
    assert len(whom) == len(set(whom))
    assert {(), ("recruited_by = 1",), (("experience", "novice"),), (("gesture", "beat"),)} <= {
        *whom
    }
    assert "table 2" == squad[0].where
    assert all(o.where == "table 5" for o in squad if "gesture" in o.only)
    assert set(squad[0].levels) == {"lineuler", "slerp", "squad"}


def test_an_order_of_columns_that_are_not_there_is_not_measured() -> None:
    assert order_holds(order("left > right", factor="spot"), SPEEDS) is None
    assert order_holds(order("left > right", factor="place", only={"k": 1}), SPEEDS) is None
    gain = order("left > right", factor="place", gain=("way", "new", "old"))
    assert order_holds(gain, SPEEDS) is None


def test_a_reason_for_what_parameters_leave_out_is_no_mistake(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = find_study("interpolation").study
    assert study.report.source is not None
    name = "naturalness by method: squad > slerp, lineuler (experience novice)"
    source = replace(study.report.source, not_reproduced={name: "novices do not look"})
    monkeypatch.setattr(study, "report", replace(study.report, source=source))
    reasons = {o.name: o.not_reproduced for o in printed_orders_of(StudyExperiment(study))}
    assert "novices do not look" == reasons[name]
    monkeypatch.setattr(study, "analysis", replace(study.analysis, compare=()))
    with pytest.raises(DesignError, match="which is no order of its source"):
        printed_orders_of(StudyExperiment(study))
    less = StudyExperiment(study, {"gesture": ["beat", "iconic"]})
    assert name not in {o.name for o in printed_orders_of(less)}


@pytest.mark.parametrize(
    ("order", "name"),
    [
        (PrintedOrder("run > 0.5", "hits", "p. 1"), "hits: run > 0.5"),
        (PrintedOrder("a > b", "dwell_ms", "p. 1", factor="gaze"), "dwell_ms by gaze: a > b"),
        (
            PrintedOrder("a > b", "x", "p. 1", "gaze", gain=("side", "left", "right")),
            "x by gaze; side left minus right: a > b",
        ),
        (
            PrintedOrder("a > b", "x", "p. 1", "gaze", only={"part": 2}, conditions=("age >= 30",)),
            "x by gaze: a > b (part 2, age >= 30)",
        ),
        (PrintedOrder("a > b", "x", "p. 1", "gaze", words="a before b"), "a before b"),
    ],
)
def test_a_printed_order_is_named_by_what_it_says_alone(order: PrintedOrder, name: str) -> None:
    assert name == order.name
