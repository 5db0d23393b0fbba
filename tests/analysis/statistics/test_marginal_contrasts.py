"""Contrasts come from the model that the test fits; R's emmeans is the oracle of every number.

The values of `tests/reference/stats/contrasts_*.json` are compared in `test_reference_results.py`.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.analysis.statistics.designs import mixed_frame, within_frame
from tests.reference.stats_factorial import Case, fitted
from visavis.analysis import statistics
from visavis.analysis.statistics.errors import UnknownMethod
from visavis.analysis.statistics_report import Question, answer

FOLDER = Path(__file__).parents[2] / "reference" / "stats"


def case(name: str) -> Case:
    return Case(json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8")))


def of_r(of: Case, term: list[str], procedure: str = "contrasts_pairs") -> dict[str, list[float]]:
    """Return what R's emmeans gives for a term, cells of other factors counting alike."""
    return next(
        e["expected"]
        for e in of.file["results"]
        if (e["procedure"], e["term"], e["weights"]) == (procedure, term, "equal")
    )


@pytest.mark.parametrize("test", ["anova", "rm"])
def test_contrasts_beside_a_second_between_factor_are_those_of_the_model(test: str) -> None:
    """One-way weighted means, errors and df gave other signs and other p."""
    name, factors = {
        "anova": ("contrasts_between_two", ("A", "B")),
        "rm": ("contrasts_mixed_two", ("G", "H")),
    }[test]
    of = case(name)
    question = Question(
        test,
        dv="y",
        between=factors,
        within=tuple(of.design["within"]),
        subject="s",
        posthoc="holm",
        always_posthoc=True,
        levels=of.levels,
    )
    outcome = answer(pd.DataFrame(of.frame), question)
    for factor in factors:
        expected = of_r(of, [factor])
        rows = [c for c in outcome.contrasts if c["family"] == factor]
        for ours, theirs in (("estimate", "estimate"), ("df", "df"), ("p_adjusted", "p_holm")):
            assert expected[theirs] == pytest.approx([row[ours] for row in rows], rel=1e-6)


def test_contrasts_of_an_interaction_compare_cells_and_differences_of_differences() -> None:
    of = case("contrasts_mixed_one")
    question = Question(
        "rm",
        dv="y",
        between=("G",),
        within=("A", "B"),
        subject="s",
        always_posthoc=True,
        levels=of.levels,
    )
    outcome = answer(pd.DataFrame(of.frame), question)
    families = [str(c["family"]) for c in outcome.contrasts]
    assert 15 == families.count("G:A")
    assert 9 == families.count("G:B, differences of differences")
    double = [c for c in outcome.contrasts if c["family"] == "G:B, differences of differences"]
    expected = of_r(of, ["G", "B"], "contrasts_interaction")
    assert sorted(np.abs(expected["t"])) == pytest.approx(
        sorted(abs(float(c["t"])) for c in double)
    )


def test_a_family_of_any_contrasts_is_adjusted_by_the_multivariate_t_of_mvtnorm() -> None:
    """R: 1 − pmvt of the contrasts' correlation, at an absolute error of 2e-6."""
    compared = 0
    for name in ("contrasts_between_one", "contrasts_mixed_one", "contrasts_strata_within"):
        of = case(name)
        for entry in of.file["results"]:
            if entry["procedure"] != "contrasts_hypotheses" or "p_mvt" not in entry:
                continue
            made = statistics.linear_hypotheses(
                fitted(of, entry),
                entry["term"],
                entry["hypotheses"],
                adjust="mvt",
                **({"error": entry["error"]} if "error" in entry else {}),
            )
            found = [c.p_adjusted for c in made.contrasts]
            assert entry["p_mvt"] == pytest.approx(found, abs=2e-4)
            compared += len(found)
    assert 14 == compared


def test_the_multivariate_t_of_all_pairs_of_alike_means_is_tukeys() -> None:
    table = statistics.rm_anova(within_frame(9, 12), "y", subject="subject", within=("A", "B"))
    tukey, mvt = (
        statistics.posthoc(table, "B", error="pooled", adjust=way) for way in ("tukey", "mvt")
    )
    for a, b in zip(tukey.contrasts, mvt.contrasts, strict=True):
        assert a.p_adjusted == pytest.approx(b.p_adjusted, abs=1e-6)
        assert a.interval is not None
        assert b.interval is not None
        assert a.interval.low == pytest.approx(b.interval.low, abs=1e-5)


def test_contrasts_without_a_common_model_have_no_multivariate_t() -> None:
    frame = {"g": np.repeat(["a", "b", "c"], 6), "y": np.arange(18.0) ** 1.5 % 7}
    with pytest.raises(UnknownMethod, match="no common model"):
        statistics.games_howell(frame, "y", factor="g", adjust="mvt")


def test_groups_weighted_by_cells_have_the_means_of_their_rows() -> None:
    of = case("contrasts_between_two")
    table = statistics.between_anova(of.frame, "y", between=("A", "B"), levels=of.levels)
    (pair,) = statistics.posthoc(table, "A", weights="cells").contrasts
    means = pd.DataFrame(of.frame).groupby("A")["y"].mean()
    assert means["a1"] - means["a2"] == pytest.approx(pair.estimate)
    (alike,) = statistics.posthoc(table, "A").contrasts
    assert alike.estimate != pytest.approx(pair.estimate)


def test_a_difference_of_groups_is_d_by_the_spread_within_all_groups_of_the_model() -> None:
    of = case("contrasts_between_two")
    table = statistics.between_anova(of.frame, "y", between=("A", "B"), levels=of.levels)
    (pair,) = statistics.posthoc(table, "A").contrasts
    frame = pd.DataFrame(of.frame)
    cells = frame.groupby(["A", "B"])["y"]
    sd = np.sqrt((cells.var() * (cells.size() - 1)).sum() / (len(frame) - 6))
    assert pair.effect is not None
    assert ("d", pytest.approx(pair.estimate / sd)) == (pair.effect.name, pair.effect.value)


def test_cells_of_other_groups_and_conditions_have_no_one_spread_and_no_effect_size() -> None:
    frame = mixed_frame(3, (6, 8))
    table = statistics.rm_anova(frame, "y", subject="subject", within=("B",), between=("G",))
    made = {c.label: c.effect for c in statistics.posthoc(table, "G:B").contrasts}
    assert made["g0,b0 − g1,b2"] is None
    within, between = made["g0,b0 − g0,b2"], made["g0,b1 − g1,b1"]
    assert within is not None
    assert between is not None
    assert ("dz", "d") == (within.name, between.name)
    frame_0 = pd.DataFrame(frame)
    wide = frame_0.pivot_table(index=["G", "subject"], columns="B", values="y")
    change = (wide["b0"] - wide["b2"]).groupby("G")
    sd = np.sqrt((change.var() * (change.size() - 1)).sum() / 12)
    assert change.mean()["g0"] / sd == pytest.approx(within.value)


def test_a_mixed_model_compares_the_cells_that_are_there() -> None:
    """With complete cells it is the ANOVA by strata."""
    frame = within_frame(5, 9)
    arguments = {"subject": "subject", "within": ("A", "B")}
    mixed = statistics.posthoc(statistics.mixed_anova(frame, "y", **arguments), "A")
    strata = statistics.posthoc(statistics.rm_anova(frame, "y", **arguments), "A")
    (a,), (b,) = mixed.contrasts, strata.contrasts
    assert (a.estimate, a.se, a.df) == pytest.approx((b.estimate, b.se, b.df), rel=1e-6)
    assert "d_total" == getattr(a.effect, "name", "")


def test_hypotheses_name_a_level_that_is_not_there() -> None:
    table = statistics.rm_anova(within_frame(5, 9), "y", subject="subject", within=("A", "B"))
    with pytest.raises(UnknownMethod, match="no level 'b9' of B; there are b0, b1, b2"):
        statistics.linear_hypotheses(table, "B", {"trend": {"b0": -1, "b9": 1}})
    with pytest.raises(UnknownMethod, match="trend: all weights are 0"):
        statistics.linear_hypotheses(table, "B", {"trend": {"b0": 0}})
    with pytest.raises(UnknownMethod, match="its own factors"):
        statistics.simple_effects(table, "B", "B")
