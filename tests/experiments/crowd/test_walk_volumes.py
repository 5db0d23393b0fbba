"""Volumes along a walk: the fast way equals the plain one, culls lose nothing, gaps stay gaps."""

from dataclasses import replace

import numpy as np
import pytest

from tests.experiments.crowd.synthetic_body import STATURE_M, carried, nowhere_near
from visavis.analysis.collisions import (
    MalformedMesh,
    NonFiniteMesh,
    OpenMesh,
    Settings,
    common_volume,
    enclosed_volume_m3,
    sphere,
)
from visavis.analysis.collisions.pair import measure_within
from visavis.analysis.collisions.skinned import (
    SkinnedBody,
    body_of,
    move_joints,
    pose_slices,
    room_for,
    skin_vertices,
)
from visavis.experiments.crowd.collision_measures import (
    SURFACE_REACH_M,
    collision_rows,
    volumes_or_nearness,
    walk_volumes,
)
from visavis.experiments.crowd.measures import MeasureParameters, measure_walk
from visavis.experiments.crowd.surfaces import (
    avatar_of,
    checked_surface,
    crowd_surfaces,
    own_surface,
    own_surfaces,
    person_surface,
)
from visavis.lab.body_joints import BODY_JOINTS
from visavis.stimuli.characters.closing import collision_mesh
from visavis.stimuli.contact.idle import crowd_poses, people_of
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.scenes.station_crowd import CHARACTERS, station_crowd

SURFACES = ("characters", "light")


@pytest.fixture(scope="module")
def walk():
    return carried(2.0, step_s=0.05)


def in_pose(bodies, i, position, world, scale=1.0):
    """Return body i of some, and its pose: wide boxes, nothing skinned."""
    body, room = body_of(bodies, i), room_for(bodies)
    move_joints(body, position, world, scale, room)
    return body, room


def slices_of(body):
    """Return the vertices at the corners of each slice's faces, as `pack` numbers them."""
    return [
        np.unique(f) for f in np.split(body.faces, (body.face_begin - body.face_begin[0])[1:-1])
    ]


def all_vertices(body, room):
    vertices = np.empty_like(body.rest_m)
    everything = np.arange(len(vertices), dtype=np.int32)
    skin_vertices(body.rest_m, body.bones, body.weights, room.moves, everything, vertices)
    return vertices


def volume_within(own, mine, other, theirs):
    """Return the common volume of two whole bodies in the box of what their slices share."""
    boxes, surfaces = [], []
    for body, room in ((own, mine), (other, theirs)):
        vertices = all_vertices(body, room)
        parts = [vertices[corners] for corners in slices_of(body)]
        boxes.append(np.array([(p.min(axis=0), p.max(axis=0)) for p in parts]))
        surfaces += [vertices, body.faces]
    a, b = boxes[0][:, None], boxes[1][None]
    low, high = np.maximum(a[:, :, 0], b[:, :, 0]), np.minimum(a[:, :, 1], b[:, :, 1])
    meets = (low < high).all(axis=2)
    if not meets.any():
        return 0.0
    low, high, rule = low[meets].min(axis=0), high[meets].max(axis=0), Settings()
    limits = rule.cell_m, rule.refine_below_m3, rule.fine_columns
    return measure_within(*surfaces, low, high, *limits)[0]


@pytest.mark.parametrize("surface", SURFACES)
def test_the_kernel_is_within_a_grid_s_noise_of_measuring_every_pair_one_by_one(walk, surface):
    measured = walk_volumes(walk, surface=surface).volume_m3
    assert (measured > 1e-6).sum() > 10
    avatar = avatar_of(None, STATURE_M)
    own, size_m = own_surface(surface, avatar)
    people = people_of(walk.crowd)
    here = there = 0.0
    for i in range(0, len(walk.t_ns), 8):
        joints = walk.position_m[i], walk.orientation_wxyz[i], STATURE_M / size_m
        mesh, me = own.mesh_at(*joints), in_pose(own_surfaces(surface, avatar), 0, *joints)
        position, turn = crowd_poses(people, float(walk.crowd_t_s[i]))
        near = np.linalg.norm(walk.crowd.position_m - walk.place_m[i], axis=1) < 1.6
        for person in np.flatnonzero(near).tolist():
            who = int(walk.crowd.character[person])
            other = person_surface(who, surface)
            plain = common_volume(mesh, other.mesh_at(position[person], turn[person])).volume_m3
            # Columns are laid through what slices of the two share, not through whole bodies.
            them = in_pose(crowd_surfaces(surface), who, position[person], turn[person])
            assert volume_within(*me, *them) == measured[i, person]
            assert plain == pytest.approx(measured[i, person], rel=0.06, abs=1e-7)
            assert (plain > 1e-6) == (measured[i, person] > 1e-6)
            here, there = here + measured[i, person], there + plain
        assert not measured[i, ~near].any()
    assert here == pytest.approx(there, rel=0.02)  # less than a cubic centimetre in all


@pytest.mark.parametrize("surface", SURFACES)
def test_who_shares_volume_is_near_and_nearness_alone_measures_nothing(walk, surface):
    measured = walk_volumes(walk, surface=surface).volume_m3
    near = volumes_or_nearness(walk, surface, avatar_of(None, STATURE_M), only_near=True)
    assert set(np.unique(near)) == {0.0, 1.0}
    assert (near[measured > 0] == 1.0).all()


@pytest.mark.parametrize("surface", SURFACES)
def test_wide_boxes_hold_the_posed_slices_and_tight_ones_fit_them(surface):
    bodies = crowd_surfaces(surface)
    position, turn = crowd_poses(people_of(station_crowd(3)), 12.3)
    for joints, turns in zip(position[:6], turn[:6], strict=True):
        body, room = in_pose(bodies, 2, joints, turns)
        vertices = all_vertices(body, room)
        slices = slices_of(body)
        pose_slices(body, room, np.arange(len(slices), dtype=np.int32))
        assert np.array_equal(vertices, room.vertices_m[: len(vertices)])
        for corners, wide, tight in zip(slices, room.wide, room.tight, strict=False):
            low, high = vertices[corners].min(axis=0), vertices[corners].max(axis=0)
            assert (wide[:3] <= low).all()
            assert (high <= wide[3:]).all()
            assert [*low, *high] == tight.tolist()
        assert (room.whole[:3] <= vertices.min(axis=0)).all()
        assert (vertices.max(axis=0) <= room.whole[3:]).all()


@pytest.mark.parametrize("surface", SURFACES)
def test_a_packed_body_is_the_same_surface_in_another_order(surface):
    body, packed = person_surface(2, surface), body_of(crowd_surfaces(surface), 2)
    position, turn = crowd_poses(people_of(station_crowd(3)), 12.3)
    mesh = body.mesh_at(position[0], turn[0])
    vertices = all_vertices(*in_pose(crowd_surfaces(surface), 2, position[0], turn[0]))

    def sorted_faces(vertices_m, faces):
        flat = vertices_m[faces].reshape(len(faces), 9)
        return flat[np.lexsort(flat.T)]

    expected = sorted_faces(mesh.vertices_m, mesh.faces)
    assert np.array_equal(expected, sorted_faces(vertices, packed.faces))


def test_nobody_reaches_farther_than_the_search_does():
    crowd = station_crowd(4)
    people = people_of(crowd)
    for t_s in (0.0, 7.7, 31.0):
        position, turn = crowd_poses(people, t_s)
        for person in range(0, len(crowd), 5):
            body = person_surface(int(crowd.character[person]), "characters")
            at = body.mesh_at(position[person], turn[person]).vertices_m[:, [0, 2]]
            reach = np.linalg.norm(at - crowd.position_m[person], axis=1).max()
            assert reach < SURFACE_REACH_M


def test_every_character_is_a_closed_body_of_a_persons_volume():
    packed = crowd_surfaces("characters")
    assert len(CHARACTERS) == len(packed.joints_m)
    for k in range(len(CHARACTERS)):
        body = person_surface(k, "characters")
        position, turn = crowd_poses(people_of(station_crowd(1))[:1], 0.0)
        assert 0.03 < enclosed_volume_m3(body.mesh_at(position[0], turn[0])) < 0.13


def test_an_open_character_is_refused_by_name():
    mesh = collision_mesh(default_casting("female_01"))
    high = mesh.vertices_m[mesh.triangles][:, :, 1].mean(axis=1)
    headless = replace(mesh, triangles=mesh.triangles[high < np.quantile(high, 0.95)])
    with pytest.raises(OpenMesh, match="collision mesh of nobody"):
        checked_surface(headless, "nobody")


def test_an_inverted_character_is_turned_right_again():
    mesh = collision_mesh(default_casting("male_02"))
    mended = checked_surface(replace(mesh, triangles=mesh.triangles[:, ::-1].copy()), "inverted")
    assert 0.03 < enclosed_volume_m3(mended) < 0.13
    assert mended.repairs


def test_one_part_of_a_character_that_is_inside_out_is_turned_too():
    mesh = collision_mesh(default_casting("male_02"))
    bag = sphere([0.6, 1.0, 0.0], 0.1, segments=24, rings=6)
    n = len(mesh.vertices_m)
    with_bag = replace(
        mesh,
        vertices_m=np.vstack([mesh.vertices_m, bag.vertices_m]).astype(np.float32),
        triangles=np.vstack([mesh.triangles, bag.faces[:, ::-1] + n]).astype(np.int32),
    )
    mended = checked_surface(with_bag, "bag")
    whole = enclosed_volume_m3(checked_surface(mesh, "none")) + enclosed_volume_m3(bag)
    assert whole == pytest.approx(enclosed_volume_m3(mended), rel=1e-5)


def test_a_character_too_small_for_a_person_is_refused():
    mesh = collision_mesh(default_casting("male_02"))
    with pytest.raises(MalformedMesh, match="less than a litre"):
        checked_surface(replace(mesh, vertices_m=mesh.vertices_m / 100), "tiny")


def test_a_character_with_a_lost_vertex_is_refused():
    mesh = collision_mesh(default_casting("male_02"))
    vertices = mesh.vertices_m.copy()
    vertices[7] = np.nan
    with pytest.raises(NonFiniteMesh, match="vertex 7"):
        checked_surface(replace(mesh, vertices_m=vertices), "lost")


def test_weights_that_do_not_sum_to_one_are_refused():
    body = person_surface(0, "light")
    with pytest.raises(MalformedMesh, match="make them sum to 1"):
        SkinnedBody(body.rest_m, body.faces, body.bones, body.weights / 2, body.joints_m)


def test_steps_without_a_tracked_joint_are_missing_and_cut_collisions(walk):
    whole = walk_volumes(walk, surface="light")
    person = int(np.nanargmax(whole.volume_m3.max(axis=0)))
    step = int(whole.volume_m3[:, person].argmax())
    hole = replace(walk, position_m=walk.position_m.copy())
    hole.position_m[step, 9] = np.nan
    measured = walk_volumes(hole, surface="light")
    assert np.isnan(measured.volume_m3[step]).all()
    assert np.isfinite(np.delete(measured.volume_m3, step, axis=0)).all()
    cut = [c for c in collision_rows(hole, measured) if c["person"] == person]
    assert any(c["cut"] for c in cut)


def test_a_collision_has_the_sources_volume_beside_its_own(walk):
    rows = collision_rows(walk, walk_volumes(walk, surface="light"))
    assert rows
    for row in rows:
        assert row["max_volume_published_dm3"] > row["max_volume_dm3"]
    body = collision_rows(walk, walk_volumes(walk, surface="capsules"))
    assert all(np.isnan(row["max_volume_published_dm3"]) for row in body)


@pytest.mark.parametrize("rule", ["centres", "published"])
def test_other_rules_are_named_and_published_ones_read_more(walk, rule):
    short = carried(0.3, step_s=0.05, begin=(-2.0, 2.1), end=(-1.8, 1.9))
    plain = walk_volumes(short, surface="light").volume_m3
    other = walk_volumes(short, rule=rule, surface="light")
    assert rule == other.rule
    assert {rule} == {c["rule"] for c in collision_rows(short, other)} or not plain.any()
    if rule == "published":
        assert other.volume_m3.sum() >= plain.sum()
    else:
        assert other.volume_m3.sum() == pytest.approx(plain.sum(), rel=0.5, abs=2e-4)


def test_nobody_near_means_no_collision_and_no_missing_value():
    place = nowhere_near()
    measured = walk_volumes(carried(0.2, begin=place, end=place), surface="light")
    assert not measured.volume_m3.any()


LIGHT = MeasureParameters(surface="light")
CAPSULES = MeasureParameters(surface="capsules")


def test_a_body_never_tracked_is_flagged_and_nothing_is_invented(walk):
    lost = replace(walk, position_m=np.full_like(walk.position_m, np.nan))
    row = measure_walk(lost, 0.7, LIGHT).row
    assert "not_measured_body_never_tracked" in row["flags"]
    assert row["lost_01"] == 1
    assert "collisions" not in row


def test_a_body_never_whole_has_no_number_of_collisions():
    walk = carried(3.0)
    walk.position_m[:, BODY_JOINTS.index("head")] = np.nan
    row = measure_walk(walk, 0.7, MeasureParameters(surface="capsules")).row
    assert 1.0 == row["lost_01"]
    assert row["collisions"] is None
    assert row["largest_volume_dm3"] is None
    assert np.isfinite(row["speed_m_s"])


def test_a_walk_out_of_the_room_is_flagged():
    out = carried(1.0, begin=(4.0, 4.5), end=(6.0, 4.5), step_s=0.05)
    assert "left_room" in measure_walk(out, 0.7, LIGHT).row["flags"]


def test_people_at_one_place_leave_cells_missing_with_the_reason():
    crowd = station_crowd(1)
    twice = crowd.position_m.copy()
    twice[5] = twice[6]
    measured = measure_walk(
        carried(1.0, step_s=0.05, crowd=replace(crowd, position_m=twice)), 0.7, LIGHT
    )
    assert "no_cells" in measured.row["flags"]
    assert measured.row["cells"] is None
    assert measured.row["shoulders_to_gap_deg"] is None
    assert "same place" in measured.row["cells_problem"]
    assert np.isfinite(measured.row["speed_m_s"])


def test_gaps_are_flagged_and_counted(walk):
    hole = replace(walk, position_m=walk.position_m.copy())
    hole.position_m[3:6] = np.nan
    row = measure_walk(hole, 0.7, LIGHT).row
    assert "measured_with_gaps" in row["flags"]
    assert row["lost_01"] == pytest.approx(3 / len(walk.t_ns))


def test_collisions_are_told_per_minute_in_which_they_could_be_measured():
    walk = carried(3.0)
    whole = measure_walk(walk, 0.7, CAPSULES).row
    assert whole["tracked_s"] == pytest.approx(3.01)
    assert whole["collisions"] > 0
    per_min = 60 * whole["collisions"] / 3.01
    assert whole["collisions_per_tracked_min"] == pytest.approx(per_min)
    walk.position_m[100:200, BODY_JOINTS.index("left_hand")] = np.nan
    cut = measure_walk(walk, 0.7, CAPSULES).row
    assert cut["tracked_s"] == pytest.approx(2.01)
    per_min = 60 * cut["collisions"] / 2.01
    assert cut["collisions_per_tracked_min"] == pytest.approx(per_min)


def test_a_body_never_whole_has_no_time_and_no_rate_of_collisions():
    walk = carried(1.0)
    walk.position_m[:, BODY_JOINTS.index("head")] = np.nan
    row = measure_walk(walk, 0.7, CAPSULES).row
    assert 0.0 == row["tracked_s"]
    assert row["collisions_per_tracked_min"] is None
    walk.position_m[:] = np.nan
    row = measure_walk(walk, 0.7, CAPSULES).row
    assert 0.0 == row["tracked_s"]
