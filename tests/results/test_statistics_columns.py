"""Whatever test a comparison makes, every column of its tables is described."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.statistics_report import TESTS
from visavis.lab.errors import LabError
from visavis.results.analysis import answer_comparison
from visavis.results.tables.dictionary import PEOPLE, STATISTICS
from visavis.study.comparisons import AGREEMENT, Compare
from visavis.study.measures import Measure

LEVELS = {"a": ("x", "y"), "b": ("u", "v", "w"), "g": ("g1", "g2"), "h": ("h0", "h1", "h2")}
DESIGNS: tuple[dict[str, Any], ...] = (
    {"within": "a"}, {"within": "b"}, {"within": ("a", "b")}, {"between": "g"}, {"between": "h"},
    {"within": "a", "between": "g"}, {"within": "b", "between": "g"},
)  # fmt: skip
MODELS = ("lmm", "gee", "clmm", "bradleyterry")
NOT_OF_MEANS = ("spearman", "pearson", "tost", "cronbach", "binomial")
"""Tests that ask for more than a measure and its factors."""


@pytest.fixture(scope="module")
def trials() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    return pd.DataFrame(
        {
            "participant": f"P{person:02d}",
            "a": a,
            "b": b,
            "g": f"g{1 + person % 2}",
            "h": f"h{person % 3}",
            "even": rng.normal() + (a == "x"),
            "skewed": rng.exponential() ** 3,
        }
        for person in range(12)
        for a in LEVELS["a"]
        for b in LEVELS["b"]
        for _ in range(2)
    )


@pytest.mark.parametrize("test", ["", *(t for t in TESTS if t not in (*MODELS, *AGREEMENT))])
@pytest.mark.parametrize("dv", ["even", "skewed"])
def test_every_column_of_a_test_is_described(test: str, dv: str, trials: pd.DataFrame) -> None:
    known = {column.name for column in (*STATISTICS, *PEOPLE)}
    made = 0
    for design in DESIGNS:
        compare = Compare(dv, test=test, **design)
        try:
            finding = answer_comparison(
                compare, trials, {dv: Measure(dv, "1", dv)}, LEVELS, is_simulated=True
            )
        except LabError:
            continue  # the test does not take this design
        if finding.outcome is None:
            continue
        made += 1
        names = {n for row in finding.outcome.rows for n in row}
        names |= {n for row in finding.outcome.contrasts for n in row if n != "family"}
        assert set() == names - known, (test, design)
    assert bool(made) != (test in NOT_OF_MEANS)


@pytest.mark.parametrize(
    ("test", "options", "raters"),
    [
        ("icc", {"kind": "ICC3"}, "participant"),
        ("krippendorff", {"scale": "interval"}, "participant"),
        ("kappa", {"scale": "ordinal"}, "a"),
    ],
)
def test_every_column_of_agreement_is_described(
    test: str, options: dict[str, Any], raters: str, trials: pd.DataFrame
) -> None:
    rated = trials.assign(even=np.round(trials["even"]))
    compare = Compare(
        "even",
        within=("a", "b"),
        test=test,
        options=tuple(options.items()),
        raters=raters,
        claim="they agree",
    )
    known = {column.name for column in (*STATISTICS, *PEOPLE)}
    finding = answer_comparison(
        compare, rated, {"even": Measure("even", "1", "even")}, LEVELS, is_simulated=True
    )
    assert finding.outcome is not None
    assert set() == {name for row in finding.outcome.rows for name in row} - known
    assert compare.terms == tuple(term.name for term in finding.terms)


@pytest.mark.parametrize("test", ["lmm", "gee", "clmm"])
def test_every_column_of_a_model_is_described(test: str, trials: pd.DataFrame) -> None:
    rated = trials.assign(even=np.clip(np.round(trials["even"]), -1, 1))
    compare = Compare("even", within=("a", "b"), model=test)
    finding = answer_comparison(
        compare, rated, {"even": Measure("even", "1", "even")}, LEVELS, is_simulated=True
    )
    assert finding.outcome is not None
    assert any(row["effect_size"] is not None for row in finding.outcome.contrasts)
    known = {column.name for column in (*STATISTICS, *PEOPLE)}
    rows = (*finding.outcome.rows, *finding.outcome.contrasts)
    assert set() == {n for row in rows for n in row if n != "family"} - known


def test_a_comparison_of_choices_names_one_term_and_the_odds_of_items() -> None:
    rng = np.random.default_rng(1)
    pairs = [f"{a}|{b}" for a in "uvw" for b in "uvw" if a != b]
    votes = pd.DataFrame(
        {"participant": f"P{i:02d}", "pair": p, "vote": float(np.sign(rng.normal(p < "v", 1)))}
        for i in range(15)
        for p in pairs
    )
    compare = Compare("vote", within="pair", model="bradleyterry", options=[("side", True)])
    finding = answer_comparison(
        compare,
        votes,
        {"vote": Measure("vote", "1", "Vote")},
        {"pair": tuple(pairs)},
        is_simulated=True,
    )
    assert ("pair",) == compare.terms == tuple(t.name for t in finding.terms)
    assert ["u \N{EN DASH} v", "u \N{EN DASH} w", "v \N{EN DASH} w"] == [
        c.name for c in finding.contrasts
    ]
    first = finding.contrasts[0]
    assert first.difference == first.row["estimate"]
    known = {column.name for column in (*STATISTICS, *PEOPLE)}
    assert finding.outcome is not None
    rows = (*finding.outcome.rows, *finding.outcome.contrasts)
    assert set() == {n for row in rows for n in row if n != "family"} - known
    two = Compare("vote", within=("left", "right"), between="group", model="bradleyterry")
    assert ("left:right", "left:right:group") == two.terms


@pytest.mark.parametrize(
    ("test", "options"),
    [
        ("t", {"bayes": True}),
        ("rm", {"bayes": True}),
        ("t", {"low": -1.0, "high": 1.0}),
        ("rm", {"covariates": ("skewed_of_person",)}),
    ],
)
def test_every_column_that_an_option_adds_is_described(
    test: str, options: dict[str, Any], trials: pd.DataFrame
) -> None:
    own = trials.groupby("participant")["skewed"].transform("mean")
    compare = Compare("even", within="a", test=test, options=tuple(options.items()))
    finding = answer_comparison(
        compare,
        trials.assign(skewed_of_person=own),
        {"even": Measure("even", "1", "even")},
        LEVELS,
        is_simulated=True,
    )
    assert finding.outcome is not None, finding.why_not
    known = {column.name for column in (*STATISTICS, *PEOPLE)}
    assert set() == {name for row in finding.outcome.rows for name in row} - known
