"""Choices between two: abilities, ties, places, groups, and what cannot be estimated."""

from collections.abc import Mapping
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special

from visavis.analysis.statistics import errors
from visavis.analysis.statistics.bradley_terry import BradleyTerry, bradley_terry

LIKES = {"a": 0.0, "b": 0.4, "c": 1.0}
ROLES = {"first": "first", "second": "second", "subject": "who"}


def choices(
    n: int,
    likes: Mapping[str, float] = LIKES,
    *,
    seed: int = 1,
    differ: float = 0.0,
    tie: float = 0.0,
    place: float = 0.0,
) -> dict[str, Any]:
    """Return every ordered pair judged by n people; `differ` is the SD of what they like."""
    rng = np.random.default_rng(seed)
    rows = []
    for who in range(n):
        own = {item: v + rng.normal(0, differ) for item, v in likes.items()}
        for a, b in permutations(likes, 2):
            lead = own[a] - own[b] + place + rng.logistic()
            vote = 0 if abs(lead) < tie else int(np.sign(lead))
            rows.append((f"S{who}", a, b, vote, "g1" if who % 2 else "g2"))
    return {
        name: np.array(column, dtype=object)
        for name, column in zip(
            ("who", "first", "second", "y", "g"), zip(*rows, strict=True), strict=True
        )
    }


def test_an_ability_is_the_logit_of_the_share_where_two_are_compared() -> None:
    frame = choices(40, {"a": 0.0, "b": 0.8})
    model = bradley_terry(frame, "y", **ROLES)
    won = sum((v > 0) == (f == "b") for v, f in zip(frame["y"], frame["first"], strict=True)) / len(
        frame["y"]
    )
    a, b = (x.ability for x in model.abilities)
    assert np.log(won / (1 - won)) == pytest.approx(b - a)
    assert 0.0 == pytest.approx(a + b)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_turning_all_pairs_round_changes_nothing_but_the_place(seed: int, has_ties: bool) -> None:
    frame = choices(12, seed=seed, tie=0.5 if has_ties else 0.0, place=0.3)
    turned = {**frame, "first": frame["second"], "second": frame["first"], "y": -frame["y"]}
    try:
        model = bradley_terry(frame, "y", side=True, **ROLES)
    except errors.NotConverged:
        return
    again = bradley_terry(turned, "y", side=True, **ROLES)
    assert [a.ability for a in model.abilities] == pytest.approx(
        [a.ability for a in again.abilities], abs=1e-7
    )
    assert model.effects[0].p == pytest.approx(again.effects[0].p, rel=1e-6)
    assert model.first_place == pytest.approx(-(again.first_place or 0.0), abs=1e-7)


def test_people_who_like_different_things_do_not_make_an_effect() -> None:
    alike = {"a": 0.0, "b": 0.0, "c": 0.0}
    found = [
        bradley_terry(choices(16, alike, seed=s, differ=1.5), "y", **ROLES).effects[0]
        for s in range(150)
    ]
    assert sum(e.chi2_p < 0.05 for e in found) > 30
    assert sum(e.p < 0.05 for e in found) < 16


def test_groups_that_like_opposite_things_are_told() -> None:
    one, other = choices(14, seed=3), choices(14, {"a": 1.0, "b": 0.4, "c": 0.0}, seed=4)
    other["who"] = np.array([f"T{w}" for w in other["who"]], dtype=object)
    one["g"][:], other["g"][:] = "young", "old"
    both = {k: np.concatenate([one[k], other[k]]) for k in one}
    model = bradley_terry(both, "y", between="g", **ROLES)
    assert ["first:second", "first:second:g"] == [e.name for e in model.effects]
    assert model.effects[1].p < 0.01
    assert model.effects[0].p > 0.05


def test_preferences_in_a_circle_do_not_fit_one_scale() -> None:
    rows = [("ab", 1), ("bc", 1), ("ca", 1)] * 9 + [("ab", -1), ("bc", -1), ("ca", -1)]
    frame = {
        "first": [p[0] for p, _ in rows],
        "second": [p[1] for p, _ in rows],
        "y": [v for _, v in rows],
        "who": [f"S{i}" for i in range(len(rows))],
    }
    fit = bradley_terry(frame, "y", **ROLES).fit
    assert fit is not None
    assert 1 == fit.df
    assert fit.p < 0.001


def test_an_item_never_preferred_is_named() -> None:
    frame = choices(12, {**LIKES, "bad": -99.0})
    with pytest.raises(errors.NotConverged, match="bad: never preferred"):
        bradley_terry(frame, "y", **ROLES)
    frame = choices(12, {**LIKES, "best": 99.0})
    with pytest.raises(errors.NotConverged, match="a, b, c: never preferred"):
        bradley_terry(frame, "y", **ROLES)


def test_zero_or_one_does_not_say_which() -> None:
    frame = choices(12)
    with pytest.raises(errors.NotNumeric, match="-1 where second was"):
        bradley_terry({**frame, "y": np.maximum(frame["y"], 0)}, "y", **ROLES)


def test_a_missing_choice_is_an_error_or_left_out_and_told() -> None:
    frame = choices(12)
    frame["y"][4] = None
    with pytest.raises(errors.MissingValue, match="row 5"):
        bradley_terry(frame, "y", **ROLES)
    model = bradley_terry(frame, "y", missing="listwise", **ROLES)
    assert ("1 rows without y",) == model.provenance.dropped
    frame["second"][0] = frame["first"][0]
    model = bradley_terry(frame, "y", missing="listwise", **ROLES)
    assert "1 rows of an item beside itself" in model.provenance.dropped


def by_grid(frame: dict[str, Any], model: BradleyTerry, beta: np.ndarray) -> float:
    """Return Davidson's log-likelihood of choices among a, b and c, by a grid over what people
    like: abilities of b and c above a, normal with the covariance estimated.
    """
    u = np.linspace(-6, 6, 121)
    first, second = (g.ravel() for g in np.meshgrid(u, u, indexing="ij"))
    spread = model.model.spread
    if spread[0, 1] == 0 and spread[0, 0] == spread[1, 1]:  # one SD of each item's ability
        spread = spread[0, 0] * np.array([[2.0, 1.0], [1.0, 2.0]])
    own = np.linalg.cholesky(spread) @ np.stack([first, second])
    abilities = {"a": 0 * first, "b": beta[0] + own[0], "c": beta[1] + own[1]}
    tie = beta[-1] if model.tie is not None else -np.inf
    weight = np.exp(-(first**2 + second**2) / 2) / (2 * np.pi) * (u[1] - u[0]) ** 2
    total = 0.0
    for who in np.unique(frame["who"]):
        density = weight
        for i in np.flatnonzero(frame["who"] == who):
            half = (abilities[frame["first"][i]] - abilities[frame["second"][i]]) / 2
            log_odds = np.stack([0 * half + tie, half, -half])
            density = density * np.exp(log_odds[frame["y"][i]] - special.logsumexp(log_odds, 0))
        total += float(np.log(density.sum()))
    return total


@pytest.mark.parametrize("random", ["alike", "maximal"])
@pytest.mark.parametrize("tie", [0.0, 0.7])
def test_what_people_like_is_integrated_as_a_fine_grid_does(random: str, tie: float) -> None:
    frame = choices(16, seed=4, differ=0.8, tie=tie)
    model = bradley_terry(frame, "y", random=random, nodes=21, **ROLES)
    peak = by_grid(frame, model, model.model.beta)
    assert peak == pytest.approx(model.model.log_likelihood, abs=1e-6)
    for step in np.eye(model.model.beta.size) * 0.05:
        assert peak > max(by_grid(frame, model, model.model.beta + sign * step) for sign in (-1, 1))


def test_the_odds_of_a_person_are_larger_than_those_of_all() -> None:
    frame = choices(60, seed=5, differ=1.5)
    plain, own = (bradley_terry(frame, "y", random=r, **ROLES) for r in ("", "alike"))
    assert (np.abs(own.model.beta) > 1.1 * np.abs(plain.model.beta)).all()
    assert 1.5 == pytest.approx(np.sqrt(own.model.spread[0, 0]), rel=0.35)
    assert any("SD between people of the log ability of an item" in n for n in own.provenance.notes)
    assert "random abilities per who, robust errors of people" == own.provenance.error_term


def test_people_who_like_different_things_do_not_make_an_effect_by_likelihood_either() -> None:
    alike = own = 0
    for seed in range(30):
        frame = choices(24, dict.fromkeys("abc", 0.0), seed=seed, differ=2.5)
        alike += bradley_terry(frame, "y", **ROLES).effects[0].chi2_p < 0.05
        own += bradley_terry(frame, "y", random="alike", **ROLES).effects[0].chi2_p < 0.05
    assert own <= 4 < 7 <= alike


def test_which_item_comes_first_changes_nothing_for_people_who_differ() -> None:
    frame = choices(15, seed=6, differ=1.0, tie=0.5)
    for random in ("alike", "maximal"):
        model, turned = (
            bradley_terry(frame, "y", random=random, items=items, **ROLES)
            for items in ("abc", "cab")
        )
        assert model.model.log_likelihood == pytest.approx(turned.model.log_likelihood, abs=1e-6)
        assert model.effects[0].F == pytest.approx(turned.effects[0].F, rel=1e-4)


def test_a_spread_that_cannot_be_told_is_refused() -> None:
    with pytest.raises(errors.UnknownMethod, match="alike, maximal"):
        bradley_terry(choices(9), "y", random="slopes", **ROLES)
    with pytest.raises(errors.TooFewSubjects, match="--random alike"):
        bradley_terry(choices(3, dict.fromkeys("abcd", 0.0)), "y", random="maximal", **ROLES)
    five = choices(9, dict.fromkeys("abcde", 0.0))
    with pytest.raises(errors.UnknownMethod, match="quadrature over 5 items"):
        bradley_terry(five, "y", random="alike", nodes=9, **ROLES)
