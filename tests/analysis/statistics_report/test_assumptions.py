"""Residuals a test takes for normal, and the figure of them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.statistics_report import Question, answer
from visavis.analysis.statistics_report.assumptions import draw_assumptions, residuals
from visavis.analysis.statistics_report.outcome_files import write_outcome


def people(n: int = 12) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    frame = pd.DataFrame([(s, a) for s in range(n) for a in "xyz"], columns=["who", "a"])
    frame["y"] = rng.normal(size=n)[frame["who"]] * 5 + (frame["a"] == "z") + rng.normal(size=3 * n)
    return frame


def test_residuals_of_conditions_are_what_neither_cell_nor_person_explains() -> None:
    frame = people()
    numbers = residuals(answer(frame, Question("rm", dv="y", within=("a",), subject="who")))
    assert numbers is not None
    y = frame.pivot_table(index="who", columns="a", values="y").to_numpy()
    expected = y - y.mean(axis=0) - y.mean(axis=1, keepdims=True) + y.mean()
    assert expected.ravel() == pytest.approx(numbers["residual"].to_numpy())


def test_residuals_of_groups_keep_what_people_differ_in() -> None:
    frame = people().query("a == 'x'").assign(g=["p", "q"] * 6)
    numbers = residuals(answer(frame, Question("t", dv="y", between=("g",), subject="who")))
    assert numbers is not None
    by_group = frame.groupby("g")["y"].std()
    assert by_group.to_dict() == pytest.approx(numbers.groupby("cell")["residual"].std().to_dict())


def test_rank_tests_and_constant_residuals_have_no_figure() -> None:
    frame = people()
    request = Question("friedman", dv="y", within=("a",), subject="who")
    assert draw_assumptions(answer(frame, request)) is None


def test_the_figure_is_written_and_replaced(tmp_path: Path) -> None:
    frame = people()
    write_outcome(answer(frame, Question("rm", dv="y", within=("a",), subject="who")), tmp_path)
    assert (tmp_path / "assumptions.svg").is_file()
    request = Question("friedman", dv="y", within=("a",), subject="who")
    write_outcome(answer(frame, request), tmp_path)
    assert not (tmp_path / "assumptions.svg").exists()


@pytest.mark.parametrize(
    ("test", "roles"),
    [("rm", {"within": ("a",), "subject": "who"}), ("anova", {"between": ("a",)})],
)
def test_intervals_that_long_tails_widen_are_named(test: str, roles: dict[str, object]) -> None:
    frame = people(30)
    text = "take them to be, and are widened"
    question = Question(test, dv="y", **roles)  # type: ignore[arg-type]  # keywords by role
    assert not any(text in note for note in answer(frame, question).notes)
    frame["y"] = np.exp(frame["y"] / (2 if test == "anova" else 1))
    (note,) = [note for note in answer(frame, question).notes if text in note]
    assert "the noncentral intervals of" in note
    assert "η²p" in note


@pytest.mark.parametrize(("is_normal", "noted"), [(True, False), (False, True)])
def test_coefficients_that_take_ratings_for_normal_say_where_they_are_not(
    is_normal: bool, noted: bool
) -> None:
    rng = np.random.default_rng(6)
    noise = rng.normal(size=(30, 4))
    ratings = rng.normal(size=(30, 1)) + (noise if is_normal else np.exp(1.3 * noise))
    thing, rater = np.indices(ratings.shape)
    rated = pd.DataFrame({"clip": thing.ravel(), "who": rater.ravel(), "y": ratings.ravel()})
    icc = answer(rated, Question("icc", dv="y", within=("who",), subject="clip"))
    assert noted == any("residuals are not normal" in note for note in icc.notes)
