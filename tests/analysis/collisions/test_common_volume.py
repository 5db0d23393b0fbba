"""Common volume: closed forms, invariances, and each trap found by measuring."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from tests.analysis.collisions.posed_bodies import posed_pair
from visavis.analysis.collisions import (
    ClosedMesh,
    CollisionError,
    Settings,
    TooLargeForVoxels,
    box,
    capsule,
    common_volume,
    enclosed_volume_m3,
    inside_out,
    sphere,
    union,
)
from visavis.lab.geometry import quat_from_yaw_pitch_deg, rotate

EXACT = Settings(always_exact=True)
COLUMNS = Settings(exact_faces=0)
FINE = Settings(exact_faces=0, cell_m=0.004, refine_below_m3=1.0, fine_columns=20_000)
ORIGIN = np.zeros(3)


def moved(mesh: ClosedMesh, yaw_deg: float, pitch_deg: float, by_m: np.ndarray) -> ClosedMesh:
    turned = rotate(quat_from_yaw_pitch_deg(yaw_deg, pitch_deg), mesh.vertices_m)
    return ClosedMesh(turned + by_m, mesh.faces)


def lens_m3(r: float, apart: float) -> float:
    return np.pi * (4 * r + apart) * (2 * r - apart) ** 2 / 12


def small_sphere(centre: np.ndarray, radius: float) -> ClosedMesh:
    return sphere(centre, radius, segments=24, rings=6)


@pytest.mark.parametrize("chosen", [EXACT, COLUMNS])
def test_sphere_within_itself_is_its_own_volume(chosen: Settings) -> None:
    ball = small_sphere(np.array([0.3, 1.0, -0.2]), 0.1)
    assert enclosed_volume_m3(ball) == pytest.approx(
        common_volume(ball, ball, settings=chosen).volume_m3, rel=0.01
    )


def test_exact_rule_returns_the_enclosed_volume_to_rounding() -> None:
    ball = moved(small_sphere(ORIGIN, 0.1), 20, 35, np.array([0.3, 1.0, -0.2]))
    around = box(ball.vertices_m.mean(0), np.full(3, 0.5))
    assert enclosed_volume_m3(ball) == pytest.approx(
        common_volume(ball, around, settings=EXACT).volume_m3, rel=1e-12
    )


@pytest.mark.parametrize("apart", [0.02, 0.1, 0.17])
def test_sphere_lens_equals_its_closed_form(apart: float) -> None:
    a, b = (sphere(np.array([x, 0.0, 0.0]), 0.1) for x in (0.0, apart))
    assert lens_m3(0.1, apart) == pytest.approx(common_volume(a, b).volume_m3, rel=0.02)


@given(
    half=st.tuples(*[st.floats(0.05, 0.3)] * 3),
    shift=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    yaw=st.floats(-180, 180),
    pitch=st.floats(-80, 80),
)
@settings(max_examples=25, deadline=None)
def test_parallel_boxes_share_the_product_of_their_overlaps_in_any_orientation(
    half: tuple[float, ...], shift: tuple[float, ...], yaw: float, pitch: float
) -> None:
    a, b = box(ORIGIN, np.full(3, 0.2)), box(np.array(shift), np.array(half))
    sides = np.minimum(0.2, np.array(shift) + half) - np.maximum(-0.2, np.array(shift) - half)
    expected = float(np.prod(np.maximum(sides, 0)))
    by = np.array([1.0, 2.0, 3.0])
    got = common_volume(moved(a, yaw, pitch, by), moved(b, yaw, pitch, by)).volume_m3
    assert expected == pytest.approx(got, rel=1e-9, abs=1e-13)


@given(seed=st.integers(0, 1000))
@settings(max_examples=5, deadline=None)
def test_volume_is_symmetric_and_unchanged_by_rigid_motion(seed: int) -> None:
    a, b = posed_pair(0.12, np.random.default_rng(seed))
    expected = common_volume(a, b, settings=EXACT).volume_m3
    assert expected == pytest.approx(common_volume(b, a, settings=EXACT).volume_m3, abs=1e-14)
    by = np.array([3.1, -0.4, 7.7])
    turned = common_volume(moved(a, 37, 21, by), moved(b, 37, 21, by), settings=EXACT)
    assert expected == pytest.approx(turned.volume_m3, rel=1e-6, abs=1e-12)


@given(seed=st.integers(0, 1000))
@settings(max_examples=6, deadline=None)
def test_columns_agree_with_exact_integration_of_people(seed: int) -> None:
    a, b = posed_pair(0.08, np.random.default_rng(seed))
    expected = common_volume(a, b, settings=EXACT)
    got = common_volume(a, b, settings=COLUMNS)
    allowed = 0.04 if expected.volume_m3 > 5e-6 else 0.10
    assert expected.volume_m3 == pytest.approx(got.volume_m3, rel=allowed, abs=1e-7)
    if expected.volume_m3 > 1e-4:
        np.testing.assert_allclose(got.centre_m, expected.centre_m, atol=0.01)  # one column


def test_volume_grows_with_the_body() -> None:
    other = small_sphere(np.array([0.12, 0.0, 0.0]), 0.08)
    bodies = [small_sphere(ORIGIN, r) for r in (0.03, 0.05, 0.07, 0.1, 0.3)]
    got = [common_volume(body, other, settings=FINE).volume_m3 for body in bodies]
    assert got == sorted(got)
    assert got[0] == 0.0
    assert enclosed_volume_m3(other) == pytest.approx(got[-1], rel=1e-3)


def test_limb_wholly_inside_a_torso_is_seen_though_surfaces_do_not_cross() -> None:
    limb = capsule(np.array([-0.03, 0, 0]), np.array([0.03, 0, 0]), 0.02, segments=24, rings=6)
    torso = small_sphere(ORIGIN, 0.2)
    assert enclosed_volume_m3(limb) == pytest.approx(common_volume(limb, torso).volume_m3, rel=0.05)


def test_bodies_apart_share_nothing_though_their_boxes_overlap() -> None:
    a = small_sphere(ORIGIN, 0.1)
    b = small_sphere(np.array([0.13, 0.13, 0.13]), 0.1)
    got = common_volume(a, b)
    assert got.volume_m3 == 0.0
    assert got.contact is False
    assert np.isnan(got.centre_m).all()


def test_touching_boxes_share_nothing() -> None:
    for shift in ([0.2, 0, 0], [0.2, 0.2, 0], [0.2, 0.2, 0.2]):
        a, b = box(ORIGIN, np.full(3, 0.1)), box(np.array(shift), np.full(3, 0.1))
        for chosen in (EXACT, COLUMNS):
            assert common_volume(a, b, settings=chosen).volume_m3 == 0.0


@pytest.mark.parametrize("volume_m3", [0.6e-6, 0.9e-6, 1.1e-6, 1.5e-6, 3e-6])
@pytest.mark.parametrize("seed", range(6))
def test_small_contact_falls_on_the_right_side_of_the_threshold(
    volume_m3: float, seed: int
) -> None:
    # 10 mm columns alone miss most of these lenses; zeros must be looked at again too
    rng = np.random.default_rng(seed)
    away = rng.normal(size=3)
    away /= np.linalg.norm(away)
    centre = rng.uniform(-1, 1, 3)
    apart = float(brentq(lambda d: lens_m3(0.08, d) - volume_m3, 0.1, 0.16))
    a, b = sphere(centre, 0.08), sphere(centre + apart * away, 0.08)
    expected = common_volume(a, b, settings=EXACT).volume_m3
    got = common_volume(a, b).volume_m3
    assert expected == pytest.approx(got, rel=0.10)
    assert (expected > 1e-6) == (got > 1e-6)


@pytest.mark.parametrize("volume_m3", [1.2e-6, 4e-6])
@pytest.mark.parametrize("apart_m", [(0.8, 0.0, 0.31), (0.3, 0.8, 0.2)])
def test_small_contacts_far_from_each_other_are_measured_as_finely_as_one(
    volume_m3: float, apart_m: tuple[float, float, float]
) -> None:
    # the box of both is long, so a thousand columns over it stand 3 to 5 mm apart
    between = float(brentq(lambda d: lens_m3(0.05, d) - volume_m3 / 2, 0.05, 0.1))
    by_m = between * np.array([0.6, 0.64, 0.48])
    places = (ORIGIN, np.array(apart_m))
    a, b = (
        union([sphere(place + shift, 0.05, segments=64, rings=16) for place in places])
        for shift in (ORIGIN, by_m)
    )
    expected = common_volume(a, b, settings=EXACT).volume_m3
    assert expected == pytest.approx(common_volume(a, b).volume_m3, rel=2.5e-3)


def test_self_overlap_counts_once_not_twice_and_not_as_a_hole() -> None:
    twice = union([small_sphere(ORIGIN, 0.1), small_sphere(np.array([0.05, 0.0, 0.0]), 0.1)])
    around = box(ORIGIN, np.full(3, 0.5))
    once = 2 * enclosed_volume_m3(small_sphere(ORIGIN, 0.1)) - lens_m3(0.1, 0.05)
    for chosen in (EXACT, COLUMNS):
        assert once == pytest.approx(
            common_volume(twice, around, settings=chosen).volume_m3, rel=0.02
        )


def test_cavity_is_outside() -> None:
    shell = union([small_sphere(ORIGIN, 0.1), inside_out(small_sphere(ORIGIN, 0.06))])
    core = small_sphere(ORIGIN, 0.03)
    assert common_volume(shell, core, settings=COLUMNS).volume_m3 == 0.0
    assert common_volume(shell, core, settings=EXACT).volume_m3 == 0.0


def test_columns_through_vertices_and_along_edges_are_balanced() -> None:
    # a cube cut into a grid of triangles whose edges lie exactly on the columns
    a = box(np.array([0.1, 0.1, 0.1]), np.full(3, 0.1))
    b = box(np.array([0.15, 0.15, 0.15]), np.full(3, 0.1))
    for cell in (0.01, 0.02, 0.025, 0.05, 0.1):
        got = common_volume(a, b, settings=Settings(exact_faces=0, cell_m=cell, refine_below_m3=0))
        assert 0.15**3 == pytest.approx(got.volume_m3, rel=1e-9)


def test_centres_miss_a_thin_plate_and_volume_does_not() -> None:
    plate = box(np.array([0.0, 0.0, 0.0022]), np.array([0.1, 0.1, 0.0005]))
    ball = sphere(ORIGIN, 0.08)
    assert common_volume(plate, ball, "centres").volume_m3 == 0.0
    assert np.pi * 0.08**2 * 0.001 == pytest.approx(common_volume(plate, ball).volume_m3, rel=0.02)


def test_touching_cubes_overstate_and_centres_do_not() -> None:
    a, b = (sphere(np.array([x, 0.003, 0.002]), 0.1) for x in (0.0, 0.12))
    true = common_volume(a, b, settings=EXACT).volume_m3
    assert true == pytest.approx(common_volume(a, b, "centres").volume_m3, rel=0.05)
    assert common_volume(a, b, "published").volume_m3 > 1.4 * true


def test_near_miss_is_reported_only_when_contact_is_not_required() -> None:
    # 3 mm apart, and both reach into the cubes between x = 0.10 and 0.11
    a = box(np.array([0.0035, 0.0, 0.0]), np.array([0.1, 0.1, 0.1]))
    b = box(np.array([0.2065, 0.0, 0.0]), np.array([0.1, 0.1, 0.1]))
    lip = box(np.array([0.2065, 0.3, 0.0]), np.array([0.2, 0.1, 0.1]))
    near = union([b, lip])
    loose = common_volume(a, near, "published", settings=Settings(require_contact=False))
    strict = common_volume(a, near, "published")
    assert 400 == loose.n_cells
    assert (0, False) == (strict.n_cells, strict.contact)


def test_result_names_its_rule() -> None:
    ball = small_sphere(ORIGIN, 0.1)
    assert [
        common_volume(ball, ball, rule).rule for rule in ("volume", "centres", "published")
    ] == [
        "volume",
        "centres",
        "published",
    ]


def test_unknown_rule_is_refused() -> None:
    ball = small_sphere(ORIGIN, 0.1)
    with pytest.raises(CollisionError, match="unknown rule"):
        common_volume(ball, ball, "voxels")  # type: ignore[arg-type]  # the wrong rule is the point


def test_too_many_cubes_are_refused() -> None:
    large = box(ORIGIN, np.full(3, 10.0))
    with pytest.raises(TooLargeForVoxels, match="larger cubes"):
        common_volume(large, large, "centres")
