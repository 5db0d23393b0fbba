from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.errors import DesignError
from visavis.protocol.plan.balance import balanced_blocks
from visavis.protocol.plan.orders import (
    Constraint,
    broken_rules,
    latin_square,
    never_next_to,
    no_more_than,
    shuffle,
    williams,
)


def rng(seed=0):
    return np.random.default_rng(seed)


def cells(text):
    return [{"x": c} for c in text]


def text(order):
    return "".join(cell["x"] for cell in order)


@given(st.integers(1, 12))
def test_latin_square_has_every_item_once_in_each_row_and_column(n):
    square = latin_square(n)
    for line in (*square, *square.T):
        assert list(range(n)) == sorted(line)


@given(st.integers(1, 12))
def test_williams_rows_are_permutations_and_places_are_equal(n):
    rows = williams(n)
    assert (n if n % 2 == 0 or n == 1 else 2 * n) == len(rows)
    for row in rows:
        assert list(range(n)) == sorted(row)
    for column in rows.T:
        assert 1 == len(set(Counter(column.tolist()).values()))


@given(st.integers(2, 12))
def test_williams_every_item_follows_every_other_equally_often(n):
    follows = Counter((int(a), int(b)) for row in williams(n) for a, b in pairwise(row))
    assert n * (n - 1) == len(follows)
    assert {1 if n % 2 == 0 else 2} == set(follows.values())


def test_a_square_of_nothing_is_refused():
    with pytest.raises(DesignError, match="at least one item"):
        latin_square(0)


@given(st.lists(st.sampled_from("abc"), min_size=1, max_size=14), st.integers(1, 3), st.integers(0))
@settings(deadline=None)
def test_shuffled_keeps_the_rule_or_says_no_order_exists(items, k, seed):
    # A level of count m can be separated into runs of at most k iff m <= k (others + 1).
    most = max(Counter(items).values())
    possible = most <= k * (len(items) - most + 1)
    rule = no_more_than(k, "x")
    if possible:
        order = shuffle(cells(items), [rule], rng(seed))
        assert sorted(items) == sorted(text(order))
        assert [] == broken_rules(order, [rule])
    else:
        with pytest.raises(DesignError, match="exists"):
            shuffle(cells(items), [rule], rng(seed))


def test_the_only_possible_order_is_found():
    assert "ababababababababa" == text(
        shuffle(cells("a" * 9 + "b" * 8), [no_more_than(1, "x")], rng())
    )


def test_allowed_orders_come_equally_often():
    counts = Counter(
        text(shuffle(cells("aabb"), [no_more_than(1, "x")], rng(seed))) for seed in range(400)
    )
    assert {"abab", "baba"} == set(counts)
    assert abs(counts["abab"] - 200) < 60  # six standard deviations


def test_a_chain_of_forbidden_neighbours_is_solved_by_search():
    letters = "abcdefghij"
    allowed = set(pairwise(letters))
    forbidden = [(a, b) for a in letters for b in letters if (a, b) not in allowed]
    assert letters == text(shuffle(cells(letters), [never_next_to("x", forbidden)], rng()))


def test_refusal_names_counts_and_rules():
    with pytest.raises(DesignError, match=r"x: a × 3, b × 1.*at most 1 equal 'x' in a row"):
        shuffle(cells("aaab"), [no_more_than(1, "x")], rng())


def test_own_rules_see_only_their_factors_and_lookback():
    seen = []

    def allows(previous, candidate):
        seen.append((len(previous), set(candidate)))
        return True

    items = [{"x": i, "y": -i} for i in range(6)]
    shuffle(items, [Constraint("own", ("x",), 2, allows)], rng())
    assert {0, 1, 2} == {n for n, _ in seen}
    assert all({"x"} == names for _, names in seen)


def test_a_rule_about_an_unknown_factor_is_refused():
    with pytest.raises(DesignError, match="reads factor 'colour'"):
        shuffle(cells("ab"), [no_more_than(1, "colour")], rng())


@given(st.integers(2, 5), st.integers(2, 5), st.integers(1, 3), st.integers(2, 4), st.integers(0))
@settings(max_examples=60, deadline=None)
def test_single_factors_are_spread_within_one(n_a, n_b, reps, n_blocks, seed):
    items = [{"a": a, "b": b} for a in range(n_a) for b in range(n_b)] * reps
    if len(items) % n_blocks or len(items) < n_blocks:
        with pytest.raises(DesignError):
            balanced_blocks(items, n_blocks, (), rng(seed))
        return
    blocks = balanced_blocks(items, n_blocks, (), rng(seed))
    assert Counter(tuple(c.values()) for c in items) == Counter(
        tuple(c.values()) for b in blocks for c in b
    )
    for name, n in (("a", n_a), ("b", n_b)):
        for level in range(n):
            counts = [sum(c[name] == level for c in b) for b in blocks]
            assert max(counts) - min(counts) <= 1
