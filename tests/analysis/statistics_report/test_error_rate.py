"""Error rates of a test in data like those at hand: simulated studies without one effect."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.statistics_report import Question, answer, table_of, with_error_rates
from visavis.analysis.statistics_report.error_rate import _People, _without
from visavis.analysis.statistics_report.prepare import prepare, read
from visavis.lab.errors import UsageError

ART = Question("art", dv="y", within=("A", "B"), subject="s")
RM = Question("rm", dv="y", within=("A", "B"), subject="s")


def cells(y: np.ndarray) -> pd.DataFrame:
    rows = list(product(range(y.shape[0]), "xy", "pqr"))
    return pd.DataFrame(rows, columns=["s", "A", "B"]).assign(y=y.ravel())


def additive(seed: int = 2, n: int = 16) -> np.ndarray:
    rng = np.random.default_rng(seed)
    people = rng.normal(size=(n, 2, 3)) + rng.normal(size=(n, 1, 1))
    return people + np.array([0.0, 1.0, 2.0]) + np.array([[0.0], [1.2]])


def rates(frame: pd.DataFrame, question: Question, n: int = 120) -> dict[str, float]:
    made = with_error_rates(answer(frame, question), frame, np.random.default_rng(1), n_studies=n)
    return {str(row["term"]): row["rate"] for row in made.error_rates}


def test_a_test_that_holds_its_level_is_seen_to() -> None:
    found = rates(cells(additive()), RM)
    assert {"A", "B", "A:B"} == set(found)
    assert max(found.values()) < 0.12  # .05, and 3 standard errors of 120 studies


def test_aligned_ranks_near_a_ceiling_are_seen_to_leak_and_that_is_noted() -> None:
    frame = cells(np.clip(np.round(5 + 1.5 * additive()), 1, 9))
    outcome = with_error_rates(answer(frame, ART), frame, np.random.default_rng(1), n_studies=120)
    leak = outcome.error_rates[2]
    assert "A:B" == leak["term"]
    assert leak["rate"] > 0.14
    assert not leak["holds"]
    assert any(n.startswith("A:B: in ") and "too often" in n for n in outcome.notes)


def test_a_seed_repeats_the_rates() -> None:
    frame = cells(additive())
    assert rates(frame, RM, 20) == rates(frame, RM, 20)


def test_an_effect_is_taken_away_with_its_interactions_and_others_stay() -> None:
    means = np.random.default_rng(3).normal(size=(2, 3))
    without_a = _without(means, ["A", "B"], ("A",))
    assert np.allclose(without_a, without_a.mean(axis=0))
    assert np.allclose(means.mean(axis=0), without_a.mean(axis=0))
    additive_part = _without(means, ["A", "B"], ("A", "B"))
    assert np.allclose(means.mean(axis=1), additive_part.mean(axis=1))
    assert np.allclose(np.diff(additive_part, axis=0), np.diff(additive_part, axis=0)[0, 0])


def test_simulated_ratings_keep_bounds_ties_and_shares() -> None:
    frame = cells(np.clip(np.round(5 + 1.5 * additive(n=40)), 1, 9))
    design = read(prepare(table_of(frame), RM), RM)
    studies = list(_People(design, "s").studies(("A", "B"), np.random.default_rng(0), 30))
    made = pd.concat(studies)
    assert set(made["y"]) <= set(range(1, 10))
    expected = frame["y"].value_counts(normalize=True)
    found = made["y"].value_counts(normalize=True)
    assert expected.to_dict() == pytest.approx(found.reindex(expected.index).to_dict(), abs=0.04)


def test_unequal_groups_keep_their_sizes_and_spread() -> None:
    rng = np.random.default_rng(4)
    frame = pd.DataFrame({"g": ["few"] * 8 + ["many"] * 24})
    frame["y"] = np.where(frame["g"] == "few", 3.0, 1.0) * rng.normal(size=32)
    welch = Question("t", dv="y", between=("g",))
    student = Question("t", dv="y", between=("g",), equal_variances=True)
    assert rates(frame, welch, 150)["g"] < 0.11
    assert rates(frame, student, 150)["g"] > 0.12


def test_a_test_without_factors_has_no_such_rate() -> None:
    frame = cells(additive())
    with pytest.raises(UsageError, match="within or between factor"):
        rates(frame, Question("shapiro", dv="y"))


def test_models_of_single_trials_have_no_such_rate() -> None:
    frame = pd.concat([cells(additive()), cells(additive(3))])
    question = Question("lmm", dv="y", within=("A", "B"), subject="s", random="components")
    with pytest.raises(UsageError, match="one row per s and cell"):
        rates(frame, question)
