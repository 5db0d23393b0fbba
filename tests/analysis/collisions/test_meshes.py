"""Meshes: what is repaired, and what is refused with its name."""

import numpy as np
import pytest

from visavis.analysis.collisions import (
    MalformedMesh,
    NonFiniteMesh,
    NotOrientable,
    OpenMesh,
    box,
    closed_mesh,
    common_volume,
    enclosed_volume_m3,
    inside_out,
    mesh_in_pose,
    sphere,
    union,
)

BALL = sphere(np.zeros(3), 0.1, segments=24, rings=6)


def test_closed_outward_mesh_is_left_alone() -> None:
    again = closed_mesh(BALL.vertices_m, BALL.faces)
    assert again.repairs == ()
    np.testing.assert_array_equal(BALL.faces, again.faces)


def test_inverted_mesh_is_turned_and_told() -> None:
    wrong = inside_out(BALL)
    mesh = closed_mesh(wrong.vertices_m, wrong.faces)
    assert enclosed_volume_m3(BALL) == pytest.approx(enclosed_volume_m3(mesh))
    assert mesh.repairs == ("turned 1 part that faced inward",)


def test_single_turned_faces_are_turned_back() -> None:
    faces = BALL.faces.copy()
    faces[[3, 50, 99]] = faces[[3, 50, 99]][:, ::-1]
    mesh = closed_mesh(BALL.vertices_m, faces)
    assert enclosed_volume_m3(BALL) == pytest.approx(enclosed_volume_m3(mesh))
    assert "3 faces" in mesh.repairs[0]


def test_cavity_stays_a_cavity_and_a_separate_inverted_part_is_turned() -> None:
    core = inside_out(sphere(np.zeros(3), 0.05, segments=24, rings=6))
    apart = inside_out(sphere(np.array([1.0, 0, 0]), 0.05, segments=24, rings=6))
    body = union([BALL, core, apart])
    mesh = closed_mesh(body.vertices_m, body.faces)
    assert enclosed_volume_m3(BALL) == pytest.approx(enclosed_volume_m3(mesh), rel=1e-9)


def test_seam_vertices_are_joined_and_keep_their_number() -> None:
    vertices = BALL.vertices_m[BALL.faces].reshape(-1, 3)
    mesh = closed_mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
    assert len(mesh.vertices_m) == len(vertices)
    assert enclosed_volume_m3(BALL) == pytest.approx(enclosed_volume_m3(mesh))


def test_small_hole_is_closed() -> None:
    mesh = closed_mesh(BALL.vertices_m, np.delete(BALL.faces, [10], axis=0))
    assert enclosed_volume_m3(BALL) == pytest.approx(enclosed_volume_m3(mesh))
    assert mesh.repairs == ("closed 1 holes with 1 faces",)


def test_large_hole_is_refused_with_its_place() -> None:
    cube = box(np.array([1.0, 2.0, 3.0]), np.full(3, 0.5))
    with pytest.raises(OpenMesh, match=r"avatar 7: a hole of 3 edges .*largest_hole_m"):
        closed_mesh(cube.vertices_m, cube.faces[1:], name="avatar 7")


def test_moebius_band_is_refused() -> None:
    n = 20
    turn = 2 * np.pi * np.arange(n) / n
    side = np.stack(
        [np.cos(turn / 2) * np.cos(turn), np.cos(turn / 2) * np.sin(turn), np.sin(turn / 2)], 1
    )
    middle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)
    vertices = np.concatenate([middle - 0.2 * side, middle + 0.2 * side])
    here = np.arange(n)
    after = (here + 1) % n
    low = np.where(after == 0, n, after)
    high = np.where(after == 0, 0, after + n)
    faces = np.concatenate([np.stack([here, low, high], 1), np.stack([here, high, here + n], 1)])
    with pytest.raises(NotOrientable, match="cannot both face outward"):
        closed_mesh(vertices, faces)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_lost_vertex_is_named(value: float) -> None:
    vertices = BALL.vertices_m.copy()
    vertices[5, 1] = value
    with pytest.raises(NonFiniteMesh, match="ball: vertex 5"):
        closed_mesh(vertices, BALL.faces, name="ball")
    with pytest.raises(NonFiniteMesh, match="step 12: vertex 5"):
        mesh_in_pose(BALL, vertices, name="step 12")


def test_pose_of_another_mesh_is_refused() -> None:
    with pytest.raises(MalformedMesh, match="pose the mesh that was loaded"):
        mesh_in_pose(BALL, BALL.vertices_m[1:])


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 999_999]], "names vertex"),
        ([[0, 1]], "give"),
        ([[0.0, 1.0, 2.0]], "whole vertex numbers"),
        ([[0, 0, 1]], "three different corners"),
    ],
)
def test_faces_that_are_none_are_refused(faces: list[list[int]], message: str) -> None:
    with pytest.raises(MalformedMesh, match=message):
        closed_mesh(BALL.vertices_m, faces)


@pytest.mark.parametrize("own_vertices", [False, True])
def test_surface_drawn_from_both_sides_is_one_body(own_vertices: bool) -> None:
    ball = sphere([0, 0, 0], 0.1, segments=24, rings=6)
    other = box([0.05, 0, 0], [0.1, 0.1, 0.1])
    back = ball.faces[:, ::-1] + (len(ball.vertices_m) if own_vertices else 0)
    vertices = np.vstack([ball.vertices_m] * (2 if own_vertices else 1))
    both = closed_mesh(vertices, np.vstack([ball.faces, back]))
    expected = common_volume(ball, other).volume_m3
    assert expected > 3e-3
    assert expected == pytest.approx(common_volume(both, other).volume_m3)
    assert any("from both" in text for text in both.repairs)


def test_wall_between_two_rooms_of_one_body_is_left_alone() -> None:
    left, right = box([-0.1, 0, 0], [0.1, 0.1, 0.1]), box([0.1, 0, 0], [0.1, 0.1, 0.1])
    both = union([left, right])
    body = closed_mesh(both.vertices_m, both.faces)
    around = box([0, 0, 0], [1, 1, 1])
    assert 0.016 == pytest.approx(common_volume(body, around).volume_m3)


def test_surface_that_encloses_nothing_is_refused() -> None:
    ball = sphere([0, 0, 0], 0.1, segments=24, rings=6)
    with pytest.raises(MalformedMesh, match="sheet: the surface encloses nothing"):
        closed_mesh(ball.vertices_m * [1, 0, 1], ball.faces, name="sheet")


@pytest.mark.parametrize("half_m", [1e-7, 1e-4, 1.0, 1e3])
def test_thin_plates_and_bodies_of_any_size_are_bodies(half_m: float) -> None:
    turned = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turned[:, 0] *= np.sign(np.linalg.det(turned))
    assert () == box([0, 0, 0], [0.5, 0.5, half_m], turned).repairs
    assert () == box([0, 0, 0], [half_m] * 3).repairs
