"""Mixed models: complete data give the ANOVA, people may differ, fallbacks are said."""

import numpy as np
import pytest

from tests.analysis.statistics.designs import Frame, changed, mixed_frame, rows, within_frame
from visavis.analysis.statistics import art_anova, mixed_anova, rm_anova
from visavis.analysis.statistics.errors import (
    ConstantResponse,
    MissingValue,
    NotNumeric,
    TooFewSubjects,
    UnknownColumn,
    UnknownMethod,
)
from visavis.analysis.statistics.gee import gee
from visavis.analysis.statistics.lmm import linear_mixed

TWO = {"subject": "subject", "within": ("A", "B")}


def differing(rng: np.random.Generator, n: int = 16) -> Frame:
    """Return 16 × 2 × 3 cells without any effect, in which people differ in A."""
    frame = within_frame(0, n)
    person = np.repeat(np.arange(n), 6)
    slopes = rng.normal(size=n)[person] * np.where(frame["A"] == "a1", 0.5, -0.5)
    frame["y"] = rng.normal(size=6 * n) + rng.normal(size=n)[person] + 2 * slopes
    return frame


@pytest.mark.parametrize("seed", range(5))
def test_a_mixed_model_of_complete_cells_is_the_repeated_measures_anova(seed: int) -> None:
    """Also where a variance comes out below zero, as in most of these data without slopes."""
    frame = within_frame(seed)
    for expected, found in zip(
        rm_anova(frame, "y", correction="none", **TWO).effects,
        mixed_anova(frame, "y", **TWO).effects,
        strict=True,
    ):
        assert (expected.F, expected.df2) == pytest.approx((found.F, found.df2), rel=1e-5)


def test_aligned_ranks_of_complete_cells_have_the_same_error_in_the_mixed_model() -> None:
    frame = within_frame(3)
    expected = art_anova(frame, "y", **TWO)
    found = art_anova(frame, "y", error="mixed", **TWO)
    for one, other in zip(expected.effects, found.effects, strict=True):
        assert (one.F, one.df2) == pytest.approx((other.F, other.df2), rel=1e-5)


def test_missing_cells_keep_the_error_rate_where_people_differ_in_the_effect() -> None:
    rng = np.random.default_rng(5)
    hits = {"slopes": 0, "intercept": 0}
    for _ in range(200):
        frame = differing(rng)
        left = rows(frame, np.sort(rng.permutation(96)[:88]))
        for random in hits:
            model = mixed_anova(left, "y", random=random, **TWO)
            hits[random] += model.effect("A").p < 0.05
    assert hits["slopes"] <= 20  # .05 of 200, and 3 standard errors
    assert hits["intercept"] >= 30  # why the random intercept alone is not the default


def test_the_error_term_names_what_people_may_differ_in() -> None:
    left = rows(within_frame(1), np.arange(1, 48))
    assert "random intercept and effects of A and B" in mixed_anova(left, "y", **TWO).sentence() + (
        mixed_anova(left, "y", **TWO).provenance.error_term
    )
    alone = mixed_anova(left, "y", random="intercept", **TWO)
    assert alone.provenance.error_term.startswith("random intercept per subject")
    with pytest.raises(UnknownMethod, match="take a random intercept"):
        mixed_anova(left, "y", ddf="satterthwaite", **TWO)


@pytest.mark.parametrize(
    ("n", "levels", "within", "reason"),
    [
        (8, (1, 3), ("B",), "the slope of the only factor is the residual"),
        (4, (2, 3), ("A", "B"), "4 subjects do not determine the covariances of 4 effects"),
    ],
)
def test_too_few_rows_or_people_for_the_maximal_model_fall_back_and_say_so(
    n: int, levels: tuple[int, int], within: tuple[str, ...], reason: str
) -> None:
    model = linear_mixed(within_frame(2, n, levels), "y", subject="subject", within=within)
    assert "components" == model.random
    assert reason in model.steps[0]
    assert any("random effects simplified" in note for note in model.provenance.notes)


def test_a_singular_maximal_model_falls_back_and_says_so() -> None:
    rng = np.random.default_rng(3)
    person = np.repeat(np.arange(12), 20)
    noise = rng.normal(size=(12, 2, 10))
    noise -= noise.mean(axis=2, keepdims=True)  # people do not differ in A at all
    frame = {
        "subject": person,
        "A": np.tile(np.repeat(["a", "b"], 10), 12),
        "y": noise.ravel() + rng.normal(size=12)[person],
    }
    model = linear_mixed(frame, "y", subject="subject", within=("A",))
    assert "components" == model.random
    assert "singular" in model.steps[0]
    assert any("variance of subject × A came out below zero" in n for n in model.provenance.notes)


def test_a_variance_below_zero_is_told_of_cells_as_of_single_trials() -> None:
    """People differ by less in B than chance, which is the noise of A × B, makes them."""
    rng = np.random.default_rng(3)
    cells = rng.normal(size=(12, 2, 3))
    cells -= 0.5 * cells.mean(axis=(1), keepdims=True)
    frame = {
        "subject": np.repeat(np.arange(12), 6),
        "A": np.tile(np.repeat(["a", "b"], 3), 12),
        "B": np.tile(["x", "y", "z"], 24),
        "y": cells.ravel() + np.repeat(rng.normal(size=12), 6),
    }
    model = mixed_anova(frame, "y", subject="subject", within=("A", "B"))
    assert any(
        "the variance of subject × B came out below zero" in n for n in model.provenance.notes
    )


def test_single_trials_of_one_factor_give_the_paired_t_squared() -> None:
    rng = np.random.default_rng(8)
    person = np.repeat(np.arange(14), 12)
    a = np.tile(np.repeat([0, 1], 6), 14)
    y = rng.normal(size=168) + rng.normal(size=14)[person] + rng.normal(size=14)[person] * a
    model = linear_mixed(
        {"s": person, "A": a, "y": y}, "y", subject="s", within=("A",), random="components"
    )
    means = y.reshape(14, 2, 6).mean(axis=2)
    d = means[:, 1] - means[:, 0]
    expected = d.mean() ** 2 / (d.var(ddof=1) / 14)
    assert (expected, 13) == pytest.approx((model.effect("A").F, model.effect("A").df2), rel=1e-6)
    contrast = model.contrasts("A").contrasts[0]
    assert -d.mean() == pytest.approx(contrast.estimate)


def test_a_missing_trial_is_refused_unless_the_rows_that_are_there_may_stand() -> None:
    frame = within_frame(1)
    twice = {k: np.tile(v, 2) for k, v in frame.items()}
    twice["y"] = twice["y"] + np.random.default_rng(0).normal(size=96)
    holed = changed(twice, "y", 4, float("nan"))
    with pytest.raises(MissingValue, match=r"row 5 \(subject S00, A a1, B b1\)"):
        linear_mixed(holed, "y", **TWO)
    model = linear_mixed(holed, "y", missing="mixed", **TWO)
    assert 95 == model.design.y.size
    assert ("1 rows without y",) == model.provenance.dropped


def test_a_model_of_groups_alone_is_refused() -> None:
    with pytest.raises(UnknownColumn, match="within factor"):
        linear_mixed(mixed_frame(), "y", subject="subject", within=(), between=("G",))


def test_equations_of_scores_are_hotellings_test_but_for_the_small_sample_correction() -> None:
    frame = within_frame(4, 10, (1, 3))
    model = gee(frame, "y", subject="subject", within=("B",))
    y = np.asarray(frame["y"]).reshape(10, 3)
    d = y[:, :2] - y[:, 2:]
    S = np.cov(d.T)
    T2 = 10 * d.mean(axis=0) @ np.linalg.solve(S, d.mean(axis=0))
    expected = T2 * (10 - 2) / (9 * 2) * 9 / 10  # residuals / (1 − 1/n) twice, over n instead n − 1
    assert (expected, 8) == pytest.approx((model.effect("B").F, model.effect("B").df2))


@pytest.mark.parametrize(
    ("family", "value", "message"),
    [("binomial", 2, "0 or 1"), ("poisson", -1, "a count"), ("poisson", 0.5, "a count")],
)
def test_responses_outside_a_family_name_their_row(family: str, value: float, message: str) -> None:
    frame = mixed_frame(0, (6, 6))
    frame["y"] = (np.arange(36) % 7 < 3).astype(float)
    with pytest.raises(NotNumeric, match=f"row 8.*{message}"):
        gee(changed(frame, "y", 7, value), "y", subject="subject", within=("B",), family=family)


def test_a_condition_in_which_all_answered_alike_is_refused() -> None:
    frame = mixed_frame(0, (6, 6))
    frame["y"] = np.where(frame["B"] == "b1", 1.0, (np.arange(36) % 7 < 3).astype(float))
    with pytest.raises(ConstantResponse, match="all 12 rows of B b1"):
        gee(frame, "y", subject="subject", within=("B",), family="binomial")


def test_too_few_people_for_a_term_are_refused() -> None:
    with pytest.raises(TooFewSubjects, match="more than 3 subjects"):
        gee(within_frame(1, 3, (1, 4)), "y", subject="subject", within=("B",))
