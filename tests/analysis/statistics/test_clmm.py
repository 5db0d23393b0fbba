"""Cumulative link mixed models: what follows from the model, and what they refuse.

Their numbers are compared with R's in `tests/reference/stats/cl*.json`.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import special

from tests.analysis.statistics.designs import Frame, changed, mixed_frame, within_frame
from visavis.analysis.statistics.clmm import clmm
from visavis.analysis.statistics.cumulative_link import CumulativeFit, fit_cumulative
from visavis.analysis.statistics.design import Codes
from visavis.analysis.statistics.errors import (
    ConstantResponse,
    NotConverged,
    NotNumeric,
    TooFewSubjects,
    UnknownColumn,
    UnknownMethod,
)
from visavis.analysis.statistics.results import Array

TWO = {"subject": "subject", "within": ("A", "B")}


def rated(frame: Frame) -> Frame:
    """Return a frame whose response is cut to ratings from 1 to 5."""
    return {**frame, "y": np.clip(np.round(np.asarray(frame["y"]) + 2.6), 1, 5)}


def test_any_rising_names_of_the_categories_give_the_same_tests() -> None:
    frame = rated(within_frame(1, 12))
    renamed = {**frame, "y": np.exp(frame["y"]) - 90}
    model, other = (clmm(f, "y", **TWO) for f in (frame, renamed))
    assert [e.F for e in model.effects] == pytest.approx([e.F for e in other.effects], rel=1e-6)
    assert model.fit.log_likelihood == pytest.approx(other.fit.log_likelihood, abs=1e-8)


def test_a_scale_turned_round_turns_the_odds_ratio_round() -> None:
    frame = rated(within_frame(2, 12))
    turned = {**frame, "y": 6 - frame["y"]}
    ratios = []
    for data in (frame, turned):
        (pair,) = clmm(data, "y", **TWO).contrasts("A").contrasts
        assert pair.effect is not None
        ratios.append(pair.effect.value)
    assert 1 == pytest.approx(ratios[0] * ratios[1], rel=1e-5)


def test_two_categories_of_two_groups_are_the_odds_of_their_counts() -> None:
    y = np.repeat([0.0, 1.0, 0.0, 1.0], [12, 8, 5, 15])
    frame = {"g": np.repeat(["a", "b"], 20), "y": y}
    model = clmm(frame, "y", between=("g",))
    expected = special.logit(8 / 20) - special.logit(15 / 20)
    (pair,) = model.contrasts("g").contrasts
    assert expected == pytest.approx(pair.estimate, rel=1e-6)
    null = 40 * np.log(1) + 23 * np.log(23 / 40) + 17 * np.log(17 / 40)
    full = 8 * np.log(0.4) + 12 * np.log(0.6) + 15 * np.log(0.75) + 5 * np.log(0.25)
    assert 2 * (full - null) == pytest.approx(model.effect("g").chi2, rel=1e-6)
    assert "Cumulative link model (logit)" == model.provenance.test


def test_the_integral_over_people_is_the_one_that_a_fine_grid_gives() -> None:
    frame = rated(within_frame(3, 6, (1, 3)))
    model = clmm(frame, "y", subject="subject", within=("B",))
    assert model.fit.sigma > 0.1
    u = np.linspace(-9, 9, 4001)
    bounds = np.concatenate([[-np.inf], model.fit.thresholds, [np.inf]])
    category = np.searchsorted(np.array(model.categories), np.asarray(frame["y"]))
    beta = np.append(model.fit.beta, -model.fit.beta.sum())
    total = 0.0
    for person in np.unique(frame["subject"]):
        product = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
        for i in np.flatnonzero(frame["subject"] == person):
            eta = beta[int(frame["B"][i][1])] + model.fit.sigma * u
            high, low = bounds[category[i] + 1] - eta, bounds[category[i]] - eta
            product = product * (special.expit(high) - special.expit(low))
        total += np.log(np.trapezoid(product, u))
    assert total == pytest.approx(model.fit.log_likelihood, abs=1e-7)


def _people_who_differ(rng: np.random.Generator) -> dict[str, Any]:
    """Return ratings of twelve people who differ in an effect that is 0 on average."""
    own = rng.normal(size=(12, 1, 1)) + rng.normal(0, 1.2, (12, 2, 1))
    y = np.clip(np.round(3 + own + rng.logistic(0, 0.6, (12, 2, 10))), 1, 5)
    place = np.indices(y.shape)
    return {"s": place[0].ravel(), "A": place[1].ravel(), "y": y.ravel()}


def test_people_who_differ_in_the_effect_are_not_taken_for_it() -> None:
    rng = np.random.default_rng(5)
    robust = alike = 0
    for _ in range(25):
        frame = _people_who_differ(rng)
        effect = clmm(frame, "y", subject="s", within=("A",)).effect("A")
        robust += effect.p < 0.05
        alike += effect.chi2_p < 0.05
    assert robust <= 3 < 7 <= alike


def test_a_condition_at_the_end_of_the_scale_is_named() -> None:
    frame = rated(mixed_frame(0, (6, 6)))
    frame["y"] = np.where(frame["B"] == "b2", 5, np.minimum(frame["y"], 4))
    with pytest.raises(ConstantResponse, match=r"5 in all rows of .*B b2"):
        clmm(frame, "y", subject="subject", within=("B",))


def test_categories_that_a_condition_parts_completely_have_no_estimate() -> None:
    frame = {"g": np.repeat(["a", "b"], 10), "y": np.tile([1.0, 2.0], 10)}
    frame["y"] = np.where(frame["g"] == "b", frame["y"] + 2, frame["y"])
    with pytest.raises(NotConverged, match=r"y: .*no finite estimate"):
        clmm(frame, "y", between=("g",))


def test_measures_and_designs_without_factors_are_refused() -> None:
    with pytest.raises(NotNumeric, match="48 values"):
        clmm(within_frame(1), "y", **TWO)
    with pytest.raises(UnknownColumn, match="factor"):
        clmm(rated(within_frame(1)), "y", subject="subject")
    with pytest.raises(UnknownColumn, match="names the subject"):
        clmm(rated(within_frame(1)), "y", within=("A",))


def test_lost_ratings_are_left_out_when_asked() -> None:
    frame = changed(rated(within_frame(1, 10)), "y", 4, float("nan"))
    model = clmm(frame, "y", missing="mixed", **TWO)
    assert 59 == model.design.y.size
    assert np.isfinite([e.F for e in model.effects]).all()


def slopes_frame(seed: int, n: int = 20, trials: int = 4) -> Frame:
    """Return ratings 1 to 5 of people who differ in A (SD 1 of the difference) and in B."""
    rng = np.random.default_rng(seed)
    own, of_a = rng.normal(size=(n, 1, 1, 1)), rng.normal(0.4, 1, (n, 2, 1, 1))
    of_b = rng.normal(0, 0.8, (n, 1, 3, 1))
    y = np.clip(np.round(3 + own + of_a + of_b + rng.logistic(0, 0.6, (n, 2, 3, trials))), 1, 5)
    place = np.indices(y.shape)
    labels = [np.array([f"{c}{i}" for i in place[at].ravel()]) for at, c in enumerate("sab")]
    return {"s": labels[0], "A": labels[1], "B": labels[2], "y": y.ravel()}


def people_by_grid(y: Codes, eta: Array, Z: Array, subject: Codes, fit: CumulativeFit) -> float:
    """Return the log-likelihood of ratings 0..k−1 by a fine grid over two random effects."""
    u = np.linspace(-7, 7, 561)
    first, second = (g.ravel() for g in np.meshgrid(u, u, indexing="ij"))
    # Not by Cholesky: where both effects go together, rounding makes the spread indefinite.
    sd = float(np.sqrt(fit.spread[0, 0]))
    slope = float(fit.spread[1, 0]) / sd
    rest = float(np.sqrt(max(0.0, fit.spread[1, 1] - slope**2)))
    b = np.stack([sd * first, slope * first + rest * second])
    bounds = np.concatenate([[-np.inf], fit.thresholds, [np.inf]])
    weight = np.exp(-(first**2 + second**2) / 2) / (2 * np.pi) * (u[1] - u[0]) ** 2
    total = 0.0
    for person in np.unique(subject):
        density = weight
        for i in np.flatnonzero(subject == person):
            at = eta[i] + Z[i] @ b
            high, low = special.expit(bounds[y[i] + 1] - at), special.expit(bounds[y[i]] - at)
            density = density * (high - low)
        total += float(np.log(density.sum()))
    return total


def test_quadrature_over_slopes_is_the_integral_that_a_fine_grid_gives() -> None:
    frame = slopes_frame(1, 8, 2)
    model = clmm(frame, "y", subject="s", within=("A",), random="A", nodes=21)
    y = np.asarray(frame["y"], dtype=np.intp) - int(min(model.categories))
    a = np.where(np.asarray(frame["A"]) == "a0", 1.0, -1.0)
    Z = np.stack([np.ones(a.size), a], axis=1)
    subject = np.unique(np.asarray(frame["s"]), return_inverse=True)[1]
    expected = people_by_grid(y, a * model.fit.beta[0], Z, subject, model.fit)
    assert expected == pytest.approx(model.fit.log_likelihood, abs=1e-6)


def test_more_nodes_bring_laplace_to_the_same_estimates_where_people_answer_often() -> None:
    frame = slopes_frame(2, 8, 20)
    laplace, fine = (
        clmm(frame, "y", subject="s", within=("A",), random="A", nodes=nodes) for nodes in (0, 15)
    )
    assert fine.fit.beta == pytest.approx(laplace.fit.beta, rel=0.01)
    assert fine.fit.spread == pytest.approx(laplace.fit.spread, rel=0.03)
    assert fine.fit.log_likelihood != pytest.approx(laplace.fit.log_likelihood, abs=1e-3)


def test_laplace_gives_the_printed_estimates_of_the_bitterness_of_wine() -> None:
    """Christensen, A tutorial on fitting cumulative link mixed models (of R's ordinal)."""
    path = Path(__file__).parents[2] / "reference" / "stats" / "clmm_wine.json"
    columns = json.loads(path.read_text(encoding="utf-8"))["data"]["columns"]
    X = np.stack(
        [np.array(columns["temp"]) == "warm", np.array(columns["contact"]) == "yes"], axis=1
    ).astype(float)
    judge = np.unique(columns["s"], return_inverse=True)[1]
    fit = fit_cumulative(np.array(columns["y"]) - 1, X, judge, np.ones((72, 1)), nodes=1)
    assert [-1.6237, 1.5134, 4.2285, 6.0888] == pytest.approx(fit.thresholds, abs=6e-5)
    assert [3.0630, 1.8349] == pytest.approx(fit.beta, abs=6e-5)
    assert [0.5954, 0.5125] == pytest.approx(np.sqrt(np.diag(fit.covariance)), abs=6e-5)
    assert 1.131 == pytest.approx(fit.sigma, abs=6e-4)
    assert -81.57 == pytest.approx(fit.log_likelihood, abs=6e-3)


def test_people_who_differ_in_an_effect_are_no_effect_by_likelihood_with_a_slope_of_it() -> None:
    rng = np.random.default_rng(5)
    alike = slopes = 0
    for _ in range(25):
        frame = _people_who_differ(rng)
        two = {"subject": "s", "within": ("A",)}
        alike += clmm(frame, "y", **two).effect("A").chi2_p < 0.05
        slopes += clmm(frame, "y", random="A", **two).effect("A").chi2_p < 0.05
    assert slopes <= 4 < 7 <= alike


def test_the_order_of_levels_and_people_changes_no_slope() -> None:
    frame = slopes_frame(3, 10)
    order = np.random.default_rng(0).permutation(len(frame["y"]))
    turned = {name: np.asarray(values)[order] for name, values in frame.items()}
    model, other = (
        clmm(f, "y", subject="s", within=("A", "B"), random="A+B", levels=levels)
        for f, levels in ((frame, None), (turned, {"B": ["b2", "b0", "b1"]}))
    )
    assert model.fit.log_likelihood == pytest.approx(other.fit.log_likelihood, abs=1e-6)
    assert model.effect("B").F == pytest.approx(other.effect("B").F, rel=1e-4)
    (said,) = (n for n in model.provenance.notes if "effect of B" in n)
    (again,) = (n for n in other.provenance.notes if "effect of B" in n)
    assert sorted(said.split(": ")[1].removesuffix(" (logit scale)").split("; ")) == sorted(
        again.split(": ")[1].removesuffix(" (logit scale)").split("; ")
    )


def test_slopes_that_cannot_be_told_are_refused() -> None:
    frame = slopes_frame(4, 10, 1)
    with pytest.raises(TooFewSubjects, match=r"60 rows do not determine 10 × 6 random effects"):
        clmm(frame, "y", subject="s", within=("A", "B"), random="A+B+A:B")
    with pytest.raises(UnknownMethod, match="no factor 'C'"):
        clmm(frame, "y", subject="s", within=("A", "B"), random="C")
    grouped = {**frame, "G": np.where(np.asarray(frame["s"]) < "s5", "g1", "g2")}
    with pytest.raises(UnknownMethod, match="only within factors"):
        clmm(grouped, "y", subject="s", within=("A",), between=("G",), random="G")
    with pytest.raises(UnknownMethod, match="4 random effects"):
        clmm(frame, "y", subject="s", within=("A", "B"), random="A+B", nodes=5)


def test_the_maximal_model_leaves_out_the_interaction_that_single_ratings_do_not_tell() -> None:
    model = clmm(slopes_frame(6, 24, 1), "y", subject="s", within=("A", "B"), random="maximal")
    assert "slopes of A and B per s" in model.provenance.error_term
    assert (4, 4) == model.fit.spread.shape
