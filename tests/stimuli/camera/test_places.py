"""Rays meet what stands there; floor, middle lines and outlines of places."""

import numpy as np
import pytest
import shapely

from tests.stimuli.camera.outlined import outlined_room
from visavis.lab.errors import DesignError
from visavis.stimuli.camera.floors import walkable_floors
from visavis.stimuli.camera.obstacles import Obstacles, triangles_of
from visavis.stimuli.camera.skeleton import medial_axis
from visavis.stimuli.picture import Room
from visavis.stimuli.rooms.office import office
from visavis.stimuli.rooms.station import HALF_WIDTH_M, station

SQUARE = [[0, 0], [6, 0], [6, 6], [0, 6]]


def met_by_every_triangle(triangles: np.ndarray, start: np.ndarray, ray: np.ndarray) -> float:
    """Solve start + t ray = a + u (b - a) + v (c - a) for each triangle alone."""
    found = np.inf
    for a, b, c in triangles:
        matrix = np.stack([-ray, b - a, c - a], 1)
        if abs(np.linalg.det(matrix)) > 1e-12:
            t, u, v = np.linalg.solve(matrix, start - a)
            if t >= 0 and u >= 0 and v >= 0 and u + v <= 1:
                found = min(found, t)
    return found


def test_rays_meet_what_they_meet_triangle_by_triangle() -> None:
    triangles = triangles_of(office())[::4]
    packed = Obstacles.of_triangles(triangles)
    rng = np.random.default_rng(3)
    for _ in range(12):
        start, ray = rng.uniform([-2, 0.3, -2], [2, 2, 2]), rng.standard_normal(3)
        ray /= np.linalg.norm(ray)
        assert met_by_every_triangle(triangles, start, ray) == pytest.approx(
            packed.hit_m(start, ray), abs=1e-9
        )


def test_sight_ends_at_walls_and_at_people_in_between() -> None:
    room = Obstacles.of_room(outlined_room("cross", SQUARE, [[[2, 2], [4, 2], [4, 4], [2, 4]]], 3))
    a, b, beyond = np.array([1, 1.6, 1.0]), np.array([5, 1.6, 1.0]), np.array([5, 1.6, 5.0])
    somebody = np.array([[3.0, 0.2, 1.0, 3.0, 1.6, 1.0, 0.2]])

    assert room.sees(a, b)
    assert not room.sees(a, beyond)
    assert not room.sees(a, b, somebody)
    assert room.is_near(np.array([1.0, 1.6, 0.3]), 0.31)
    assert not room.is_near(np.array([1.0, 1.6, 0.3]), 0.29)


def test_taking_a_wall_away_only_adds_what_is_seen() -> None:
    with_block = Obstacles.of_room(
        outlined_room("b", SQUARE, [[[2, 2], [4, 2], [4, 4], [2, 4]]], 3)
    )
    without = Obstacles.of_room(outlined_room("w", SQUARE, [], 3))
    rng = np.random.default_rng(4)
    pairs = rng.uniform([0.1, 0.1, 0.1], [5.9, 2.9, 5.9], (300, 2, 3))

    seen = np.array([[o.sees(a, b) for a, b in pairs] for o in (with_block, without)])
    assert seen[1].all()
    assert not seen[0].all()


def test_walkable_floor_of_the_station_keeps_off_columns_benches_and_tracks() -> None:
    (floor,) = walkable_floors(station())
    column, bench, rails = (HALF_WIDTH_M, -10.0), (5.2, -12.5), (12.5, 0.0)

    assert floor.height_m == pytest.approx(0.0)
    assert not any(shapely.contains_xy(floor.area, *at) for at in (column, bench, rails))
    assert all(shapely.contains_xy(floor.area, *at) for at in ((0.0, 0.0), (9.0, -10.0)))
    # A way round every column and every bench.
    assert medial_axis(floor.area).cycles == 16 + 6


def test_square_has_middle_lines_although_every_branch_leads_to_a_corner() -> None:
    lines = medial_axis(shapely.Polygon(SQUARE))
    assert (1, 0) == (lines.components, lines.cycles)
    assert sum(len(b) - 1 for b in lines.branches()) == len(lines.edges)


def test_ring_is_one_branch() -> None:
    ring = shapely.Polygon(SQUARE).difference(shapely.Polygon(SQUARE).buffer(-2))
    lines = medial_axis(ring)
    (round_,) = lines.branches()
    assert round_[0] == round_[-1]


def test_place_without_floor_and_crossed_outline_are_refused() -> None:
    nothing = Room("void", (), (), np.zeros(3), np.zeros(3))
    with pytest.raises(DesignError, match="no level floor"):
        walkable_floors(nothing)
    with pytest.raises(DesignError, match="nothing a camera"):
        Obstacles.of_room(nothing)
    with pytest.raises(DesignError, match="outline"):
        outlined_room("eight", [[0, 0], [4, 4], [4, 0], [0, 4]], [], 3.0)
