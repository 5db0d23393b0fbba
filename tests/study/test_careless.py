"""Signs of careless answers are told of everybody; only the plan's rules leave anybody out."""

import math

import numpy as np
import pandas as pd
import pytest

from visavis.lab.errors import DesignError
from visavis.study.careless_answers import Careless, patterned_01


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([1, 2, 1, 2, 1, 2], 1.0),
        ([1, 2, 3, 1, 2, 3], 1.0),
        ([1, 2, 3, 4, 5, 1], 0.0),
        ([1, 2], float("nan")),
    ],
)
def test_patterns_of_two_and_three_are_noticed(given: list[float], expected: float) -> None:
    assert pytest.approx(expected, nan_ok=True) == patterned_01(np.array(given, np.float64))


def trials(given: list[float | None], **columns: list[object]) -> pd.DataFrame:
    n = len(given)
    return pd.DataFrame(
        {
            "participant": ["P1"] * n,
            "status": ["complete"] * n,
            "is_practice": [False] * n,
            "t_start_ns": range(n),
            "rating": given,
            **columns,
        }
    )


def test_signs_are_counted_over_trials_that_count() -> None:
    rows = trials(
        [3, 3, 3, 4, None],
        rating_ms=[100, 900, 250, 800, None],
        clip=["a", "b", "a", "b", "c"],
        check=[None, "2", None, "1", None],
        check_is_right=[None, True, None, False, None],
    )
    practice = trials([3], rating_ms=[1], clip=["a"], check=["1"], check_is_right=[False])
    practice["is_practice"] = True
    careless = Careless(
        "rating",
        max_same=math.inf,
        max_hasty_01=0.4,
        max_retest_off=1.5,
        alike=("clip",),
        max_checks_failed=1,
        checks=("check",),
    )
    (found,) = careless.facts(pd.concat([practice, rows])).to_dict("records")
    assert 3 == found["same_answers"]
    assert 0.5 == found["hasty_01"]
    assert 0.5 == found["retest_off"]
    assert 1 == found["checks_failed"]
    assert set(found) == {"participant", *(c.name for c in careless.columns)}


def test_a_sign_without_a_limit_is_recorded_and_leaves_nobody_out() -> None:
    careless = Careless("rating", max_same=math.inf, max_hasty_01=0.5)
    assert ["max_hasty_01"] == [rule.name for rule in careless.rules]
    (rule,) = careless.rules
    assert rule.breaks(0.6, rule.limit)
    assert not rule.breaks(0.5, rule.limit)
    assert "60% of the answers came within 300 ms (limit 50%)" == rule.reason(0.6, 0.5)


def test_who_answered_nothing_has_no_signs() -> None:
    careless = Careless("rating", max_same=9, max_patterned_01=0.9, max_hasty_01=0.5)
    nothing = trials([None, None], rating_ms=[None, None])
    (found,) = careless.facts(nothing).to_dict("records")
    assert all(np.isnan(found[name]) for name in ("same_answers", "patterned_01", "hasty_01"))


def test_what_a_sign_needs_is_asked_for() -> None:
    with pytest.raises(DesignError, match="alike="):
        Careless("rating", max_retest_off=1.0)
    with pytest.raises(DesignError, match="checks="):
        Careless("rating", max_checks_failed=1)


def test_the_methods_say_in_words_what_leaves_careless_people_out() -> None:
    said = [
        rule.rule(rule.limit) for rule in Careless("rated", max_same=9.5, max_hasty_01=0.2).rules
    ]
    assert [
        "participants with a number of answers alike (max_same_answers) above 9.5",
        "participants with a share of answers within 300 ms (max_hasty_01) above 0.2",
    ] == said
