"""Cumulative link mixed models: what follows from the model, and what they refuse.

Their numbers are compared with R's in `tests/reference/stats/cl*.json`.
"""

import numpy as np
import pytest
from scipy import special

from analysis.statistics.clmm import clmm
from analysis.statistics.errors import ConstantResponse, NotConverged, NotNumeric, UnknownColumn
from tests.analysis.statistics.designs import Frame, changed, mixed_frame, within_frame

TWO = {"subject": "subject", "within": ("A", "B")}


def rated(frame: Frame) -> Frame:
    """Return a frame whose response is cut to ratings from 1 to 5."""
    return {**frame, "y": np.clip(np.round(np.asarray(frame["y"]) + 2.6), 1, 5)}


def test_any_rising_names_of_the_categories_give_the_same_tests() -> None:
    frame = rated(within_frame(1, 12))
    renamed = {**frame, "y": np.exp(frame["y"]) - 90}
    made, other = (clmm(f, "y", **TWO) for f in (frame, renamed))
    assert [e.F for e in made.effects] == pytest.approx([e.F for e in other.effects], rel=1e-6)
    assert made.fit.log_likelihood == pytest.approx(other.fit.log_likelihood, abs=1e-8)


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
    made = clmm(frame, "y", between=("g",))
    expected = special.logit(8 / 20) - special.logit(15 / 20)
    (pair,) = made.contrasts("g").contrasts
    assert expected == pytest.approx(pair.estimate, rel=1e-6)
    null = 40 * np.log(1) + 23 * np.log(23 / 40) + 17 * np.log(17 / 40)
    full = 8 * np.log(0.4) + 12 * np.log(0.6) + 15 * np.log(0.75) + 5 * np.log(0.25)
    assert 2 * (full - null) == pytest.approx(made.effect("g").chi2, rel=1e-6)
    assert "Cumulative link model (logit)" == made.provenance.test


def test_the_integral_over_people_is_the_one_that_a_fine_grid_gives() -> None:
    frame = rated(within_frame(3, 6, (1, 3)))
    made = clmm(frame, "y", subject="subject", within=("B",))
    assert made.fit.sigma > 0.1
    u = np.linspace(-9, 9, 4001)
    bounds = np.concatenate([[-np.inf], made.fit.thresholds, [np.inf]])
    category = np.searchsorted(np.array(made.categories), np.asarray(frame["y"]))
    beta = np.append(made.fit.beta, -made.fit.beta.sum())
    total = 0.0
    for person in np.unique(frame["subject"]):
        product = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
        for i in np.flatnonzero(frame["subject"] == person):
            eta = beta[int(frame["B"][i][1])] + made.fit.sigma * u
            high, low = bounds[category[i] + 1] - eta, bounds[category[i]] - eta
            product = product * (special.expit(high) - special.expit(low))
        total += np.log(np.trapezoid(product, u))
    assert total == pytest.approx(made.fit.log_likelihood, abs=1e-7)


def test_people_who_differ_in_the_effect_are_not_taken_for_it() -> None:
    rng = np.random.default_rng(5)
    robust = alike = 0
    for _ in range(25):
        own = rng.normal(size=(12, 1, 1)) + rng.normal(0, 1.2, (12, 2, 1))
        y = np.clip(np.round(3 + own + rng.logistic(0, 0.6, (12, 2, 10))), 1, 5)
        place = np.indices(y.shape)
        frame = {"s": place[0].ravel(), "A": place[1].ravel(), "y": y.ravel()}
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
    made = clmm(frame, "y", missing="mixed", **TWO)
    assert 59 == made.design.y.size
    assert np.isfinite([e.F for e in made.effects]).all()
