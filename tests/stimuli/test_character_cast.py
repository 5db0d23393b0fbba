import numpy as np
import pytest
from scipy.spatial import cKDTree

from visavis.lab.geometry import quat_from_yaw_pitch_deg, rotate
from visavis.stimuli.characters.body_parts import PART_INDEX, PARTS
from visavis.stimuli.characters.capsules import OUTSIDE_SHARE, PIECES
from visavis.stimuli.characters.cast import DATA, cast_names, load_cast, load_character
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.characters.closing import closed_surface, collision_mesh, is_closed, volume_m3
from visavis.stimuli.characters.coverage import seen_areas_m2, visible_area_m2
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.sizing import scale_to_stature
from visavis.stimuli.characters.skinning import shaped_m, skin, skin_vertices
from visavis.stimuli.characters.storage import read_character, write_character
from visavis.stimuli.motion.clip import floor_of_rest_m
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

NAMES = cast_names()
WITH_CURLS = ("chloe", "ike")
"""Whose hair is cards that are clear about their curls, which rays without pictures take as whole:
`tests.stage.test_hair_drawn` compares pictures of everybody's.
"""
BODY = tuple(p for p in PART_INDEX if p not in ("none", "held_object"))


def standing_wxyz() -> np.ndarray:
    turns = np.zeros((55, 4))
    turns[:, 0] = 1
    return turns


@pytest.fixture(params=NAMES)
def person(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


def test_cast_is_six_women_then_six_men_of_different_size_and_age() -> None:
    cast = load_cast()
    assert [c.gender for c in cast] == ["female"] * 6 + ["male"] * 6
    assert len({c.stature_m for c in cast}) == 12
    assert len({c.age_years for c in cast}) == 12
    assert max(c.stature_m for c in cast) - min(c.stature_m for c in cast) > 0.2


def test_the_whole_cast_has_at_most_25_megabytes() -> None:
    sizes = [(DATA / f"{name}.npz").stat().st_size for name in cast_names()]
    assert 12 == len(sizes)
    assert 25e6 >= sum(sizes)


def test_every_call_gives_the_same_objects() -> None:
    assert all(a is b for a, b in zip(load_cast(), load_cast(), strict=True))


def test_unknown_name_says_who_there_is() -> None:
    with pytest.raises(CharacterError, match="anna"):
        load_character("nobody")


def test_weights_sum_to_one_and_all_indices_exist(person: Character) -> None:
    for mesh in person.levels:
        np.testing.assert_allclose(mesh.weights.sum(axis=1), 1, atol=1e-6)
        assert mesh.joints.max() < 55
        assert mesh.triangles.max() == len(mesh.vertices_m) - 1
        assert mesh.triangle_material.max() < len(person.materials)
        assert np.isfinite(mesh.vertices_m).all()


def test_every_part_is_tagged_at_every_level_and_nothing_is_untagged(person: Character) -> None:
    for mesh in person.levels:
        assert set(np.unique(mesh.triangle_part)) == {PART_INDEX[p] for p in BODY}


def test_levels_have_26000_6000_and_2000_triangles(person: Character) -> None:
    counts = [len(mesh.triangles) for mesh in person.levels]
    np.testing.assert_allclose(counts, [26000, 6000, 2000], rtol=0.02)


def test_skeleton_has_the_canonical_joints_in_a_t_pose(person: Character) -> None:
    skeleton = person.skeleton
    assert skeleton.names == canonical_skeleton().names
    rest = skeleton.rest_m
    for side, x in (("left", -1), ("right", 1)):
        arm = [rest[skeleton.index(f"{side}_{j}")] for j in ("upper_arm", "lower_arm", "hand")]
        np.testing.assert_allclose(np.diff(arm, axis=0)[:, 1:], 0, atol=1e-6)
        assert (x * np.diff(arm, axis=0)[:, 0] > 0.15).all()
        leg = [rest[skeleton.index(f"{side}_{j}")] for j in ("upper_leg", "lower_leg", "foot")]
        np.testing.assert_allclose(np.diff(leg, axis=0)[:, [0, 2]], 0, atol=1e-6)


def test_mesh_stands_on_the_floor_that_motions_stand_on(person: Character) -> None:
    lowest = float(person.levels[0].vertices_m[:, 1].min())
    assert floor_of_rest_m(person.skeleton) == pytest.approx(lowest, abs=0.002)
    height = float(collision_mesh(person).vertices_m[:, 1].max()) - lowest
    assert person.stature_m == pytest.approx(height, abs=0.002)


def test_eyeball_is_a_sphere_about_its_joint_so_that_its_axis_is_straight_ahead(
    person: Character,
) -> None:
    mesh = person.levels[0]
    for side in ("left", "right"):
        j = person.skeleton.index(f"{side}_eye")
        ball = mesh.vertices_m[
            np.unique(mesh.triangles[mesh.triangle_part == PART_INDEX[f"{side}_eye"]])
        ]
        away = np.linalg.norm(ball - person.skeleton.rest_m[j], axis=1)
        assert person.eyeball.radius_m == pytest.approx(away.mean(), abs=1e-4)
        assert np.ptp(away) < 2e-4
        assert person.eyeball.pupil_radius_m < person.eyeball.iris_radius_m < away.min()


def test_blink_covers_the_eyes_and_lids_follow_them(person: Character) -> None:
    mesh = person.levels[0]
    weights = np.eye(len(MORPHS))
    blink = weights[MORPHS.index("left_blink")] + weights[MORPHS.index("right_blink")]

    def seen(w: np.ndarray) -> float:
        area = visible_area_m2(mesh, shaped_m(mesh, w), step_m=0.001)
        return area["left_eye"] + area["right_eye"]

    rest = seen(np.zeros(len(MORPHS)))
    assert rest > 1e-4
    assert seen(blink) < 0.02 * rest
    one = seen(weights[MORPHS.index("left_blink")])
    assert 0.3 * rest < one < 0.7 * rest
    upper = mesh.morphs["lids_down"].delta_m[:, 1].min()
    assert upper < -0.001
    assert mesh.morphs["lids_up"].delta_m[:, 1].max() > 0.0005
    assert set(mesh.morphs) == set(MORPHS) - {"frown"}


@pytest.mark.parametrize("copy", [0, 1])
def test_parts_of_copies_for_measuring_are_seen_as_large_as_in_the_full_mesh(
    person: Character, copy: int
) -> None:
    full, thin = (seen_areas_m2(mesh) for mesh in (person.levels[0], person.measuring[copy]))
    eyes = [PART_INDEX["left_eye"], PART_INDEX["right_eye"]]
    large = np.union1d(np.flatnonzero(full > 5e-4), eyes)
    assert len(large) >= 18  # all, but for a pelvis of which a long top leaves little
    if person.name in WITH_CURLS:
        large = large[large != PART_INDEX["scalp"]]
    errors = {PARTS[p]: round(thin[p] / full[p] - 1, 3) for p in large}
    assert {part: e for part, e in errors.items() if abs(e) > 0.05} == {}
    assert thin.sum() == pytest.approx(full.sum(), rel=0.02)


def test_collision_mesh_is_closed_outward_and_holds_a_body(person: Character) -> None:
    mesh = collision_mesh(person)
    assert is_closed(mesh)
    assert len(mesh.triangles) == pytest.approx(15000, rel=0.05)
    assert 0.04 < volume_m3(mesh.vertices_m, mesh.triangles) < 0.13
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1, atol=1e-6)


def test_body_without_a_closed_surface_gets_one_of_the_same_size() -> None:
    person = load_character("gabriel")
    bare = collision_mesh(person)
    wanted = volume_m3(bare.vertices_m, bare.triangles)
    built = closed_surface(bare, person.skeleton)
    assert is_closed(built)
    assert volume_m3(built.vertices_m, built.triangles) == pytest.approx(wanted, rel=0.04)
    # Of somebody in clothes it is what is seen from outside, hair and loose cloth included.
    dressed = closed_surface(person.levels[0], person.skeleton)
    assert is_closed(dressed)
    assert 1.2 * wanted < volume_m3(dressed.vertices_m, dressed.triangles) < 1.65 * wanted
    mesh = person.levels[0]
    corners = mesh.vertices_m[mesh.triangles]
    tenths = [(i, j, 10 - i - j) for i in range(11) for j in range(11 - i)]
    outside = np.concatenate([np.array(share) @ corners / 10 for share in tenths])
    away, _ = cKDTree(outside).query(dressed.vertices_m)
    assert np.quantile(away, 0.95) < 0.004


def test_capsules_hold_the_body_and_number_at_least_nineteen(person: Character) -> None:
    assert len(person.capsules) >= 19
    mesh = collision_mesh(person)
    for part, _, covers in PIECES:
        tags = [PART_INDEX[name] for name in covers]
        points = mesh.vertices_m[np.unique(mesh.triangles[np.isin(mesh.triangle_part, tags)])]
        inside = np.zeros(len(points), dtype=bool)
        for c in (c for c in person.capsules if c.part == part):
            start = person.skeleton.rest_m[person.skeleton.index(c.joint)] + c.start_m
            along = c.end_m - c.start_m
            share = np.clip((points - start) @ along / max(along @ along, 1e-12), 0, 1)
            away = np.linalg.norm(points - start - share[:, None] * along, axis=1)
            inside |= away <= c.radius_m + 1e-6
        assert inside.mean() >= 1 - OUTSIDE_SHARE, part


def test_skin_at_rest_is_the_mesh_and_follows_the_root_rigidly() -> None:
    person = load_character("anna")
    mesh, skeleton = person.levels[1], person.skeleton
    root = np.array([0.3, 1.0, -2.0])
    turns = standing_wxyz()
    at_rest = skin(mesh, skeleton, forward(skeleton, root, turns))
    np.testing.assert_allclose(at_rest.vertices_m, mesh.vertices_m + root, atol=2e-5)
    turns[0] = quat_from_yaw_pitch_deg(70)
    turned = skin(mesh, skeleton, forward(skeleton, root, turns))
    expected = rotate(turns[0], mesh.vertices_m.astype(np.float64)) + root
    np.testing.assert_allclose(turned.vertices_m, expected, atol=2e-5)
    np.testing.assert_allclose(np.linalg.norm(turned.normals, axis=1), 1, atol=1e-5)
    alone = skin_vertices(mesh, skeleton, forward(skeleton, root, turns))
    np.testing.assert_array_equal(alone, turned.vertices_m)


def test_wrong_number_of_shapes_or_joints_is_refused() -> None:
    person = load_character("anna")
    with pytest.raises(CharacterError, match=str(len(MORPHS))):
        shaped_m(person.levels[2], [1.0, 0.0])
    two = forward(person.skeleton, np.zeros((2, 3)), np.tile(standing_wxyz(), (2, 1, 1)))
    with pytest.raises(CharacterError, match="one person"):
        skin(person.levels[2], person.skeleton, two)


def test_sized_person_grows_in_all_measures() -> None:
    person = load_character("dai")
    tall = scale_to_stature(person, 1.5 * person.stature_m)
    np.testing.assert_allclose(
        tall.levels[2].vertices_m, np.float32(1.5) * person.levels[2].vertices_m, rtol=1e-6
    )
    np.testing.assert_allclose(tall.skeleton.rest_m, 1.5 * person.skeleton.rest_m)
    assert tall.capsules[0].radius_m == 1.5 * person.capsules[0].radius_m
    assert tall.eyeball.radius_m == 1.5 * person.eyeball.radius_m
    with pytest.raises(CharacterError, match="metres between"):
        scale_to_stature(person, 17.0)


def test_written_character_reads_back_the_same(tmp_path) -> None:
    person = load_character("karim")
    path = tmp_path / "karim.npz"
    write_character(person, path)
    back = read_character(path)
    for a, b in zip(person.levels, back.levels, strict=True):
        np.testing.assert_allclose(b.vertices_m, a.vertices_m, atol=1e-7)
        np.testing.assert_array_equal(b.triangles, a.triangles)
    assert [m.name for m in back.materials] == [m.name for m in person.materials]
    assert back.stature_m == person.stature_m


def test_broken_file_is_named(tmp_path) -> None:
    path = tmp_path / "torn.npz"
    path.write_bytes(b"PK\x03\x04 torn")
    with pytest.raises(CharacterError, match=r"torn\.npz"):
        read_character(path)
