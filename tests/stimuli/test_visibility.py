"""Ray tests against analytic cases, a brute-force mesh, and rotations of the whole world."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.geometry import angle_deg, quat_from_yaw_pitch_deg, rotate, unit
from visavis.stimuli.scene import Agent, Capsule, Scene
from visavis.stimuli.visibility import SceneGeometry

ORIGIN = np.zeros((1, 3))
ALONG = np.array([[0.0, 0.0, -1.0]])
VALID = np.ones(1, np.bool_)


def scene_of(
    heads: list[tuple[float, float, float]],
    capsules: tuple[Capsule, ...] = (),
    brightness_01: float = 1.0,
    radius_m: float = 0.12,
) -> Scene:
    agents = tuple(
        Agent(f"a{i}", f"c{i}", "", np.array(h), radius_m, np.array([0.0, 0.0, 1.0]), np.array(h))
        for i, h in enumerate(heads)
    )
    return Scene("test", agents, capsules, brightness_01)


def hits(scene: Scene, origin: Any = ORIGIN, direction: Any = ALONG, valid: Any = VALID) -> Any:
    return SceneGeometry.from_scene(scene).observe(origin, direction, valid)[3]


def test_of_two_heads_in_line_the_nearer_is_hit_whatever_their_order() -> None:
    assert 0 == hits(scene_of([(0, 0, -2), (0, 0, -4)]))[0]
    assert 1 == hits(scene_of([(0, 0, -4), (0, 0, -2)]))[0]


def test_of_two_heads_at_the_same_place_the_first_is_hit() -> None:
    assert 0 == hits(scene_of([(0, 0, -2), (0, 0, -2)]))[0]


def test_head_behind_the_participant_is_not_hit() -> None:
    angle, *_, hit = SceneGeometry.from_scene(scene_of([(0, 0, 2)])).observe(ORIGIN, ALONG, VALID)

    assert -1 == hit[0]
    assert pytest.approx(180.0) == angle[0, 0]


@pytest.mark.parametrize(("offset", "expected"), [(-1e-9, 0), (1e-9, -1)])
def test_rim_decides_at_the_angular_radius(offset: float, expected: int) -> None:
    rim = np.arcsin(0.12 / 2.0) + offset
    direction = np.array([[np.sin(rim), 0.0, -np.cos(rim)]])

    assert expected == hits(scene_of([(0, 0, -2)]), direction=direction)[0]


def test_angular_radius_is_the_arcsine_of_radius_over_distance() -> None:
    radius = SceneGeometry.from_scene(scene_of([(0, 0, -2)])).observe(ORIGIN, ALONG, VALID)[1]

    assert pytest.approx(np.degrees(np.arcsin(0.12 / 2)), rel=1e-12) == radius[0, 0]


def test_pad_limit_is_half_the_rim_to_rim_gap_to_the_nearest_neighbour() -> None:
    at = [(np.sin(np.radians(a)) * 2, 0.0, -np.cos(np.radians(a)) * 2) for a in (0.0, 10.0, 25.0)]
    radius = np.degrees(np.arcsin(0.06))
    limit = SceneGeometry.from_scene(scene_of(at)).observe(ORIGIN, ALONG, VALID)[2]
    expected = [(10 - 2 * radius) / 2, (10 - 2 * radius) / 2, (15 - 2 * radius) / 2]

    np.testing.assert_allclose(limit[0], expected, rtol=1e-12)


def test_pad_limit_of_overlapping_heads_is_zero() -> None:
    limit = SceneGeometry.from_scene(scene_of([(0, 0, -2), (0.1, 0, -3)])).observe(
        ORIGIN, ALONG, VALID
    )[2]

    assert [0.0, 0.0] == limit[0].tolist()


@pytest.mark.parametrize(
    ("capsule", "expected"),
    [
        (Capsule(np.array([-1.0, 0, -1]), np.array([1.0, 0, -1]), 0.1), -1),  # a beam in between
        (Capsule(np.array([-1.0, 0, -3]), np.array([1.0, 0, -3]), 0.1), 0),  # behind the head
        (Capsule(np.array([-1.0, 0.2, -1]), np.array([1.0, 0.2, -1]), 0.1), 0),  # above the ray
        (Capsule(np.array([0.0, 0, -1]), np.array([0.0, 0, -1]), 0.05), -1),  # a ball
        (Capsule(np.array([0.0, 0, -0.5]), np.array([0.0, 0, -1.5]), 0.05), -1),  # along the ray
        (Capsule(np.array([0.08, 0, -1]), np.array([1.0, 0, -1]), 0.1), -1),  # its round end
        (Capsule(np.array([0.12, 0, -1]), np.array([1.0, 0, -1]), 0.1), 0),  # past its end
        (Capsule(np.array([-1.0, 0, 1]), np.array([1.0, 0, 1]), 0.1), 0),  # behind the observer
        (Capsule(np.array([-1.0, 0, 0.05]), np.array([1.0, 0, 0.05]), 0.1), -1),  # around the eye
    ],
)
def test_capsule_hides_a_head_only_from_in_between(capsule: Capsule, expected: int) -> None:
    assert expected == hits(scene_of([(0, 0, -2)], (capsule,)))[0]


@pytest.mark.parametrize(
    ("direction", "valid"),
    [
        ([0.0, 0.0, 0.0], True),
        ([np.nan, 0.0, -1.0], True),
        ([np.inf, 0.0, -1.0], True),
        ([0.0, 0.0, -1.0], False),
    ],
)
def test_lost_gaze_hits_minus_two_and_has_no_angle_but_heads_keep_their_size(
    direction: list[float], valid: bool
) -> None:
    angle, radius, _, hit = SceneGeometry.from_scene(scene_of([(0, 0, -2)])).observe(
        ORIGIN, np.array([direction]), np.array([valid])
    )

    assert -2 == hit[0]
    assert np.isnan(angle[0, 0])
    assert radius[0, 0] > 0


def test_without_an_origin_everything_is_missing() -> None:
    angle, radius, limit, hit = SceneGeometry.from_scene(scene_of([(0, 0, -2)])).observe(
        np.full((1, 3), np.nan), ALONG, VALID
    )

    assert -2 == hit[0]
    assert np.isnan([angle[0, 0], radius[0, 0], limit[0, 0]]).all()


def test_in_the_dark_nothing_is_hit_but_angles_are_given() -> None:
    geometry = SceneGeometry.from_scene(scene_of([(0, 0, -2)], brightness_01=0.0))
    angle, *_, hit = geometry.observe(ORIGIN, ALONG, VALID)

    assert -1 == hit[0]
    assert 0.0 == angle[0, 0]


def test_direction_of_any_length_gives_the_same_answer() -> None:
    geometry = SceneGeometry.from_scene(scene_of([(0.1, 0, -2), (1, 0, -2)]))
    one = geometry.observe(ORIGIN, np.array([[0.04, 0.0, -1.0]]), VALID)
    ten = geometry.observe(ORIGIN, np.array([[0.4, 0.0, -10.0]]), VALID)

    assert one[3][0] == ten[3][0] == 0
    np.testing.assert_allclose(one[0], ten[0], rtol=1e-12)


def test_no_samples_and_no_agents_give_empty_arrays() -> None:
    none = np.empty((0, 3))
    angle, _, _, hit = SceneGeometry.from_scene(scene_of([(0, 0, -2)])).observe(
        none, none, np.empty(0, np.bool_)
    )
    alone = SceneGeometry.from_scene(scene_of([])).observe(ORIGIN, ALONG, VALID)

    assert (0, 1) == angle.shape
    assert (0,) == hit.shape
    assert (1, 0) == alone[0].shape
    assert -1 == alone[3][0]


def icosphere(levels: int = 3) -> np.ndarray:
    """Return the triangles (t, 3, 3) of a unit sphere, refined from an octahedron."""
    axes = np.vstack([np.eye(3), -np.eye(3)])
    faces = [
        axes[[a, b, c]]
        for a, b, c in [
            (0, 1, 2),
            (1, 3, 2),
            (3, 4, 2),
            (4, 0, 2),
            (1, 0, 5),
            (3, 1, 5),
            (4, 3, 5),
            (0, 4, 5),
        ]
    ]
    for _ in range(levels):
        finer = []
        for a, b, c in faces:
            ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
            finer += [np.array(t) for t in [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]]
        faces = finer
    return np.array(faces)


def mesh_hit_m(direction: np.ndarray, triangles: np.ndarray) -> float:
    """Möller and Trumbore's test from the origin, over all triangles at once."""
    a, ab, ac = (
        triangles[:, 0],
        triangles[:, 1] - triangles[:, 0],
        triangles[:, 2] - triangles[:, 0],
    )
    p = np.cross(direction, ac)
    determinant = np.sum(ab * p, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum(-a * p, axis=1) / determinant
        q = np.cross(-a, ab)
        v = np.sum(direction * q, axis=1) / determinant
        t = np.sum(ac * q, axis=1) / determinant
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return float(np.min(t[inside], initial=np.inf))


def test_hits_agree_with_a_brute_force_mesh_of_the_heads() -> None:
    rng = np.random.default_rng(2)
    heads = [(0.0, 0.0, -2.0), (0.15, 0.05, -2.6), (-0.3, 0.1, -3.0)]
    mesh = icosphere()
    directions = unit(np.column_stack([rng.uniform(-0.2, 0.2, (1500, 2)), -np.ones(1500)]))
    hit = hits(scene_of(heads), np.zeros((1500, 3)), directions, np.ones(1500, np.bool_))
    by_mesh = []
    for direction in directions:
        t = [mesh_hit_m(direction, mesh * 0.12 + np.array(h)) for h in heads]
        by_mesh.append(int(np.argmin(t)) if np.isfinite(min(t)) else -1)

    # A mesh lies within its sphere, so only rays at the very rim may differ.
    assert 0.98 < np.mean(np.array(by_mesh) == hit)
    assert {-1, 0, 1, 2} == set(by_mesh)


def test_capsule_agrees_with_marching_along_the_ray() -> None:
    rng = np.random.default_rng(3)
    differ = 0
    for _ in range(300):
        a, b = rng.uniform(-0.6, 0.6, (2, 3)) - np.array([0, 0, 2.0])
        radius = rng.uniform(0.05, 0.3)
        direction = unit(np.array([*rng.uniform(-0.3, 0.3, 2), -1.0]))
        t = np.linspace(0, 4, 4001)[:, None]
        points = t * direction
        along = np.clip(np.sum((points - a) * (b - a), axis=1) / np.sum((b - a) ** 2), 0, 1)
        distance = np.linalg.norm(points - (a + along[:, None] * (b - a)), axis=1)
        if abs(distance.min() - radius) < 1e-3:
            continue  # the march is too coarse to decide
        far_ball = tuple(direction * 5.0)
        hit = hits(scene_of([far_ball], (Capsule(a, b, radius),)), direction=direction[None])
        differ += (distance.min() < radius) != (hit[0] == -1)

    assert 0 == differ


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-180, 180),
    st.floats(-80, 80),
    st.floats(-180, 180),
    st.integers(0, 2**31),
)
def test_turning_the_world_changes_nothing(
    yaw_deg: float, pitch_deg: float, second_yaw_deg: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    heads = [tuple(h) for h in rng.uniform(-1, 1, (5, 3)) + np.array([0, 0, -3.0])]
    ends = rng.uniform(-1, 1, (2, 3)) + np.array([0, 0, -2.0])
    origin = rng.uniform(-0.1, 0.1, (8, 3))
    direction = unit(np.column_stack([rng.uniform(-0.3, 0.3, (8, 2)), -np.ones(8)]))
    valid = np.ones(8, np.bool_)
    turned_by = [
        quat_from_yaw_pitch_deg(yaw_deg, pitch_deg),
        quat_from_yaw_pitch_deg(second_yaw_deg),
    ]

    def turn(v: np.ndarray) -> np.ndarray:
        for q in turned_by:
            v = rotate(np.broadcast_to(q, (*v.shape[:-1], 4)), v)
        return v

    plain = SceneGeometry.from_scene(scene_of(heads, (Capsule(ends[0], ends[1], 0.1),)))
    turned_heads = [tuple(h) for h in turn(np.array(heads))]
    turned_ends = turn(ends)
    turned = SceneGeometry.from_scene(
        scene_of(turned_heads, (Capsule(turned_ends[0], turned_ends[1], 0.1),))
    )
    before = plain.observe(origin, direction, valid)
    after = turned.observe(turn(origin), turn(direction), valid)

    for a, b in zip(before[:3], after[:3], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    np.testing.assert_array_equal(before[3], after[3])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31))
def test_angles_and_gaps_agree_with_the_plain_formulas(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heads = rng.uniform(-2, 2, (11, 3))
    heads += np.sign(heads) * 0.3
    origin = rng.uniform(-0.1, 0.1, (3, 3))
    direction = unit(rng.normal(size=(3, 3)))
    angle, radius, limit, _ = SceneGeometry.from_scene(scene_of([tuple(h) for h in heads])).observe(
        origin, direction, np.ones(3, np.bool_)
    )

    for i in range(3):
        offset = heads - origin[i]
        seen = unit(offset)
        radius_deg = np.degrees(np.arcsin(0.12 / np.linalg.norm(offset, axis=1)))
        gap_deg = angle_deg(seen[:, None], seen[None]) - radius_deg[:, None] - radius_deg[None]
        np.fill_diagonal(gap_deg, np.inf)
        np.testing.assert_allclose(angle[i], angle_deg(seen, direction[i]), atol=1e-9)
        np.testing.assert_allclose(radius[i], radius_deg, atol=1e-9)
        np.testing.assert_allclose(limit[i], np.maximum(gap_deg.min(axis=1), 0) / 2, atol=1e-9)


def test_repeated_origins_give_what_single_ones_give() -> None:
    geometry = SceneGeometry.from_scene(scene_of([(0, 0, -2), (0.5, 0, -2)]))
    origin = np.array([[0.0, 0, 0], [0.0, 0, 0], [0.1, 0, 0], [np.nan, 0, 0], [0.1, 0, 0]])
    direction = np.tile(ALONG, (5, 1))
    together = geometry.observe(origin, direction, np.ones(5, np.bool_))

    for i in range(5):
        single = geometry.observe(origin[i : i + 1], ALONG, VALID)
        for a, b in zip(together, single, strict=True):
            np.testing.assert_array_equal(a[i], b[0])
