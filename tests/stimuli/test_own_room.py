"""A laboratory's own room: read, placed around who looks, and met by gaze as it is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stimuli.glb_room import ROOM, Box, write_room
from visavis.analysis.gaze.aoi import NONE, aoi_of_samples
from visavis.lab.errors import DataError, DesignError
from visavis.lab.geometry import quat_from_yaw_pitch_deg, rotate, unit
from visavis.stimuli.areas import areas_text, areas_under, read_areas_text, rooms_in
from visavis.stimuli.dressing import own_room
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.own_room import PlacedRoom, Room
from visavis.stimuli.room_areas import read_shape_text
from visavis.stimuli.room_shape import areas_of_room, shape_of
from visavis.stimuli.scene import Agent, Scene, SceneFrame
from visavis.stimuli.visibility import SceneGeometry

EYE = np.array([0.0, 1.2, 0.0])
NAMES = ("floor", "Red_lamp_001", "cupboard", "behind")


@pytest.fixture
def folder(tmp_path):
    write_room(tmp_path / "office.glb")
    return tmp_path


def placed(folder, **where):
    return PlacedRoom.of(Room("office.glb", **where), folder, None)


def met(areas, *points_m, eye_m=EYE):
    direction = unit(np.array(points_m) - eye_m)
    under = areas_under([areas], NAMES, np.broadcast_to(eye_m, direction.shape), direction)
    return ["" if at < 0 else NAMES[at] for at in under.tolist()]


def test_meshes_with_names_are_things_and_the_nearest_is_met(folder):
    areas = areas_of_room(placed(folder))
    assert NAMES == tuple(area.name for area in areas.areas)
    points_m = ((-0.4, 1.25, -2), (0.45, 1.2, -3), (0, 0, -1), (0, 2.9, -4), (0, 1.2, 9))
    assert ["Red_lamp_001", "cupboard", "floor", "", ""] == met(areas, *points_m)
    beside_m = np.array([1.4, 1.2, -3.0])  # from there nothing hides it
    assert ["behind"] == met(areas, (0.45, 1.2, -3), eye_m=beside_m)


def test_a_room_stands_around_who_looks_as_they_stand_in_it(folder):
    """Who stands before the lamp's right side and faces left sees it straight ahead."""
    areas = areas_of_room(placed(folder, stand_m=(1.0, 0.0, -1.85), yaw_deg=-90.0))
    assert ["Red_lamp_001"] == met(areas, (0, 1.2, -1))


def test_gaze_that_is_not_known_meets_nothing(folder):
    areas = areas_of_room(placed(folder))
    assert [-1] == areas.areas_met(EYE[None], np.full((1, 3), np.nan)).tolist()


def test_the_picture_of_a_scene_has_the_room_that_gaze_meets(folder):
    scene = Scene("room", (), room=placed(folder, yaw_deg=30.0))
    picture = picture_of(SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0)))
    again = picture_of(SceneFrame(scene, 9, np.zeros((0, 3)), np.zeros(0)))
    assert again.room is picture.room
    assert [b.name for b in ROOM if b.name][1:2] == ["Red lamp.001"]
    (lamp,) = (prop for prop in picture.room.props if prop.name == "Red_lamp_001")
    middle_m = lamp.mesh.vertices_m.mean(axis=0)
    assert ["Red_lamp_001"] == met(areas_of_room(scene.room), middle_m)
    red, green, _ = lamp.mesh.colour_srgb[0].tolist()
    assert red > 200 > 60 > green


@pytest.mark.parametrize(
    ("depth_m", "beside_deg", "expected"),
    [(4.0, 0.0, NONE), (4.0, 2.4, NONE), (1.2, 0.0, 0), (1.2, 6.2, 0), (1.2, 7.0, NONE)],
    ids=["behind it", "in the pad of one behind it", "before it", "in the pad", "beyond the pad"],
)
def test_a_head_is_looked_at_before_a_mesh_and_not_behind_one(
    folder, depth_m, beside_deg, expected
):
    """The cupboard is 2 m away; a head of 12 cm is 1.7 or 5.7 degrees around, its pad one more."""
    towards = unit(np.array([0.45, 1.2, -3.0]) - EYE)
    centre_m = EYE + depth_m * towards
    head = Agent("a", "c", "", centre_m, 0.12, np.array([0.0, 0.0, 1.0]), centre_m)
    geometry = SceneGeometry.from_scene(Scene("room", (head,), room=placed(folder)))
    ray = rotate(quat_from_yaw_pitch_deg(-beside_deg), towards)[None]
    angle, radius, pad_limit, hit = geometry.observe(EYE[None], ray, np.ones(1, np.bool_))
    assert [expected] == aoi_of_samples(angle, radius, pad_limit, hit, pad_deg=1.0).tolist()
    assert ["cupboard"] == met(geometry.room, EYE + ray[0])


def test_an_event_holds_what_gaze_needs(folder):
    areas = areas_of_room(placed(folder, stand_m=(0.2, 0.0, 0.1), yaw_deg=10.0))
    text, shape = areas_text([areas]), shape_of(placed(folder))
    (folder / "office.glb").unlink()
    assert {shape.sha256} == rooms_in(text)
    again = read_shape_text(**{("text" if k == "meshes" else k): v for k, v in shape.event.items()})
    (read,) = read_areas_text(text, {again.sha256: again})
    direction = unit(np.random.default_rng(1).standard_normal((200, 3)))
    eyes_m = np.broadcast_to(EYE, direction.shape)
    expected = areas.areas_met(eyes_m, direction)
    assert expected.tolist() == read.areas_met(eyes_m, direction).tolist()
    with pytest.raises(DataError, match=r"room office\.glb are not in the recording"):
        read_areas_text(text)


def test_what_is_hidden_is_not_seen_and_what_is_seen_has_its_size(folder):
    areas = areas_of_room(placed(folder))
    seen = {areas.areas[one.area].name: one for one in areas.seen_from(EYE, None)}
    assert {"floor", "Red_lamp_001", "cupboard"} == set(seen)
    assert ["Red_lamp_001"] == met(areas, seen["Red_lamp_001"].place_m)
    side_deg = np.degrees(2 * np.arctan(0.25 / 1.75))
    assert seen["Red_lamp_001"].size_deg2 == pytest.approx(side_deg**2, rel=0.25)


def test_a_file_that_was_changed_is_read_again(folder):
    before = shape_of(placed(folder))
    write_room(folder / "office.glb", ROOM[:3])
    (folder / "office.glb").touch()
    later = replace(placed(folder), modified_ns=placed(folder).modified_ns + 1)
    assert 5 == len(before.meshes)
    assert 3 == len(shape_of(later).meshes)


def test_a_room_that_cannot_be_is_told_by_name(folder, monkeypatch):
    def says(message, **limits):
        for name, value in limits.items():
            monkeypatch.setattr(own_room, name, value)
        own_room._read.cache_clear()
        with pytest.raises(DesignError, match=message):
            shape_of(placed(folder))
        monkeypatch.undo()

    says(r"office\.glb has 60 triangles, rooms at most 59; .* simpler", MAX_TRIANGLES=59)
    says(r"office\.glb has 0 MiB, rooms at most 0; .* smaller pictures", MAX_BYTES=0)
    write_room(folder / "office.glb", (ROOM[0], ROOM[2], Box("Red lamp 001", (0, 0, 0), (1, 1, 1))))
    says("two meshes called 'Red lamp 001' or 'Red lamp.001', in columns Red_lamp_001; .* other")
    write_room(folder / "office.glb", (ROOM[0], ROOM[0]))
    says("two meshes called 'floor'; gaze could not tell")
    write_room(folder / "office.glb", nodes=False)
    says(r"office\.glb has no meshes")
    whole = write_room(folder / "office.glb").read_bytes()
    (folder / "office.glb").write_bytes(whole[:-40])
    says(r"office\.glb: glTF version 2, \d+ of \d+ bytes")
    (folder / "office.glb").write_bytes(
        whole.replace(b'"nodes": [{"mesh": 0', b'"nodes": [{"mesh": 7')
    )
    says(r"office\.glb: its description does not fit its data")
    (folder / "office.glb").write_text("a room")
    says(r"office\.glb: not a glTF binary; export it as \.glb")
    (folder / "office.glb").rename(folder / "offices.glb")
    says(r"there is no room .*office\.glb; did you mean 'offices\.glb'")


@pytest.mark.parametrize("where", [{"stand_m": (0, 1)}, {"yaw_deg": 400}, {"stand_m": "here"}])
def test_a_place_in_a_room_that_cannot_be_is_refused(where):
    with pytest.raises(DesignError, match=r"Room 'office\.glb': stand_m"):
        Room("office.glb", **where)
