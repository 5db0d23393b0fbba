"""Tracks keep clear of the place, graphs join what sees each other, tables tell what is seen."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from tests.stimuli.camera.outlined import outlined_room
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.director import Director, Moment, Style, prepare
from visavis.stimuli.camera.floors import Floor, walkable_floors
from visavis.stimuli.camera.graph import (
    CameraGraph,
    GraphRules,
    floor_table,
    is_clear_way,
    roadmap,
    small_triangles,
    track_graph,
)
from visavis.stimuli.camera.obstacles import Obstacles
from visavis.stimuli.camera.shots import ShotSize
from visavis.stimuli.camera.skeleton import medial_axis
from visavis.stimuli.camera.tracks import TrackRules, camera_places, tracks_through, wall_tracks
from visavis.stimuli.rooms.plain import plain_room

L_SHAPE = [[0, 0], [14, 0], [14, 3], [3, 3], [3, 12], [0, 12]]
NEAR = 1e-6


@pytest.fixture(scope="module")
def place() -> tuple[Floor, Obstacles, Vector, CameraGraph]:
    room = outlined_room("L", L_SHAPE, [], 3.0)
    walls, (floor,) = Obstacles.of_room(room), walkable_floors(room)
    tracks = tracks_through(camera_places(floor, medial_axis(floor.area), walls), walls, seed=2)
    return floor, walls, tracks, track_graph(tracks, walls)


Place = tuple[Floor, Obstacles, Vector, CameraGraph]


def test_every_place_of_a_camera_sees_the_middle_line_it_was_found_from(place: Place) -> None:
    floor, walls, _, _ = place
    found = camera_places(floor, medial_axis(floor.area), walls)

    assert len(found.place_m) > 100
    assert all(walls.sees(a, b) for a, b in zip(found.origin_m, found.place_m, strict=True))


def test_no_track_and_no_edge_comes_near_a_wall(place: Place) -> None:
    _, walls, tracks, graph = place
    ways = [*tracks, *graph.nodes_m[graph.edges]]

    assert all(is_clear_way(walls, a, b, TrackRules().clear_m - NEAR) for a, b in ways)


def test_no_edge_is_longer_than_allowed(place: Place) -> None:
    _, _, _, graph = place
    a, b = graph.nodes_m[graph.edges].transpose(1, 0, 2)

    assert np.linalg.norm(b - a, axis=1).max() <= GraphRules().max_edge_m + NEAR


def test_a_room_without_a_middle_line_has_tracks_along_its_walls() -> None:
    room = plain_room()
    walls, (floor,) = Obstacles.of_room(room), walkable_floors(room)
    along = tracks_through(camera_places(floor, medial_axis(floor.area), walls), walls, seed=2)
    tracks = wall_tracks(floor, walls)

    assert 0 == len(along)
    assert 8 == len(tracks)
    assert all(is_clear_way(walls, a, b, TrackRules().clear_m - NEAR) for a, b in tracks)
    rim = floor.area.boundary
    assert all(rim.distance(shapely.Point(p[0], p[2])) < 0.02 for p in tracks.reshape(-1, 3))
    assert {1.6, 2.24} == set(tracks[:, :, 1].ravel().round(6))
    place = prepare(room)
    assert len(place.graph.nodes_m) > 8
    where = Moment(np.zeros(3), 1.7)
    for shot in ShotSize:
        director = Director(place, replace(Style(), shot=shot), lambda t: where)
        assert director.sees_subject


def test_same_seed_gives_the_same_tracks(place: Place) -> None:
    floor, walls, tracks, _ = place
    places = camera_places(floor, medial_axis(floor.area), walls)

    np.testing.assert_array_equal(tracks, tracks_through(places, walls, seed=2))


def test_tracks_that_cross_share_a_way_and_distances_follow_it() -> None:
    far_wall = Obstacles.of_triangles(np.array([[[50.0, 0, 0], [50, 1, 0], [50, 0, 1]]]))
    crossing = np.array([[[0, 1, 0], [4.0, 1, 0]], [[2, 1, -2], [2.0, 1, 2]]])
    graph = track_graph(crossing, far_wall, GraphRules(max_edge_m=10.0))

    assert 0 == graph.component.max()
    ends = [
        int(np.argmin(np.linalg.norm(graph.nodes_m - p, axis=1))) for p in ([0, 1, 0], [2, 1, 2])
    ]
    assert graph.distance_m[ends[0], ends[1]] == pytest.approx(4.0, abs=1e-5)


def test_parts_are_linked_where_they_see_each_other_only() -> None:
    beside = np.array([[[0, 1, 0], [2.0, 1, 0]], [[0, 1, 1], [2.0, 1, 1]]])
    wall = np.array([[[-5, 0, 0.5], [5, 0, 0.5], [0, 9, 0.5]]], float)
    away = wall + np.array([100.0, 0, 0])

    assert 0 == track_graph(beside, Obstacles.of_triangles(away)).component.max()
    assert 1 == track_graph(beside, Obstacles.of_triangles(wall)).component.max()


def test_small_triangles_cover_the_floor_and_tables_see_what_rays_see(place: Place) -> None:
    floor, walls, _, graph = place
    triangles = small_triangles(floor, 1.5)
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    table = floor_table(graph, triangles, walls, seed=0)
    round_corner = walls.sees(np.array([13.0, 1.6, 1.5]), np.array([1.5, 1.6, 11.0]))

    assert areas.sum() == pytest.approx(floor.area.area)
    assert areas.max() <= 1.5
    node = int(np.argmin(np.linalg.norm(graph.nodes_m - [13.0, 1.6, 1.5], axis=1)))
    far, near = (table.at(np.array(at)) for at in ([1.5, 0.0, 11.0], [12.0, 0.0, 1.5]))
    assert (round_corner, 0.0) == (False, table.share_01[node, far])
    assert table.share_01[node, near] > 0.5
    around = table.around_01(2.0)
    assert around.shape == (len(triangles), len(graph.nodes_m))
    assert around[far, node] == 0.0


def test_roadmap_links_all_places_within_reach_that_see_each_other(place: Place) -> None:
    floor, walls, _, _ = place
    scattered = roadmap(floor, walls, seed=1, per_m2=0.5, link_m=4.0)
    joined = {tuple(e) for e in scattered.edges.tolist()}

    for a in range(len(scattered.nodes_m)):
        for b in range(a + 1, len(scattered.nodes_m)):
            p, q = scattered.nodes_m[[a, b]]
            wanted = bool(np.linalg.norm(p - q) <= 4.0) and walls.sees(p, q)
            assert wanted == ((a, b) in joined)


def test_place_without_tracks_is_refused(place: Place) -> None:
    _, walls, _, _ = place
    with pytest.raises(DesignError, match="no camera track"):
        track_graph(np.empty((0, 2, 3)), walls)
