"""What a study's keywords take, and what is said of a value of another kind."""

import itertools
from dataclasses import fields
from typing import Any, get_args

import pytest

from visavis import Compare, Criterion, Factor, Study
from visavis.analysis.statistics_report import TESTS
from visavis.lab.errors import DesignError
from visavis.study.arguments import is_of_kind, words_of_kind
from visavis.study.comparisons import Test
from visavis.study.declaration import PARTS

HINTS = {f.name: f.type for part in PARTS.values() for f in fields(part)}
VALUES = ("x", 3, 1.5, None, True, [3], {"a": 3}, object())
FACTORS = [Factor("side", ["left", "right"])]
OTHERS = [
    (keyword, value)
    for keyword, value in itertools.product(HINTS, VALUES)
    if not is_of_kind(value, HINTS[keyword])
]


def keywords_of(keyword: str, value: Any) -> dict[str, Any]:
    return {"factors": FACTORS, keyword: value}


@pytest.mark.parametrize(("keyword", "value"), OTHERS)
def test_a_value_of_another_kind_is_refused_by_the_keywords_name(keyword: str, value: Any) -> None:
    with pytest.raises(DesignError, match=f"study kinds: .*{keyword} (is|holds) .*"):
        Study("kinds", **keywords_of(keyword, value))


def test_most_values_are_of_another_kind() -> None:
    assert len(HINTS) * len(VALUES) / 2 < len(OTHERS)


@pytest.mark.parametrize(
    ("keyword", "value", "says"),
    [
        ("repetitions", 1.5, "repetitions is 1.5; it takes a whole number"),
        ("order", "sorted", "order is 'sorted'; it takes 'fixed', 'random', "),
        ("practice", [3], r"practice is \[3\]; it takes a whole number or a list"),
        ("calibrate", "no", "calibrate is 'no'; it takes True or False"),
        ("check_of", 3, "check_of is 3; it takes a function"),
        ("questions", {"a": 3}, "questions is .*; it takes names with what belongs to each"),
        ("returning", 24, r"returning is 24; it takes Returning\(…\)"),
        ("xr", "often", "xr is 'often'; it takes 'never', 'optional' or 'required'"),
        ("days_between", (1, "x"), "days_between is .*; it takes two numbers"),
        ("texts", {}, "texts is {}; it takes a text"),
        ("title", 3, "title is 3; it takes a text"),
        ("thresholds", 3, "thresholds is 3; it takes a dataclass of numbers"),
        ("base", "stare", "base is 'stare'; it takes a Study"),
        ("compare", None, "compare is None; it takes a list"),
    ],
)
def test_it_says_what_the_keyword_takes(keyword: str, value: Any, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        Study("kinds", **keywords_of(keyword, value))


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ({"alpha": "x"}, r"Compare\('z', …\): alpha is 'x'; it takes a number"),
        ({"test": "paird"}, "test is 'paird'; did you mean 'paired'"),
        ({"correction": "hochberg"}, "it takes 'none', 'holm', 'bonferroni' or 'bh'"),
        ({"published": 3}, r"published is 3; it takes Printed\(…\)"),
        ({"only": None}, "only is None; it takes names with what belongs to each"),
        ({"exploratory": "yes"}, "exploratory is 'yes'; it takes True or False"),
    ],
)
def test_what_stands_in_a_keywords_list_is_looked_at_before_anybody_comes(
    value: Any, says: str
) -> None:
    with pytest.raises(DesignError, match=says):
        Study("kinds", **keywords_of("compare", [Compare("z", within="side", **value)]))


@pytest.mark.parametrize("levels", ["left", {"left": 1}, None, 3])
def test_levels_of_a_factor_are_a_list_and_no_letters(levels: Any) -> None:
    with pytest.raises(DesignError, match=r"factor side: levels is .*it takes a list"):
        Factor("side", levels)


def test_every_test_of_the_statistics_can_be_named() -> None:
    assert {"", *TESTS} == set(get_args(Test))


@pytest.mark.parametrize(
    ("value", "hint", "expected"),
    [
        (Criterion("answer_is_right"), Criterion | None, True),
        (None, Criterion | None, True),
        (True, int, False),
        (3, float, True),
        ("read", HINTS["instructions"], True),
        ((6, 8), HINTS["days_between"], True),
        ({"a": 3}, HINTS["questions"], False),
        (frozenset({"card"}), HINTS["screening"], True),
    ],
)
def test_kinds(value: object, hint: Any, expected: bool) -> None:
    assert expected is is_of_kind(value, hint)
    assert words_of_kind(hint)
