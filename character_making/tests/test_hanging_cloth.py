import numpy as np

from character_making.drape import Fabric, draped, mantle_over
from character_making.occlusion import open_shares
from character_making.pieces import Piece, triangulated

SIDE_M, STEPS = 0.4, 25


def _piece(vertices: np.ndarray, triangles: np.ndarray) -> Piece:
    n = len(vertices)
    part = np.zeros(len(triangles), dtype=np.int64)
    return Piece(vertices, triangles, np.ones((n, 1)), np.ones((n, 3)), part, "top")


def _sheet(height_m: float) -> Piece:
    """Return a level square cloth, seen from above."""
    at = np.linspace(-SIDE_M / 2, SIDE_M / 2, STEPS)
    x, z = np.meshgrid(at, at, indexing="ij")
    vertices = np.stack([x, np.full_like(x, height_m), z], axis=-1).reshape(-1, 3)
    i = np.arange(STEPS * STEPS).reshape(STEPS, STEPS)
    corners = (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1])
    return _piece(vertices, triangulated(np.stack(corners, axis=-1).reshape(-1, 4)))


def _ball(radius_m: float) -> Piece:
    polar, around = np.linspace(0.02, np.pi - 0.02, 40), np.linspace(0, 2 * np.pi, 60, False)
    p, a = np.meshgrid(polar, around, indexing="ij")
    vertices = np.stack([np.sin(p) * np.cos(a), np.cos(p), np.sin(p) * np.sin(a)], axis=-1)
    i = np.arange(40 * 60).reshape(40, 60)
    turn = np.roll(i, -1, axis=1)
    corners = (i[:-1], turn[:-1], turn[1:], i[1:])
    return _piece(
        radius_m * vertices.reshape(-1, 3),
        triangulated(np.stack(corners, axis=-1).reshape(-1, 4)),
    )


def _lengths(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    lengths: np.ndarray = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    return lengths


def test_cloth_falls_on_a_ball_and_stays_outside_of_it_without_stretching() -> None:
    cloth, ball = _sheet(0.11), _ball(0.1)
    n = len(cloth.vertices_m)
    held = np.zeros(n, dtype=bool)
    down = np.tile([0.0, 0.0, 1.0], (n, 1))
    fabric = Fabric(ease_around=0.0, ease_along=0.0)
    place = draped(cloth, [ball], held, down, held, fabric, np.full(n, 0.004), seed=1)
    assert place[:, 1].min() < 0.02
    assert np.linalg.norm(place, axis=1).min() > 0.1
    cut = _lengths(cloth.vertices_m, cloth.triangles)
    stretch = _lengths(place, cloth.triangles) / cut
    assert np.median(stretch) < 1.02
    assert np.quantile(stretch, 0.95) < 1.12


def test_what_is_sewn_stays_where_it_is() -> None:
    cloth, ball = _sheet(0.11), _ball(0.1)
    held = cloth.vertices_m[:, 0] > SIDE_M / 2 - 1e-9
    n = len(held)
    down = np.tile([0.0, 0.0, 1.0], (n, 1))
    limb = np.zeros(n, dtype=bool)
    place = draped(cloth, [ball], held, down, limb, Fabric(), np.full(n, 0.004), seed=1)
    np.testing.assert_array_equal(place[held], cloth.vertices_m[held])
    assert (place[~held, 1] < 0.11).mean() > 0.9


def test_cloth_spans_the_hollow_between_two_round_things() -> None:
    turn = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1) * 0.08
    aside = np.array([0.07, 0.0])
    both = np.concatenate([ring + aside, ring - aside])
    heights = np.linspace(0.0, 0.3, 31)
    points = np.array([[x, y, z] for y in heights for x, z in both])
    axis = np.zeros(3)
    everything = np.ones(len(points))
    hung = mantle_over(points, axis, everything > 0, inward=10.0, top_m=0.0)
    place = hung.around(points, everything)
    middle = np.abs(points[:, 0]) < 0.003
    assert np.abs(points[middle, 2]).max() < 0.045
    assert np.abs(place[np.abs(place[:, 0]) < 0.02, 2]).min() > 0.075


def test_cloth_falls_straight_from_what_is_above() -> None:
    turn = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    wide = {y: 0.2 if y > 0.2 else 0.1 for y in np.linspace(0.0, 0.3, 31).tolist()}
    points = np.array([[r * x, y, r * z] for y, r in wide.items() for x, z in ring])
    everything = np.ones(len(points))
    hung = mantle_over(points, np.zeros(3), everything > 0, inward=0.2, top_m=0.3)
    place = hung.around(points, everything)
    lowest = place[points[:, 1] == 0.0]
    np.testing.assert_allclose(np.hypot(lowest[:, 0], lowest[:, 2]), 0.16, atol=0.006)


def test_a_corner_lies_in_the_shade_and_a_plain_does_not() -> None:
    floor = _sheet(0.0)
    wall = _piece(floor.vertices_m[:, [1, 0, 2]] + [0.0, SIDE_M / 2, 0.0], floor.triangles)
    upwards = np.tile([0.0, 1.0, 0.0], (len(floor.vertices_m), 1))
    floor = Piece(
        floor.vertices_m,
        floor.triangles,
        floor.weights,
        floor.colour,
        floor.part,
        "top",
        normals=upwards,
    )
    (open_01,) = open_shares([floor], [floor, wall])
    from_wall = floor.vertices_m[:, 0]
    assert open_01[from_wall > 0.18].min() > 0.95
    assert np.median(open_01[(from_wall > 0.004) & (from_wall < 0.02)]) < 0.75
