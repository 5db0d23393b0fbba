"""Counting cubes: bodies that reach far out of their common box, both orders, exact counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.analysis.collisions import Rule, Settings, box, common_volume, inside_out, union

CELL_M = 0.01
LOOSE = Settings(cell_m=CELL_M, require_contact=False)
RULES: tuple[Rule, ...] = ("centres", "published")


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
def test_small_body_deep_in_a_long_one_is_counted_whole(rule: Rule, axis: int, side: int) -> None:
    half = np.full(3, 0.1)
    half[axis] = 1.0
    place = np.zeros(3)
    place[axis] = side * 0.9
    body, limb = box([0, 0, 0], half), box(place, [0.05, 0.05, 0.05])
    expected = 10**3  # cubes of the limb, whose sides lie on the lattice
    for one, other in ((body, limb), (limb, body)):
        assert expected == common_volume(one, other, rule, settings=LOOSE).n_cells


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_counts_do_not_depend_on_the_order_of_bodies_and_touching_is_the_larger(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2)]
    a, b = (box(rng.uniform(-0.05, 0.05, 3), rng.uniform(0.01, 0.1, 3), turn) for turn in turns)
    counts = {}
    for rule in RULES:
        one = common_volume(a, b, rule, settings=LOOSE)
        other = common_volume(b, a, rule, settings=LOOSE)
        assert one.n_cells == other.n_cells
        np.testing.assert_allclose(one.centre_m, other.centre_m, atol=1e-12)
        counts[rule] = one.n_cells
    assert counts["published"] >= counts["centres"]
    assert counts["published"] * CELL_M**3 >= common_volume(a, b).volume_m3 * (1 - 1e-9)


def test_cube_within_a_cavity_touches_nothing() -> None:
    shell = union([box([0, 0, 0], [0.2] * 3), inside_out(box([0, 0, 0], [0.15] * 3))])
    inner = box([0, 0, 0], [0.1] * 3)
    assert 0 == common_volume(shell, inner, "published", settings=LOOSE).n_cells
    across = box([0, 0, 0], [0.17, 0.05, 0.05])
    assert 2 * 2 * 10 * 10 == common_volume(shell, across, "centres", settings=LOOSE).n_cells
