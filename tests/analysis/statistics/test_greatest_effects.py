"""The greatest effect there can be is found, and small groups lose an effect size, not a test."""

from collections.abc import Iterator
from typing import Any

import pandas as pd
import pytest

from visavis.analysis.statistics import (
    SignedRank,
    compare_paired,
    estimation_plot,
    tost_independent,
    tost_one_sample,
    tost_paired,
)
from visavis.analysis.statistics.errors import ConstantResponse
from visavis.analysis.statistics_report import Question, answer

PEOPLE = 10


def alike(levels: str, by: float = 1.0) -> pd.DataFrame:
    """Return people who all differ by the same between each two levels."""
    return pd.DataFrame(
        {"person": f"s{i}", "level": level, "y": 0.7 * i + by * j}
        for i in range(PEOPLE)
        for j, level in enumerate(levels)
    )


def test_where_everybody_differs_alike_ranks_decide() -> None:
    x = [0.7 * i for i in range(PEOPLE)]
    compared = compare_paired([v + 1 for v in x], x)

    assert isinstance(compared.test, SignedRank)
    assert compared.normality is None
    assert compared.significant
    assert 2 / 2**PEOPLE == pytest.approx(compared.p)
    assert "all 10 are 1 → no, Wilcoxon signed-rank test" in compared.path()
    assert compared.row()["shapiro_p"] is None


def test_of_more_conditions_that_differ_alike_ranks_decide() -> None:
    question = Question("conditions", dv="y", within=("level",), subject="person")
    outcome = answer(alike("abc"), question)

    assert 0.001 > outcome.p()
    assert 3 == len(outcome.contrasts)
    assert any(s.startswith("Is there an error to test against") for s in map(str, outcome.path))


def test_where_nobody_differs_there_is_nothing_to_test() -> None:
    with pytest.raises(ConstantResponse, match="is 0 in all 10 rows; there is nothing to test"):
        compare_paired(list(range(PEOPLE)), list(range(PEOPLE)))


@pytest.mark.parametrize(
    ("test", "levels", "said"),
    [
        ("t", "ab", "in all 10 pairs, so t has no error .* take the test wilcoxon or sign"),
        ("rm", "ab", r"tests of ranks need none \(friedman, of two levels wilcoxon"),
        ("lmm", "ab", "tests of ranks need no error"),
        ("lmm", "abc", "tests of ranks need no error"),
    ],
)
def test_a_test_that_needs_an_error_names_one_that_does_not(
    test: str, levels: str, said: str
) -> None:
    question = Question(test, dv="y", within=("level",), subject="person")
    with pytest.raises(ConstantResponse, match=said):
        answer(alike(levels), question)


def one_pair_alike(by: float) -> pd.DataFrame:
    """Return people who all differ by the same between b and a, and not between c and these."""
    return pd.DataFrame(
        {"person": f"s{i:02d}", "level": level, "y": 1.3 * i + add}
        for i, chance in enumerate(
            [0.3, -0.8, 1.1, 0.2, -0.4, 0.9, -1.2, 0.6, -0.1, 0.5, 1.4, -0.7]
        )
        for level, add in (("a", 0.0), ("b", by), ("c", 4.0 + chance))
    )


@pytest.mark.parametrize("by", [1.0, 0.0])
@pytest.mark.parametrize("posthoc", ["holm", "tukey", "mvt"])
def test_a_pair_without_spread_is_named_and_the_others_are_compared(
    posthoc: str, by: float
) -> None:
    """Float noise for an error gave t = −94906265 and dz = −10¹⁵; none at all, no contrasts."""
    question = Question("rm", dv="y", within=("level",), subject="person", posthoc=posthoc)
    outcome = answer(one_pair_alike(by), question)

    assert ["a − c", "b − c"] == [c["contrast"] for c in outcome.contrasts]
    assert (
        "a − b not compared: y differs by the same amount in all subjects, so t has no error "
        "(tests of ranks need none)"
    ) in outcome.notes


@pytest.mark.parametrize("by", [1.0, 0.0])
def test_of_conditions_of_which_two_differ_alike_ranks_decide(by: float) -> None:
    question = Question("conditions", dv="y", within=("level",), subject="person")
    outcome = answer(one_pair_alike(by), question)

    assert "Friedman's test" == outcome.title
    assert 0.001 > outcome.p()
    step = next(s for s in map(str, outcome.path) if "Is there an error" in s)
    assert "none between a and b → no, Friedman" in step
    p = {(c["level_1"], c["level_2"]): c["p"] for c in outcome.contrasts}
    assert (2 / 2**12 if by else 1.0) == p["a", "b"]
    assert 0.01 > max(p["a", "c"], p["b", "c"])


def test_equal_conditions_do_not_keep_others_from_being_ranked() -> None:
    """Nobody erred in two of three conditions: Friedman found that and stopped at its pairs."""
    question = Question("friedman", dv="y", within=("level",), subject="person")
    outcome = answer(one_pair_alike(0.0), question)

    equal = next(c for c in outcome.contrasts if (c["level_1"], c["level_2"]) == ("a", "b"))
    assert (0.0, 0, 1.0, 0.0) == (equal["V"], equal["n_nonzero"], equal["p"], equal["effect_size"])
    assert equal["effect_ci_low"] is None
    assert "V = 0.0, z = 0.00, p = 1.000 (exact), r_rb = 0.00, n = 12 (12 zero)" in str(
        outcome.contrast_sentences[0]
    )


@pytest.mark.parametrize("test", ["paired", "wilcoxon", "t", "sign"])
def test_an_equal_pair_does_not_keep_other_pairs_from_being_tested(test: str) -> None:
    question = Question(test, dv="y", within=("level",), subject="person", bayes=test == "t")
    outcome = answer(one_pair_alike(0.0), question)

    assert [("a", "c"), ("b", "c")] == [(r["first"], r["second"]) for r in outcome.rows]
    assert 0.01 > max(r["p_adjusted"] for r in outcome.rows)
    assert outcome.sentences[-1].startswith("a − b: not compared; ")
    assert "nothing to" in outcome.sentences[-1]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (alike("ab"), "does not vary within subjects beyond the effects"),
        (alike("abc"), "does not vary within subjects beyond the effects"),
        (one_pair_alike(1.0), "some conditions by the same amount in all subjects"),
        (one_pair_alike(0.0), "some conditions by the same amount in all subjects"),
    ],
)
def test_estimating_equations_need_an_error_too(rows: pd.DataFrame, said: str) -> None:
    """They gave F = −23582485321503640, p undefined, or an internal error."""
    question = Question("gee", dv="y", within=("level",), subject="person")
    with pytest.raises(ConstantResponse, match=f"{said}.* tests of ranks need no error"):
        answer(rows, question)


def test_a_difference_that_all_have_is_drawn_as_one_point() -> None:
    columns = {name: group["y"].to_numpy() for name, group in one_pair_alike(1.0).groupby("level")}
    _, lower = estimation_plot(columns).axes
    assert "1\n[1, 1]" in [text.get_text() for text in lower.texts]


def groups(small: int) -> Iterator[dict[str, Any]]:
    for name, mean, size in (("a", 0.0, 8), ("b", 5.0, 8), ("c", 9.0, small)):
        for i in range(size):
            yield {"person": f"{name}{i}", "group": name, "y": mean + (i * 0.37) % 1}


@pytest.mark.parametrize("small", [2, 8])
@pytest.mark.parametrize(
    ("test", "posthoc"),
    [("kruskal", ""), ("anova", "tukey"), ("anova", "holm"), ("welch", ""), ("welch", "holm")],
)
def test_a_group_of_two_is_compared_and_has_no_effect_size(
    test: str, posthoc: str, small: int
) -> None:
    question = Question(test, dv="y", between=("group",), subject="person", posthoc=posthoc)
    outcome = answer(pd.DataFrame(groups(small)), question)

    assert 0.01 > outcome.p()
    assert 3 == len(outcome.contrasts)
    of_two = [c for c in outcome.contrasts if "c" in str(c.get("contrast", c.get("level_2")))]
    assert 2 == len(of_two)
    # a mean's effect is in the spread within all groups, a rank's in that of the two
    lacks_effect = small == 2 and test != "anova"
    assert {lacks_effect} == {c.get("effect_size") is None for c in of_two}
    assert all(isinstance(c["p_adjusted"], float) for c in of_two)


@pytest.mark.parametrize(
    ("always", "p", "is_equivalent"),
    [(0.2, 0.5**PEOPLE, True), (0.0, 0.5**PEOPLE, True), (0.5, 1.0, False), (-0.7, 1.0, False)],
)
def test_who_all_differ_alike_are_equivalent_exactly_within_the_bounds(
    always: float, p: float, is_equivalent: bool
) -> None:
    y = [0.7 * i for i in range(PEOPLE)]
    made = tost_paired([v + always for v in y], y, low=-0.5, high=0.5)
    alone = tost_one_sample([always] * PEOPLE, low=-0.5, high=0.5)

    assert (pytest.approx(p), is_equivalent) == (made.p, made.is_equivalent)
    assert (pytest.approx(p), is_equivalent) == (alone.p, alone.is_equivalent)
    assert pytest.approx((always, always)) == (made.interval.low, made.interval.high)
    assert "without exception" in made.sentence()
    assert "exact sign tests" in made.sentence()
    assert (None, None, None) == tuple(made.row()[name] for name in ("t_low", "t_high", "df"))


def test_two_groups_that_do_not_vary_are_compared_with_bounds_by_ranks() -> None:
    made = tost_independent([1.2] * 4, [1.0] * 6, low=-0.5, high=0.5)
    # wilcox.test(rep(.7, 4) + 1:4 * 1e-9, rep(0, 6) + 1:6 * 1e-9, alternative = "greater")$p.value
    assert pytest.approx(0.0047619047619047615) == made.p == made.p_low
    assert made.is_equivalent


def test_bounds_in_standard_deviations_need_one() -> None:
    with pytest.raises(ConstantResponse, match="have no size"):
        tost_one_sample([0.2] * PEOPLE, low=-0.5, high=0.5, unit="sd")


def test_a_report_says_that_who_all_differ_alike_are_equivalent() -> None:
    question = Question("tost", dv="y", within=("level",), subject="person", low=-1.5, high=1.5)
    outcome = answer(alike("ab"), question)
    assert outcome.row()["is_equivalent"]
    assert "nothing varies, so that t has no error: exact tests take its place" in outcome.notes
