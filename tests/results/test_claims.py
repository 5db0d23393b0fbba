"""A claim is printed only in its own direction, whatever the test and the model."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tests.results.test_headlines import DISTANCE, GAZE, GROUP, PLACE, analysed, headlines
from visavis import Compare
from visavis.analysis.report import Verdict
from visavis.lab.errors import DesignError
from visavis.results.analysis import answer_comparison
from visavis.results.claims import answer_claim, published_agreement
from visavis.results.outputs import statistics_rows
from visavis.study.comparisons import published_f
from visavis.study.measures import Measure

GREATER = {"directed": 2.0, "near": 0.0, "left": 1.5, "middle": 1.4, "a": 1.0}
CLAIM = "Being looked at feels good"


def lifted(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return float(rng.normal(5, 1) + sum(GREATER.get(str(v), 0.0) for v in factors.values()))


def lowered(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return 12.0 - lifted(factors, rng)


def nothing(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return float(rng.normal(5, 1))


def rated(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return float(np.clip(round(lifted(factors, rng) - 2), 1, 9))


def rated_low(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return 10.0 - rated(factors, rng)


def chosen(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return float(rng.random() < (0.75 if factors["gaze"] == "directed" else 0.25))


def chosen_less(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
    return 1.0 - chosen(factors, rng)


WAYS: dict[str, dict[str, Any]] = {
    "paired": {"within": "gaze"},
    "t": {"within": "gaze", "test": "t"},
    "wilcoxon": {"within": "gaze", "test": "wilcoxon"},
    "sign": {"within": "gaze", "test": "sign"},
    "lmm": {"within": "gaze", "model": "lmm"},
    "art": {"within": ["gaze", "distance"], "expects": "gaze: directed > averted"},
    "rm": {"within": ["gaze", "distance"], "expects": "gaze: averted < directed", "test": "rm"},
    "mixed": {"within": "gaze", "between": "group", "expects": "gaze: directed > averted"},
}


def verdict(compare: Compare, value: Any) -> Verdict:
    """Return what the report says of the claim of a comparison."""
    factors = (
        [GAZE, GROUP]
        if compare.between == ("group",)
        else [f for f in (GAZE, DISTANCE, PLACE) if f.name in (*compare.within, *compare.between)]
    )
    said = headlines(analysed(factors, [compare], {"mood": value}))
    (one,) = (v for v in said if CLAIM[1:] in v.headline)
    return one


@pytest.mark.parametrize("way", WAYS)
def test_a_claim_that_comes_out_the_other_way_round_is_a_verdict_of_its_own(way: str) -> None:
    keywords = {"expects": "directed > averted", **WAYS[way]}
    compare = Compare("mood", claim=CLAIM, **keywords)

    shown, reversed_one = verdict(compare, lifted), verdict(compare, lowered)

    assert "found" == shown.status
    assert shown.headline.startswith(f"{CLAIM} (directed minus averted: ")
    assert "95% CI [" in shown.headline
    assert "reversed" == reversed_one.status
    start = f"Significant, but the other way round: directed minus averted: {chr(8722)}"
    assert reversed_one.headline.startswith(start)
    assert reversed_one.headline.endswith(f"{chr(8211)} claimed: being looked at feels good")


@pytest.mark.parametrize(
    ("model", "up", "down", "options"),
    [
        ("clmm", rated, rated_low, ()),
        ("gee", chosen, chosen_less, [("family", "binomial")]),
    ],
)
def test_models_of_ratings_and_choices_have_a_direction(
    model: Any, up: Any, down: Any, options: Any
) -> None:
    compare = Compare(
        "mood",
        within="gaze",
        model=model,
        options=options,
        claim=CLAIM,
        expects="directed > averted",
    )
    assert ["found", "reversed"] == [verdict(compare, value).status for value in (up, down)]


@pytest.mark.parametrize("test", ["t", "mannwhitney"])
def test_groups_have_a_direction(test: str) -> None:
    one = [verdict(Compare("mood", between="group", test=test, claim=CLAIM, expects=e), v)
           for e, v in (("a > b", lifted), ("a > b", lowered), ("b > a", lifted))]  # fmt: skip
    assert ["found", "reversed", "reversed"] == [v.status for v in one]


@pytest.mark.parametrize(
    ("expects", "status"),
    [
        ("left, middle > right", "found"),
        ("left > middle > right", "partly"),
        ("right < middle", "found"),
        ("right > left", "reversed"),
        ("middle > right > left", "reversed"),
        ("left > middle", "not_found"),
    ],
)
@pytest.mark.parametrize("test", ["", "friedman", "rm", "paired", "t"])
def test_of_more_levels_every_difference_expected_decides(
    test: str, expects: str, status: str
) -> None:
    compare = Compare("mood", within="place", test=test, claim=CLAIM, expects=expects)
    assert status == verdict(compare, lifted).status


def test_a_claim_about_levels_that_nothing_compared_is_undecided() -> None:
    """Everybody has just 1 more on the left: t has no error, and "not shown" would be untrue."""
    rows = pd.DataFrame(
        {"participant": f"P{i:02d}", "place": place, "mood": 1.3 * i + add}
        for i in range(12)
        for place, add in (("left", 1.0), ("middle", 0.0), ("right", -5.0 + (i * 0.37) % 1))
    )
    levels = {"place": ("left", "middle", "right")}
    for test, expects, status in (
        ("rm", "left > middle", "undecided"),
        ("rm", "left, middle > right", "found"),
        ("", "left > middle > right", "found"),
        ("", "middle > left", "reversed"),
    ):
        of = Compare("mood", within="place", test=test, expects=expects)
        measures = {"mood": Measure("mood", "1", "Mood")}
        answer = answer_claim(answer_comparison(of, rows, measures, levels, is_simulated=True))
        assert status == answer.status
        if status == "undecided":
            assert "no test compared left with middle, see the notes" == answer.why_not


@pytest.mark.parametrize("keywords", [{}, {"model": "lmm"}, {"within": ("far", "eyes")}])
def test_levels_of_whole_and_decimal_numbers_are_tested_under_their_own_names(
    keywords: dict[str, Any],
) -> None:
    """A table holds 0.5, 1 and 2 as 0.5, 1.0 and 2.0: no comparison over them was tested."""
    rng = np.random.default_rng(4)
    rows = pd.DataFrame(
        {"participant": f"P{i:02d}", "far": far, "eyes": eyes, "mood": far + rng.normal(0, 0.2)}
        for i in range(10)
        for far in (0.5, 1.0, 2.0)
        for eyes in ("averted", "directed")
    )
    levels: dict[str, tuple[Any, ...]] = {"far": (0.5, 1, 2), "eyes": ("averted", "directed")}
    measures = {"mood": Measure("mood", "1", "Mood")}
    of = Compare("mood", **{"within": "far", "expects": "far: 2 > 1 > 0.5", **keywords})
    finding = answer_comparison(of, rows, measures, levels, is_simulated=True)
    assert "" == finding.why_not
    assert "found" == answer_claim(finding).status


def test_an_interaction_is_shown_only_in_its_direction() -> None:
    def closer(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
        both = factors["gaze"] == "directed" and factors["distance"] == "near"
        return float(rng.normal(5, 1) + 3 * both)

    for near, status in (("near > far", "found"), ("far > near", "reversed")):
        expects = f"gaze: directed > averted; distance: {near}"
        compare = Compare("mood", within=["gaze", "distance"], claim=CLAIM, expects=expects)
        one = verdict(compare, closer)
        assert status == one.status
        first, second = near.split(" > ")
        assert f"directed minus averted, with {first} minus with {second}: " in one.headline


def test_nobody_preferring_is_no_preference() -> None:
    """0 of 10 people above the number, p = .002, was printed as "the hybrid is preferred"."""
    rows = pd.DataFrame({"participant": f"P{i}", "vote": -1.0 - 0.1 * i} for i in range(10))
    measures = {"vote": Measure("vote", "1", "vote")}
    for test in ("sign", "t"):
        of = Compare("vote", test=test, claim="the hybrid is preferred", expects="vote > 0")
        finding = answer_comparison(of, rows, measures, {}, is_simulated=True)
        assert finding.terms[0].is_significant
        assert "reversed" == answer_claim(finding).status


def test_items_are_claimed_in_their_order() -> None:
    rng = np.random.default_rng(3)
    ability = {"u": 1.5, "v": 0.0, "w": 0.0}
    rows = pd.DataFrame(
        {"participant": f"P{i:02d}", "pair": f"{a}|{b}", "vote": 1.0 if rng.random() < p else -1.0}
        for i in range(20)
        for a, b in (("u", "v"), ("w", "u"), ("v", "w"))
        for p in [1 / (1 + np.exp(ability[b] - ability[a]))] * 4
    )
    measures = {"vote": Measure("vote", "1", "vote")}
    levels = {"pair": ("u|v", "w|u", "v|w")}
    verdicts = {}
    for expects in ("u > v, w", "v > u", "w > v"):
        of = Compare("vote", within="pair", model="bradleyterry", claim="yes", expects=expects)
        finding = answer_comparison(of, rows, measures, levels, is_simulated=True)
        verdicts[expects] = answer_claim(finding)
    assert ["found", "reversed", "not_found"] == [v.status for v in verdicts.values()]
    odds = verdicts["u > v, w"].differences[0]
    other = verdicts["v > u"].differences[0]
    assert odds.value == pytest.approx(1 / other.value)
    assert odds.interval is not None
    assert odds.interval.low < odds.value < odds.interval.high


SIGNIFICANT = ("7.09", 1, 15)


@pytest.mark.parametrize(
    ("order", "value", "words", "agrees"),
    [
        ("directed > averted", lifted, "the same verdict, in the same direction", True),
        ("directed > averted", lowered, "significant in both, but the other way round", False),
        ("averted > directed", lowered, "the same verdict, in the same direction", True),
        ("", lifted, "the same verdict; which way is not printed", True),
    ],
)
def test_the_same_as_published_is_the_same_direction(
    order: str, value: Any, words: str, agrees: bool
) -> None:
    printed = published_f(*SIGNIFICANT, p="0.017", eta2p="0.32", is_significant=True, order=order)
    compare = Compare("mood", within=["gaze", "distance"], test="rm", published={"gaze": printed})
    found = analysed([GAZE, DISTANCE], [compare], {"mood": value})
    one = next(v for v in headlines(found) if "Published" in v.detail)
    # η²p has no direction: where that is the opposite, how alike the sizes are says nothing.
    size = "" if "other way" in words else "; the printed η²p lies outside our interval"
    assert f"({words}{size})" in one.detail
    row = next(r for r in statistics_rows(found[0]) if r["term"] == "gaze")
    assert (agrees, order) == (row["agrees_with_published"], row["published_order"])
    finding = found[0].findings[0]
    beside = published_agreement(finding, finding.terms[0])
    assert beside is not None
    assert agrees is beside.agrees


@pytest.mark.parametrize(
    ("p", "is_significant", "value", "words"),
    [
        ("0.4", False, nothing, "neither is significant, which shows no agreement"),
        ("0.4", False, lifted, "significant here alone"),
        ("0.017", True, nothing, "significant there alone"),
    ],
)
def test_nothing_found_twice_is_no_agreement(
    p: str, is_significant: bool, value: Any, words: str
) -> None:
    """Two studies in which nothing is significant were "the same verdict", as if they agreed."""
    printed = published_f("0.75", 1, 15, p=p, eta2p="0.05", is_significant=is_significant, order="")
    compare = Compare("mood", within=["gaze", "distance"], test="rm", published={"gaze": printed})
    found = analysed([GAZE, DISTANCE], [compare], {"mood": value})
    assert any(f"({words}" in headline.detail for headline in headlines(found))


def test_the_interval_of_a_headline_is_that_of_t() -> None:
    """Paired, and Welch's of groups; in mixed designs every group weighs alike."""
    for compare in (
        Compare("mood", within="gaze", test="t", expects="averted > directed"),
        Compare("mood", between="group", test="t", expects="a > b"),
    ):
        factors = [GAZE, GROUP] if compare.between else [GAZE]
        (finding,) = analysed(factors, [compare], {"mood": lifted})[0].findings
        (difference,) = answer_claim(finding).differences
        row = finding.terms[0].row
        assert difference.interval is not None
        assert (row["estimate"], row["ci_low"], row["ci_high"]) == pytest.approx(
            (difference.value, difference.interval.low, difference.interval.high)
        )


def test_in_a_mixed_design_every_group_weighs_alike() -> None:
    """Four people gain 2, two people gain 5: the mean over groups is 3.5, not 3."""
    gains = {"a": [1.0, 2.0, 3.0, 2.0], "b": [4.5, 5.5]}
    rows = pd.DataFrame(
        {
            "participant": f"{g}{i}",
            "group": g,
            "gaze": gaze,
            "mood": i + gain * (gaze == "directed"),
        }
        for g, values in gains.items()
        for i, gain in enumerate(values)
        for gaze in ("averted", "directed")
    )
    of = Compare("mood", "gaze", "group", test="rm", expects="gaze: directed > averted")
    finding = answer_comparison(
        of,
        rows,
        {"mood": Measure("mood", "1", "Mood")},
        {"gaze": ("averted", "directed"), "group": ("a", "b")},
        is_simulated=True,
    )
    (difference,) = answer_claim(finding).differences
    assert 3.5 == pytest.approx(difference.value)
    # Half of each group's mean: SE² = (s²a/4 + s²b/2)/4, df after Welch and Satterthwaite.
    variances = [np.var(gains["a"], ddof=1) / 16, np.var(gains["b"], ddof=1) / 8]
    df = sum(variances) ** 2 / (variances[0] ** 2 / 3 + variances[1] ** 2 / 1)
    half = stats.t.ppf(0.975, df) * np.sqrt(sum(variances))
    assert difference.interval is not None
    assert (3.5 - half, 3.5 + half) == pytest.approx(
        (difference.interval.low, difference.interval.high)
    )


def test_tables_say_what_became_of_a_claim() -> None:
    compare = Compare("mood", within="gaze", claim=CLAIM, expects="directed > averted")
    for value, status, sign in ((lifted, "found", 1), (lowered, "reversed", -1)):
        (row,) = statistics_rows(analysed([GAZE], [compare], {"mood": value})[0])
        assert (status, "directed > averted") == (row["claim_verdict"], row["expects"])
        low, high = row["claim_difference_ci_low"], row["claim_difference_ci_high"]
        assert low < row["claim_difference"] < high
        assert 0 < min(sign * low, sign * high)


@pytest.mark.parametrize("way", [w for w in WAYS if w != "mixed"])
def test_a_one_sided_test_has_half_the_p_and_finds_one_direction_only(way: str) -> None:
    keywords = {"expects": "directed > averted", **WAYS[way]}
    both = Compare("mood", claim=CLAIM, **keywords)
    one = replace(both, one_sided=True)
    factors = [f for f in (GAZE, DISTANCE) if f.name in both.within]

    def slightly(factors: Mapping[str, Any], rng: np.random.Generator) -> float:
        return float(rng.normal(5, 1) + 0.3 * (factors["gaze"] == "directed"))

    p = {}
    for name, compare in (("both", both), ("one", one)):
        (finding,) = analysed(factors, [compare], {"mood": slightly})[0].findings
        (term,) = (t for t in finding.terms if t.name == "gaze")
        (difference,) = answer_claim(finding).differences
        p[name] = term.p
    assert (p["both"] / 2 if difference.sign > 0 else 1 - p["both"] / 2) == pytest.approx(p["one"])
    shown, lowered_one = verdict(one, lifted), verdict(one, lowered)
    assert "found" == shown.status
    assert re.search(r"One-sided, as planned: p (= \.0|< \.001)", shown.detail)
    assert "reversed" == lowered_one.status


def test_r_gives_the_same_one_sided_p() -> None:
    """t.test(x, y, paired = TRUE, alternative = "greater"), binom.test(9, 12, alternative = …)."""
    x, y = [5.1, 4.2, 6.3, 5.8, 4.9, 6.1], [4.8, 4.4, 5.9, 5.1, 5.0, 5.2]
    rows = pd.DataFrame(
        {"participant": f"P{i}", "gaze": gaze, "mood": v}
        for gaze, values in (("directed", x), ("averted", y))
        for i, v in enumerate(values)
    )
    measures = {"mood": Measure("mood", "1", "Mood")}
    levels = {"gaze": ("averted", "directed")}
    for expects, expected in (
        ("directed > averted", 0.0586933975731),
        ("averted > directed", 0.941306602427),
    ):
        of = Compare("mood", within="gaze", test="t", expects=expects, one_sided=True)
        finding = answer_comparison(of, rows, measures, levels, is_simulated=True)
        assert expected == pytest.approx(finding.terms[0].p, abs=1e-9)


REFUSED = [
    ({"within": "gaze", "one_sided": True}, "is one-sided, which needs a direction"),
    ({"within": "gaze", "expects": "a > b, c", "one_sided": True}, "a direction between two"),
    ({"within": "gaze", "claim": "yes"}, "has no direction; say which level gives the greater"),
    ({"test": "sign", "claim": "yes"}, 'add expects="mood > 0" or expects="mood < 0"'),
    ({"test": "binomial", "claim": "yes"}, 'add expects="mood > 0.5"'),
    ({"test": "sign", "claim": "yes", "expects": "mood > 3"}, "it is tested against 0, so write"),
    ({"test": "sign", "claim": "yes", "expects": "joy > 0"}, 'expects="mood > 0"'),
    ({"within": "gaze", "expects": "directed"}, "which is no order of levels; say which level"),
    ({"within": "gaze", "expects": "a > b < c"}, "which is no order of levels"),
    ({"within": "gaze", "expects": "a > "}, "which is no order of levels"),
    ({"within": "gaze", "expects": "a > a"}, "names 'a' twice"),
    ({"within": ["gaze", "far"], "expects": "a > b"}, 'say of which: expects="gaze: a > b"'),
    ({"within": ["gaze", "far"], "expects": "fra: a > b"}, "'fra', which is no factor of it"),
    ({"within": "gaze", "expects": "gaze: a > b; c > d"}, "an interaction is written with two"),
    (
        {"within": "gaze", "test": "tost", "expects": "a > b"},
        "by tost has its own direction; leave expects= out",
    ),
    (
        {"within": ("x", "y"), "model": "bradleyterry", "expects": "x: a > b"},
        "a Bradley–Terry model orders the items",
    ),
]


@pytest.mark.parametrize(("keywords", "said"), REFUSED, ids=[str(r[0]) for r in REFUSED])
def test_a_claim_without_a_direction_is_refused_with_what_to_write(
    keywords: dict[str, Any], said: str
) -> None:
    with pytest.raises(DesignError) as refused:
        Compare("mood", **keywords)
    assert said in str(refused.value)
    assert str(refused.value).startswith("the comparison of mood")


def test_a_significant_published_result_says_which_way() -> None:
    with pytest.raises(DesignError, match='order="a > b", or order="" where the source'):
        published_f("7.09", 1, 15, p="0.017", eta2p="0.32", is_significant=True)
    assert "" == published_f("1.0", 1, 15, p="0.33", eta2p="0.06", is_significant=False).order
