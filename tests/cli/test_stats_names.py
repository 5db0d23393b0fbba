"""A test's printed name is that of the numbers beside it, also where variances and sizes differ."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from statsmodels.stats.oneway import anova_oneway
from typer.testing import CliRunner

from visavis.cli.main import app

RNG = np.random.default_rng(3)
SIZES, SDS = {"a": 6, "b": 9, "c": 18}, {"a": 3.0, "b": 2.0, "c": 1.0}
GROUPS = {k: (2 * RNG.normal(1.5, SDS[k], n)).round() / 2 for k, n in SIZES.items()}
"""In halves, so that there are ties."""
A, C = GROUPS["a"], GROUPS["c"]
FIRST, SECOND = RNG.normal(0, 1, 14), RNG.normal(0.9, 3, 14)


def exact_mann_whitney() -> float:
    """Return p by counting every division of the pooled ranks, ties as they are."""
    ranks = stats.rankdata([*A, *GROUPS["b"]])
    sums = np.array([sum(c) for c in combinations(ranks, len(A))])
    off = np.abs(sums - sums.mean())
    return float((off >= abs(ranks[: len(A)].sum() - sums.mean()) - 1e-9).mean())


def welch_anova() -> tuple[float, float]:
    found = anova_oneway(list(GROUPS.values()), use_var="unequal")
    return float(found.statistic), float(found.pvalue)


def pair(result: object) -> tuple[float, float]:
    return float(result.statistic), float(result.pvalue)  # type: ignore[attr-defined]


EXPECTED = {
    "t": ("ac", "Welch's t test", "t", pair(stats.ttest_ind(A, C, equal_var=False))),
    "mannwhitney": ("ab", "Mann-Whitney test", "", (np.nan, exact_mann_whitney())),
    "anova": ("abc", "Between-subject ANOVA", "F", pair(stats.f_oneway(*GROUPS.values()))),
    "welch": ("abc", "Welch's ANOVA", "F", welch_anova()),
    "kruskal": ("abc", "Kruskal-Wallis test", "H", pair(stats.kruskal(*GROUPS.values()))),
}
PAIRED = {
    "t": ("Paired t test", "t", pair(stats.ttest_rel(FIRST, SECOND))),
    "wilcoxon": ("Wilcoxon", "", (np.nan, stats.wilcoxon(FIRST, SECOND).pvalue)),
}


def answered(frame: pd.DataFrame, folder: Path, *words: str) -> tuple[str, pd.Series]:
    """Return what the command prints and the row that it writes."""
    frame.to_csv(folder / "data.csv", index=False)
    out = folder / "out"
    done = CliRunner().invoke(app, ["stats", str(folder / "data.csv"), *words, "-o", str(out)])
    assert 0 == done.exit_code, done.output
    return done.output, pd.read_csv(out / "tests.csv").iloc[0]


@pytest.mark.parametrize("test", EXPECTED)
def test_groups_of_unequal_size_and_spread_get_the_test_that_is_named(
    test: str, tmp_path: Path
) -> None:
    groups, name, column, (statistic, p) = EXPECTED[test]
    frame = pd.DataFrame([(g, y) for g in groups for y in GROUPS[g]], columns=["g", "y"])
    printed, row = answered(frame, tmp_path, "--test", test, "--dv", "y", "--between", "g")
    assert f"{name} of y" in printed
    assert p == pytest.approx(row["p"], rel=1e-9)
    if column:
        assert abs(statistic) == pytest.approx(abs(row[column]), rel=1e-9)


@pytest.mark.parametrize("test", PAIRED)
def test_pairs_of_unequal_spread_get_the_test_that_is_named(test: str, tmp_path: Path) -> None:
    name, column, (statistic, p) = PAIRED[test]
    frame = pd.DataFrame(
        {
            "s": np.tile(np.arange(14), 2),
            "c": ["x"] * 14 + ["z"] * 14,
            "y": [*FIRST, *SECOND],
        }
    )
    words = ("--test", test, "--dv", "y", "--within", "c", "--subject", "s")
    printed, row = answered(frame, tmp_path, *words)
    assert name in printed.splitlines()[0]
    assert p == pytest.approx(row["p"], rel=1e-6)
    if column:
        assert abs(statistic) == pytest.approx(abs(row[column]), rel=1e-6)


def test_students_and_welchs_p_lie_apart_on_these_groups() -> None:
    """Or the name could not be told from the numbers; and some values are tied."""
    assert len({*A, *GROUPS["b"]}) < len(A) + len(GROUPS["b"])
    student, welch = stats.ttest_ind(A, C).pvalue, EXPECTED["t"][3][1]
    assert abs(student - welch) > 0.05
    assert abs(EXPECTED["anova"][3][1] - EXPECTED["welch"][3][1]) > 0.01
