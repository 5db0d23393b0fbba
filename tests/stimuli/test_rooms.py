import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.errors import DesignError
from visavis.lab.geometry import rotate
from visavis.stimuli.rooms import surfaces
from visavis.stimuli.rooms.audience_room import Chair, audience_room, step_height_m
from visavis.stimuli.rooms.office import office
from visavis.stimuli.rooms.solids import (
    box,
    cylinder,
    flat,
    join_meshes,
    lathe,
    move_mesh,
    volume_m3,
)
from visavis.stimuli.rooms.station import board_face, board_pose, station
from visavis.stimuli.scenes import audience, station_crowd
from visavis.stimuli.scenes import office as office_places

GREY = (120, 120, 120)
ROOMS = (audience_room, station, office)


@given(
    size=st.tuples(*[st.floats(0.01, 5.0)] * 3),
    yaw_deg=st.floats(-180, 180),
    by=st.tuples(*[st.floats(-3, 3)] * 3),
)
def test_volume_of_a_box_survives_turning_and_shifting(size, yaw_deg, by):
    mesh = move_mesh(box((0, 0, 0), size, GREY), by, yaw_deg=yaw_deg)
    assert np.prod(size) == pytest.approx(volume_m3(mesh), rel=2e-3, abs=1e-5)


def test_chamfer_takes_a_triangle_from_every_edge_and_closes_the_box():
    cut = 0.1
    edges = 4 * 3.0 * cut**2 / 2  # twelve edges of one metre
    shared = 8 * cut**3 * (3 / 2 - 5 / 6)  # counted twice or thrice where edges meet
    expected = 1 - edges + shared
    assert expected == pytest.approx(
        volume_m3(box((0, 0, 0), (1, 1, 1), GREY, chamfer_m=cut)), abs=3e-3
    )


def test_solids_close_and_look_outward():
    assert np.pi * 2 == pytest.approx(
        volume_m3(cylinder((0, 0, 0), (0, 2, 0), 1.0, GREY, sides=256)), rel=1e-3
    )
    frustum = np.pi * 1.0 / 3 * (1.0 + 0.5 + 0.25)
    assert frustum == pytest.approx(
        volume_m3(cylinder((1, 1, 1), (2, 1, 1), 1.0, GREY, sides=256, end_radius_m=0.5)),
        rel=1e-3,
    )
    profile = [(1e-6, 0), (0.5, 0), (0.5, 1), (1e-6, 1)]
    assert np.pi / 4 == pytest.approx(volume_m3(lathe(profile, GREY, sides=256)), rel=1e-3)


def test_front_of_a_flat_piece_is_u_cross_v():
    assert flat((0, 0, 0), (1, 0, 0), (0, 1, 0), GREY).normals[0].tolist() == [0, 0, 1]


def test_joined_meshes_keep_their_volumes():
    both = join_meshes(box((0, 0, 0), (1, 1, 1), GREY), box((5, 0, 0), (1, 2, 1), GREY))
    assert volume_m3(both) == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize("size", [(0, 1, 1), (1, -1, 1)])
def test_a_box_without_extent_is_refused(size):
    with pytest.raises(DesignError, match="three lengths above 0"):
        box((0, 0, 0), size, GREY)


@pytest.mark.parametrize("make", ROOMS)
def test_every_prop_of_a_room_is_sound(make):
    room = make()
    assert len({p.name for p in room.props}) == len(room.props)
    for prop in room.props:
        mesh = prop.mesh
        n = len(mesh.vertices_m)
        assert n == len(mesh.normals) == len(mesh.colour_srgb) == len(mesh.uv), prop.name
        assert mesh.triangles.min() >= 0, prop.name
        assert mesh.triangles.max() < n, prop.name
        np.testing.assert_allclose(1, np.linalg.norm(mesh.normals, axis=1), atol=1e-3)
        corners = mesh.vertices_m[mesh.triangles].astype(np.float64)
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        side = np.sum(face * mesh.normals[mesh.triangles].mean(axis=1), axis=1)
        wrong = (side < -1e-9).mean()
        assert wrong == 0 or prop.material.double_sided, (prop.name, wrong)


@pytest.mark.parametrize("make", ROOMS)
def test_a_room_is_built_once(make):
    assert make() is make()


def test_chairs_of_the_audience_are_as_high_and_as_far_back_as_is_given():
    agents = audience.audience_scene([str(i) for i in range(11)]).agents
    chairs = {"left_close": Chair(0.47, 0.05), "back_centre": Chair(1.40, -0.10)}
    room = audience_room(chairs)
    for place, chair in chairs.items():
        cushion = next(p for p in room.props if p.name == f"chair_{place}_cushion")
        seat = cushion.mesh.vertices_m[:24, 1].max()
        assert chair.top_m == pytest.approx(seat, abs=1e-6)
        agent = next(a for a in agents if a.place == place)
        back_m = (agent.eye_centre_m - cushion.mesh.vertices_m) @ agent.facing
        behind_middle_m = 0.265
        assert chair.behind_eyes_m + behind_middle_m == pytest.approx(back_m.max(), abs=1e-6)


def test_every_seat_of_the_audience_is_of_a_usable_height():
    for agent in audience.audience_scene([str(i) for i in range(11)]).agents:
        sitting_head_m = 0.77  # head centre above the seat of the people who sit there
        seat = agent.head_centre_m[1] - sitting_head_m - step_height_m(agent.head_centre_m)
        assert 0.32 <= seat <= 0.60, agent.place


def test_the_board_faces_the_crowd_and_hangs_above_it():
    face = board_face("4").prop.mesh
    pose = board_pose()
    towards_crowd = -np.array([pose.position_m[0], 0, pose.position_m[2]])
    normal = rotate(pose.orientation_wxyz, face.normals[0].astype(float))
    assert normal @ towards_crowd / np.linalg.norm(towards_crowd) == pytest.approx(1.0, abs=1e-6)
    assert face.vertices_m[:, 1].min() + pose.position_m[1] > 1.7


def test_the_board_shows_a_number_only_when_it_is_given():
    without, with_track = (board_face(t).prop.material.texture_srgb for t in (None, "7"))
    amber = [
        (np.abs(p.astype(int) - (255, 186, 60)).max(axis=2) < 30).sum()
        for p in (without, with_track)
    ]
    assert amber[0] == 0
    assert amber[1] > 1000


def test_nothing_in_the_station_stands_where_the_crowd_stands():
    half = station_crowd.SIDE_M / 2
    for prop in station().props:
        v = prop.mesh.vertices_m
        inside = (np.abs(v[:, [0, 2]]) < half).all(axis=1) & (v[:, 1] > 0.02) & (v[:, 1] < 2.1)
        assert not inside.any(), prop.name


def test_neighbours_of_a_participant_are_the_places_beside_them():
    assert office_places.neighbour("place_3", "left").name == "place_2"
    assert office_places.neighbour("place_3", "self").name == "place_3"
    assert office_places.neighbour("place_4", "right").name == "place_5"


@pytest.mark.parametrize("asked", [("place_1", "left"), ("place_3", "up")])
def test_nobody_is_waved_at_beyond_the_line(asked):
    with pytest.raises(DesignError, match="nobody is waved at"):
        office_places.neighbour(*asked)


def test_unknown_place_of_the_office_is_named():
    with pytest.raises(DesignError, match="no place 'kitchen'"):
        office_places.place("kitchen")


def test_textures_repeat_without_a_seam_and_from_their_seed():
    first = surfaces.plaster(4).astype(int)
    assert np.abs(first[0] - first[-1]).mean() < 4
    assert np.abs(first[:, 0] - first[:, -1]).mean() < 4
    surfaces.plaster.cache_clear()
    np.testing.assert_array_equal(first, surfaces.plaster(4))
