"""Triangulation, walks and similarity: exactness, ties, and what a figure of Dice can hide."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from visavis.analysis.cells import (
    AllInLine,
    CellError,
    Cocircular,
    MalformedPositions,
    SamePlace,
    TooFewPeople,
    between_blocks,
    compare_blocks,
    dice,
    folded_angle_deg,
    gap_angles_deg,
    group_dice,
    jackknifed_excess,
    locate,
    own_block_excess,
    triangulate,
    walk,
    within_block,
)

Group = list[frozenset[tuple[int, int, int]]]
KITE = [[0.0, 0.0], [1.0, 0.1], [1.05, 1.0], [-0.05, 0.9]]


def crowd(seed: int, n: int = 40) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 8, (n, 2))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_triangulation_equals_qhull_in_general_position(seed: int) -> None:
    points = np.rint(crowd(seed) * 1e6) / 1e6
    expected = {tuple(sorted(t)) for t in Delaunay(points).simplices.tolist()}
    assert expected == set(triangulate(points).cells)


@given(
    start=st.tuples(st.integers(-20, 100), st.integers(-20, 100)),
    steps=st.lists(st.tuples(st.integers(-30, 30), st.integers(-30, 30)), min_size=1, max_size=12),
    seed=st.integers(0, 50),
)
@settings(max_examples=150, deadline=None)
def test_chain_is_unbroken_through_people_and_along_edges(
    start: tuple[int, int], steps: list[tuple[int, int]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    people = np.unique(rng.integers(0, 9, (14, 2)), axis=0) + np.array([0.0, 0.0])
    triangulation = triangulate(people, cocircular="jitter", rng=rng)
    at = np.array(triangulation.points_um) / 1e6
    path = [np.array(start) / 10]
    for k, step in enumerate(steps):  # every other sample stands exactly on a person
        path.append(at[k % len(at)] if k % 2 else path[-1] + np.array(step) / 10)
    got = walk(triangulation, path)
    assert len(got.cells) == len(got.crossings) + 1
    for before, crossing, after in zip(got.cells[:-1], got.crossings, got.cells[1:], strict=True):
        assert (before, after) == (crossing.before, crossing.after)
        for cell in (before, after):
            assert cell is None or set(crossing.edge) <= set(cell)
    end = np.rint(np.array(path[-1]) * 1e6).astype(int)
    last = locate(triangulation, (int(end[0]), int(end[1])))
    assert (None if last is None else tuple(sorted(last))) == got.cells[-1]
    assert [c.s for c in got.crossings] == sorted(c.s for c in got.crossings)


def test_walk_meets_the_cells_that_dense_sampling_meets() -> None:
    rng = np.random.default_rng(3)
    people = np.rint(crowd(3) * 1e6) / 1e6
    triangulation = triangulate(people)
    path = rng.uniform(-1, 9, (6, 2))
    got = walk(triangulation, path).cell_set
    dense = np.concatenate([np.linspace(a, b, 20_000) for a, b in pairwise(path)])
    qhull = Delaunay(people)
    met = {
        tuple(sorted(qhull.simplices[t].tolist())) for t in set(qhull.find_simplex(dense)) - {-1}
    }
    assert met <= got
    assert len(got - met) <= 2  # corners that dense samples still jump over


def test_reversed_walk_visits_the_same_cells() -> None:
    triangulation = triangulate(crowd(5))
    path = np.random.default_rng(5).uniform(-1, 9, (8, 2))
    assert walk(triangulation, path).cells == walk(triangulation, path[::-1]).cells[::-1]


def test_path_that_stays_outside_has_no_cell() -> None:
    got = walk(triangulate(KITE), [[2.0, 2.0], [3.0, 2.0]])
    assert (None,) == got.cells
    assert frozenset() == got.cell_set


def test_hull_is_walked_when_three_people_stand_on_it_in_line() -> None:
    triangulation = triangulate([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.9, 1.3]])
    got = walk(triangulation, [[0.5, -1.0], [0.6, 0.2], [1.4, 0.2], [1.5, -1.0]])
    assert (None, (0, 1, 3), (1, 2, 3), None) == got.cells


def test_standing_still_crosses_nothing() -> None:
    got = walk(triangulate(KITE), [[0.2, 0.2]] * 5)
    assert ((0, 1, 3),) == got.cells


def test_lost_samples_invent_no_crossing() -> None:
    got = walk(triangulate(KITE), [[0.2, 0.2], [np.nan, np.nan], [0.8, 0.8]])
    assert ((0, 1, 3), (1, 2, 3)) == got.cells
    assert () == got.crossings
    assert (0, 1) == got.starts
    assert got.n_lost == 1


def test_path_without_a_sample_is_refused() -> None:
    with pytest.raises(MalformedPositions, match="no sample"):
        walk(triangulate(KITE), [[np.nan, np.nan]])


@pytest.mark.parametrize("value", [np.nan, 5000.0])
def test_impossible_position_is_named(value: float) -> None:
    with pytest.raises(MalformedPositions, match="row 2"):
        triangulate([*KITE[:2], [value, 0.0], KITE[3]])


def test_people_at_the_same_place_are_named() -> None:
    with pytest.raises(SamePlace, match=r"\[1, 4\]"):
        triangulate([*KITE, KITE[1]])


def test_line_of_people_is_refused() -> None:
    with pytest.raises(AllInLine):
        triangulate([[0, 0], [1, 1], [2, 2]])


def test_grid_of_people_is_refused_or_jittered_repeatably() -> None:
    grid = [[x, y] for x in range(4) for y in range(4)]
    with pytest.raises(Cocircular, match="on one circle"):
        triangulate(grid)
    first, again = (
        triangulate(grid, cocircular="jitter", rng=np.random.default_rng(1)) for _ in range(2)
    )
    assert first.cells == again.cells
    assert 0 < first.jitter_um <= 50


def test_shoulder_angle_folds_and_differs_from_the_angle_to_the_walk() -> None:
    assert [0, 90, 45, 45] == pytest.approx(
        folded_angle_deg([[1, 0]] * 4, [[-3, 0], [0, 1], [1, 1], [1, -1]])
    )
    triangulation = triangulate(KITE)
    path = walk(triangulation, [[0.5, -0.5], [0.5, 1.5]])
    gap, heading = gap_angles_deg(triangulation, path.crossings, [1.0, 0.0])
    assert 5.710593137499568 == pytest.approx(gap[0])
    assert [90, 90, 90] == pytest.approx(heading)


A = [frozenset({(0, 1, 2), (1, 2, 3)}), frozenset({(0, 1, 2)})]
B = [frozenset({(0, 1, 2)}), frozenset({(2, 3, 4)})]


def test_dice_variants_by_hand() -> None:
    assert 2 * 1 / 4 == pytest.approx(group_dice(A, B, "union"))
    assert 2 * 0.5 / 2.5 == pytest.approx(group_dice(A, B, "frequency"))
    assert (2 / 3 + 0 + 1 + 0) / 4 == pytest.approx(group_dice(A, B, "pairs"))
    assert between_blocks(A, B) == group_dice(A, B, "union")


def test_dice_of_nothing_is_missing_and_ignores_repeats() -> None:
    assert np.isnan(dice([], []))
    assert dice([1, 1, 2], [2, 2, 3]) == pytest.approx(0.5)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_dice_is_symmetric_and_one_for_equal_groups(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = habits(rng, 6), habits(rng, 7)
    for variant in ("union", "frequency", "pairs"):
        assert group_dice(a, b, variant) == pytest.approx(group_dice(b, a, variant))
    for variant in ("union", "frequency"):
        assert group_dice(a, a, variant) == pytest.approx(1.0)


def habits(rng: np.random.Generator, n: int, low: int = 0) -> list[frozenset[tuple[int, int, int]]]:
    """Paths of 20 cells of 60, near a place of each person's own."""
    return [
        frozenset((int(c), int(c) + 1, int(c) + 2) for c in low + rng.choice(60, 20, replace=False))
        for _ in range(n)
    ]


def test_larger_groups_look_alike_without_any_effect_and_matched_ones_do_not() -> None:
    rng = np.random.default_rng(4)
    a, b = habits(rng, 23), habits(rng, 23)
    published = between_blocks(a, b) - within_block(a, rng).mean
    matched = compare_blocks(a, b, rng, n_permutations=199)
    assert published > 5 * abs(matched.difference)
    assert matched.p > 0.05


def test_permutation_test_finds_blocks_that_differ() -> None:
    rng = np.random.default_rng(6)
    got = compare_blocks(habits(rng, 12), habits(rng, 12, low=40), rng, n_permutations=199)
    assert got.difference > 0.2
    assert got.p == pytest.approx(1 / 200)


def test_permutation_test_keeps_its_level_without_an_effect() -> None:
    rng = np.random.default_rng(8)
    p = [
        compare_blocks(habits(rng, 8), habits(rng, 8), rng, n_splits=5, n_permutations=39).p
        for _ in range(60)
    ]
    assert np.mean(np.array(p) <= 0.10) < 0.25


def walked_twice(rng: np.random.Generator, n: int, shift: float) -> list[tuple[Group, Group]]:
    """Paths of n people in two blocks of two crowds; `shift` moves which cells are liked."""
    crowds = []
    for _ in range(2):
        liked = 0.5 * rng.random(40) ** 2
        tilt = np.where(np.arange(40) < 20, shift, -shift)
        blocks = [
            [frozenset((int(c),) * 3 for c in np.flatnonzero(rng.random(40) < p)) for _ in range(n)]
            for p in (liked * (1 + tilt), liked * (1 - tilt))
        ]
        crowds.append((blocks[0], blocks[1]))
    return crowds


def test_jackknife_values_have_the_mean_of_the_excess_and_its_true_scatter() -> None:
    rng = np.random.default_rng(5)
    means, naive, jackknifed = [], [], []
    for _ in range(150):
        crowds = walked_twice(rng, 12, 0.5)
        own, values = own_block_excess(crowds), jackknifed_excess(crowds)
        assert values.mean() == pytest.approx(own.mean())
        means.append(own.mean())
        naive.append(own.std(ddof=1) / np.sqrt(12))
        jackknifed.append(values.std(ddof=1) / np.sqrt(12))
    true = np.std(means)
    assert np.mean(jackknifed) == pytest.approx(true, rel=0.25)
    assert np.mean(naive) < 0.65 * true


def test_jackknife_leaves_out_who_did_not_walk_in_both_blocks() -> None:
    (a, b), *_ = walked_twice(np.random.default_rng(2), 6, 0.3)
    values = jackknifed_excess([([None, *a[1:]], b)])
    assert np.isnan(values[0])
    np.testing.assert_allclose(values[1:], jackknifed_excess([(a[1:], b[1:])]))
    assert np.isnan(jackknifed_excess([(a[:2], b[:2])])).all()


def test_splits_repeat_from_their_seed() -> None:
    block = habits(np.random.default_rng(1), 9)
    one, other = (within_block(block, np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(one.values, other.values)
    assert (4, 5) == one.sizes
    assert len(one.values) == 30


def test_too_few_people_and_unknown_variants_are_refused() -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(TooFewPeople):
        within_block(A[:1], rng)
    with pytest.raises(TooFewPeople, match="one path per person"):
        compare_blocks(A, B, rng)
    with pytest.raises(TooFewPeople):
        group_dice([], B)
    with pytest.raises(CellError, match="unknown variant"):
        group_dice(A, B, "jaccard")  # type: ignore[arg-type]  # the wrong variant is the point
