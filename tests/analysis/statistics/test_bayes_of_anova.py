"""Bayes factors of ANOVAs: those of R's BayesFactor 0.9.12-4.4."""

import numpy as np
import pandas as pd
import pytest

from tests.analysis.statistics.test_covariates import people
from visavis.analysis import statistics
from visavis.analysis.statistics.bayes import (
    bayes_text,
    jzs_anova_bayes_factor,
    jzs_bayes_factor,
)
from visavis.analysis.statistics_report import Question, answer
from visavis.lab.errors import UsageError


def _of_groups(y: str, group: str) -> float:
    means = people().groupby(["who", "g", "h"], as_index=False)["y"].mean()
    means["y2"] = means["y"] + 2 * (means["h"] == "z")
    table = statistics.between_anova(means, y, between=(group,), subject="who")
    return jzs_anova_bayes_factor(table.design)


def test_of_groups_it_is_that_of_r() -> None:
    # extractBF(anovaBF(y ~ h, d))$bf
    found = [_of_groups("y", "h"), _of_groups("y", "g"), _of_groups("y2", "h")]
    assert pytest.approx([0.31616547, 1.349125, 0.55183787], rel=5e-7) == found


def test_of_conditions_it_is_that_of_r_within_what_sampling_leaves() -> None:
    # anovaBF(y ~ m + who, d, whichRandom = "who", iterations = 400000); of two conditions five
    # runs gave 1.3677 to 1.4049
    table = statistics.rm_anova(people(), "y", subject="who", within=("m",))
    assert pytest.approx(8.0822556e10, rel=0.01) == jzs_anova_bayes_factor(table.design)


def test_of_two_groups_it_is_that_of_the_t_test() -> None:
    means = people().groupby(["who", "g"], as_index=False)["y"].mean()
    x, y = (means.loc[means["g"] == g, "y"].to_numpy() for g in "ab")
    t = statistics.independent_t(x, y).t
    assert pytest.approx(jzs_bayes_factor(t, x.size, y.size), rel=1e-6) == _of_groups("y", "g")


def test_the_more_there_is_no_effect_the_more_it_speaks_for_none() -> None:
    rng = np.random.default_rng(3)
    factors = []
    for n in (10, 40, 160):
        frame = pd.DataFrame({"s": np.repeat(range(n), 3), "m": list("abc") * n})
        frame["y"] = rng.normal(size=3 * n) + np.repeat(rng.normal(size=n), 3)
        cells = frame.groupby("m")["y"].transform("mean")  # the means are alike
        frame["y"] -= cells
        table = statistics.rm_anova(
            frame.assign(y=frame["y"] + 1e-9 * (frame["m"] == "a")), "y", subject="s", within=("m",)
        )
        factors.append(jzs_anova_bayes_factor(table.design))
    assert factors == sorted(factors, reverse=True)
    assert factors[-1] < 0.05 < factors[0] < 0.5


def test_a_report_gives_it_beside_the_test_of_one_factor() -> None:
    question = Question("rm", dv="y", within=("m",), subject="who", bayes=True)
    outcome = answer(people(), question)
    assert outcome.row("m")["BF10"] == pytest.approx(8.127e10, rel=1e-3)
    assert "BF₁₀ = 8.1e+10" in outcome.sentences[1]
    assert any("Cauchy priors of scale 0.5" in note for note in outcome.notes)
    with pytest.raises(UsageError, match="of one factor without covariates"):
        Question("rm", dv="y", within=("m",), between=("g",), subject="who", bayes=True)
    with pytest.raises(UsageError, match="of one factor without covariates"):
        Question("rm", dv="y", within=("m",), subject="who", bayes=True, covariates=("age",))
    with pytest.raises(UsageError, match="beside the tests t, rm, anova"):
        Question("art", dv="y", within=("m",), subject="who", bayes=True)


def test_a_factor_beyond_all_numbers_is_a_bound_in_the_text() -> None:
    assert bayes_text(float("inf")) == "BF₁₀ > 1e300"
    group = np.repeat(["a", "b", "c"], 600)
    noise = np.random.default_rng(1).normal(size=1800)
    rows = pd.DataFrame(
        {
            "participant": np.arange(1800).astype(str),
            "group": group,
            "y": noise + np.repeat([0.0, 2.0, 4.0], 600),
        }
    )
    table = statistics.between_anova(rows, "y", between=("group",), subject="participant")
    assert bayes_text(jzs_anova_bayes_factor(table.design)) == "BF₁₀ > 1e300"


def test_a_t_beyond_all_numbers_is_a_bound_in_the_text() -> None:
    factor = jzs_bayes_factor(400.0, 2000)
    assert float("inf") == factor
    assert "BF₁₀ > 1e300" in bayes_text(factor)
