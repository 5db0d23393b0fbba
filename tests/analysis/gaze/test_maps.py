"""Maps of gaze: seconds where people looked, and clusters where conditions differ."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.analysis.gaze.maps import (
    MIN_PEOPLE,
    Grid,
    clusters_of_difference,
    dwell_map,
)

GRID = Grid(0.8, 0.5, 96, 60)


def test_areas_of_a_picture_add_up_to_its_solid_angle() -> None:
    a, b = GRID.half_width, GRID.half_height
    steradians = 4 * np.arcsin(a * b / np.sqrt((1 + a * a) * (1 + b * b)))  # of a pyramid
    assert GRID.area_deg2().sum() == pytest.approx(np.degrees(1) ** 2 * steradians, rel=2e-4)


@given(st.floats(-0.6, 0.6), st.floats(-0.35, 0.35), st.floats(0.01, 100))
def test_seconds_are_kept_and_lie_where_one_looked(x: float, y: float, seconds: float) -> None:
    dwell = dwell_map(GRID, np.array([x]), np.array([y]), np.array([seconds]))
    assert (dwell * GRID.area_deg2()).sum() == pytest.approx(seconds, rel=1e-4)
    row, column = np.unravel_index(dwell.argmax(), dwell.shape)
    xs, ys = GRID.centres()
    assert abs(xs[column] - x) <= GRID.half_width / GRID.columns + 1e-9
    assert abs(ys[row] - y) <= GRID.half_height / GRID.rows + 1e-9


def test_gaze_beyond_the_picture_counts_nowhere() -> None:
    dwell = dwell_map(GRID, np.array([0.81, 0.0]), np.array([0.0, -0.51]), np.ones(2))
    assert 0 == dwell.sum()


def maps_of(n: int, effect: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, 1, (n, 30, 40))
    noise[:, 10:16, 20:28] += effect
    return noise


def test_a_planted_difference_is_found_where_it_is_and_in_its_direction() -> None:
    for effect, is_more in ((1.5, True), (-1.5, False)):
        clusters = [c for c in clusters_of_difference(maps_of(16, effect, 1)) if c.p < 0.05]
        assert [is_more] == [c.is_more for c in clusters]
        inside = clusters[0].cells[10:16, 20:28].sum()
        assert inside > 40
        assert clusters[0].cells.sum() - inside < 12


def test_exchanging_the_conditions_exchanges_the_direction_and_nothing_else() -> None:
    given_, exchanged = (clusters_of_difference(s * maps_of(9, 1.2, 4)) for s in (1, -1))
    assert sorted((c.p, not c.is_more) for c in exchanged) == sorted(
        (c.p, c.is_more) for c in given_
    )


def test_where_nothing_differs_at_most_one_study_in_twenty_finds_something() -> None:
    hits = sum(
        any(c.p < 0.05 for c in clusters_of_difference(maps_of(8, 0, seed))) for seed in range(20)
    )
    assert hits <= 4  # 1 of 20 expected; more than 4 come by chance in 1 of 400 runs of seeds


def test_all_exchanges_of_a_few_people_are_made_so_p_is_a_share_of_them() -> None:
    for cluster in clusters_of_difference(maps_of(7, 1.0, 2)):
        assert (cluster.p * 2**7) == pytest.approx(round(cluster.p * 2**7))
        assert cluster.p >= 1 / 2**7


def test_cells_where_nobody_looked_are_no_difference() -> None:
    nothing = np.zeros((8, 12, 12))
    nothing[:, 3, 3] = 1e-30
    assert [] == clusters_of_difference(nothing * 0)
    few = np.zeros((8, 12, 12))
    few[:, 3, 3] = np.linspace(0.5, 1.5, 8)
    few[:, 9, 9] = 1e-12
    assert [(3, 3)] == [
        tuple(int(v) for v in np.argwhere(c.cells)[0]) for c in clusters_of_difference(few)
    ]


def test_too_few_people_are_refused() -> None:
    with pytest.raises(ValueError, match=f"{MIN_PEOPLE - 1} people; {MIN_PEOPLE}"):
        clusters_of_difference(maps_of(MIN_PEOPLE - 1, 0, 0))
