"""Choices between two: abilities, ties, places, groups, and what cannot be estimated."""

from collections.abc import Mapping
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.statistics import errors
from analysis.statistics.bradley_terry import bradley_terry

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
    made = bradley_terry(frame, "y", **ROLES)
    won = sum((v > 0) == (f == "b") for v, f in zip(frame["y"], frame["first"], strict=True)) / len(
        frame["y"]
    )
    a, b = (x.ability for x in made.abilities)
    assert np.log(won / (1 - won)) == pytest.approx(b - a)
    assert 0.0 == pytest.approx(a + b)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_turning_all_pairs_round_changes_nothing_but_the_place(seed: int, has_ties: bool) -> None:
    frame = choices(12, seed=seed, tie=0.5 if has_ties else 0.0, place=0.3)
    turned = {**frame, "first": frame["second"], "second": frame["first"], "y": -frame["y"]}
    try:
        made = bradley_terry(frame, "y", side=True, **ROLES)
    except errors.NotConverged:
        return
    again = bradley_terry(turned, "y", side=True, **ROLES)
    assert [a.ability for a in made.abilities] == pytest.approx(
        [a.ability for a in again.abilities], abs=1e-7
    )
    assert made.effects[0].p == pytest.approx(again.effects[0].p, rel=1e-6)
    assert made.first_place == pytest.approx(-(again.first_place or 0.0), abs=1e-7)


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
    made = bradley_terry(both, "y", between="g", **ROLES)
    assert ["first:second", "first:second:g"] == [e.name for e in made.effects]
    assert made.effects[1].p < 0.01
    assert made.effects[0].p > 0.05


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
    made = bradley_terry(frame, "y", missing="listwise", **ROLES)
    assert ("1 rows without y",) == made.provenance.dropped
    frame["second"][0] = frame["first"][0]
    made = bradley_terry(frame, "y", missing="listwise", **ROLES)
    assert "1 rows of an item beside itself" in made.provenance.dropped
