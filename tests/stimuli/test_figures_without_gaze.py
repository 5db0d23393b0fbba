"""Figures whose eyes cannot turn: they stand by, and look nowhere that could be told."""

import json
import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.stimuli.glb_figure import write_glb
from visavis.cli.main import app
from visavis.lab.errors import DesignError
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.characters.checking import findings
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.gltf.exporting import glb_of_character
from visavis.stimuli.characters.gltf.vrm_presets import preset_amounts
from visavis.stimuli.characters.library import import_characters
from visavis.stimuli.characters.sizing import scale_to_stature
from visavis.stimuli.characters.storage import read_character, write_character
from visavis.stimuli.dressing.casting import default_casting, members_of, use_cast
from visavis.stimuli.dressing.gathering import gathering_picture
from visavis.stimuli.gaze.behaviour import EyeBehaviour
from visavis.stimuli.gaze.blinks import Blinks
from visavis.stimuli.motion.telephoning import tragus_m
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M, SPEAKER_EYE_M, audience_scene
from visavis.study.scenes import Staging, person

UNTURNABLE: dict[str, dict[str, Any]] = {
    "no eyes": {"leave_out": ("left_eye", "right_eye")},
    "one eye": {"leave_out": ("right_eye",)},
    "too large": {"eye_radius_m": 0.05},
    "on the head": {"eyes_on_head": True, "eye_radius_m": 0.035},
    "on discs": {"eye_ahead_m": 0.05},
    "of one material called body": {"eye_ahead_m": 0.05, "worn_as": "body", "head_squares": 12},
}
EYE_PARTS = (PART_INDEX["left_eye"], PART_INDEX["right_eye"])


@pytest.fixture
def mascot(tmp_path: Path) -> Path:
    path = tmp_path / "mascot.glb"
    write_glb(path, **UNTURNABLE["on discs"])
    return path


def assert_has_no_eyes(figure: Character) -> None:
    assert not figure.has_gaze
    assert "eye" not in {material.kind for material in figure.materials}
    for mesh in (*figure.levels, *figure.measuring):
        assert not np.isin(mesh.triangle_part, EYE_PARTS).any()


@pytest.mark.parametrize("change", UNTURNABLE.values(), ids=UNTURNABLE)
def test_eyes_that_cannot_turn_are_part_of_the_head(tmp_path: Path, change: dict[str, Any]) -> None:
    write_glb(tmp_path / "mascot.glb", **change)
    with pytest.raises(CharacterError, match="--without-gaze, as somebody who stands by"):
        import_gltf(tmp_path / "mascot.glb", gender="female")
    figure = import_gltf(tmp_path / "mascot.glb", gaze=False)
    assert_has_no_eyes(figure)
    assert None is figure.gender
    assert np.isfinite(figure.skeleton.rest_m).all()
    assert not [text for text in findings(figure) if "eye" in text or "lids" in text]


def test_eyes_stay_as_the_file_has_them_turned(tmp_path: Path) -> None:
    write_glb(tmp_path / "mascot.glb", eye_yaw_deg=20.0, eye_radius_m=0.014)
    poles_m = []
    for gaze in (True, False):
        mesh = import_gltf(tmp_path / "mascot.glb", gender="female", gaze=gaze).levels[0]
        # At the front pole of a lathed ball 16 triangles meet.
        corners, counts = np.unique(mesh.triangles, return_counts=True)
        places_m = mesh.vertices_m[corners[counts == 16]]
        poles_m.append(places_m[places_m[:, 2].argmin()])
    chord_m = 2 * 0.014 * np.sin(np.radians(10.0))
    assert pytest.approx(chord_m, abs=1e-4) == np.linalg.norm(poles_m[0] - poles_m[1])


def test_library_keeps_that_a_figure_has_no_gaze(tmp_path: Path, mascot: Path) -> None:
    write_character(import_gltf(mascot, gaze=False), tmp_path / "mascot.npz")
    figure = read_character(tmp_path / "mascot.npz")
    assert_has_no_eyes(figure)
    assert None is figure.gender
    assert_has_no_eyes(scale_to_stature(figure, 1.2))


def test_export_keeps_that_a_figure_has_no_gaze(tmp_path: Path, mascot: Path) -> None:
    path = tmp_path / "again.glb"
    path.write_bytes(glb_of_character(import_gltf(mascot, gaze=False)))
    assert_has_no_eyes(import_gltf(path))


def test_an_exported_person_may_come_back_without_gaze_their_eyes_painted(tmp_path: Path) -> None:
    path = tmp_path / "anna.glb"
    path.write_bytes(glb_of_character(load_character("anna"), level=2))
    figure = import_gltf(path, gaze=False)
    assert_has_no_eyes(figure)
    eyes = next(m for m in figure.materials if m.name.startswith("eye"))
    assert eyes.texture_srgb is not None


@pytest.mark.usefixtures("nobody_cast")
def test_figures_without_gaze_play_under_their_names_alone(tmp_path: Path, mascot: Path) -> None:
    library = tmp_path / "characters"
    write_glb(tmp_path / "two_M.glb")
    imports = [
        *import_characters(mascot, library, gender="male", gaze=False),
        *import_characters(tmp_path / "two_M.glb", library),
    ]
    assert all(result.character for result in imports)
    use_cast(members_of(["mascot", "two_M"], tmp_path, library), library)
    assert "two_M" == default_casting("male_01").name
    assert "mascot" == default_casting("mascot").name
    with pytest.raises(DesignError, match=r"no female .* with gaze: without it \(mascot\)"):
        default_casting("female_01")
    with pytest.raises(DesignError, match=r"nobody plays 'robot'; .*mascot, two_M, anna"):
        default_casting("robot")


@pytest.mark.parametrize("name", ["anna", "female_01", "male_1"])
def test_a_figure_whose_name_scenes_take_for_somebody_else_is_refused(
    tmp_path: Path, name: str
) -> None:
    write_glb(tmp_path / f"{name}.glb", **UNTURNABLE["on discs"])
    (result,) = import_characters(tmp_path / f"{name}.glb", tmp_path / "library", gaze=False)
    assert f"another name, such as own_{name}.glb" in result.problem
    assert not (tmp_path / "library").exists()


def test_somebody_of_the_cast_comes_back_under_the_name_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "sister.glb"
    path.write_bytes(glb_of_character(load_character("anna"), level=2))
    (result,) = import_characters(path, tmp_path / "library")
    assert result.character is not None
    assert "sister" == result.character.name


def test_who_has_no_gaze_looks_nowhere_and_is_never_made_to() -> None:
    m, close = 11, 3
    scene = audience_scene([f"c{i}" for i in range(m)])
    agents = tuple(replace(a, has_gaze=i != close) for i, a in enumerate(scene.agents))
    blinks = Blinks(*(np.array([row], np.int64) for row in (close, 0, 10**9)))
    eyes = EyeBehaviour.of_scene(
        replace(scene, agents=agents), target_m=SPEAKER_EYE_M, blinks=blinks
    )
    gaze, openness, is_moving = eyes.at(5 * 10**8, PARTICIPANT_EYE_M)
    distance_m = eyes.distance_m(0, PARTICIPANT_EYE_M)
    unknown = np.arange(m) == close
    for values in (gaze.sum(axis=1), openness, distance_m):
        np.testing.assert_array_equal(unknown, np.isnan(values))
    assert not is_moving
    for make in (eyes.staring, lambda who: eyes.turning(who, 0, to_observer=True)):
        with pytest.raises(DesignError, match=r"c3 has no gaze: .* let somebody whose eyes turn"):
            make(close)


BLINKS: dict[str, tuple[list[str], bool]] = {
    "ARKit": (["eyeBlinkLeft", "eyeBlinkRight"], True),
    "VRM": (["Blink"], True),
    "VRoid": (["Face.M_F00_000_00_Fcl_EYE_Close"], True),
    "one eye": (["eyeBlinkLeft"], False),
    "one eye in words": (["left_eye_close"], False),
    "two eyes in words": (["left_eye_closed", "right_eye_closed"], True),
    "none": (["jawOpen"], False),
}


@pytest.mark.parametrize(("shapes", "has_lids"), BLINKS.values(), ids=BLINKS)
def test_lids_are_those_that_shapes_of_a_file_close(
    tmp_path: Path, shapes: list[str], has_lids: bool
) -> None:
    write_glb(tmp_path / "mascot.glb", **UNTURNABLE["on discs"], shapes=shapes)
    figure = import_gltf(tmp_path / "mascot.glb", gaze=False)
    assert has_lids == figure.has_lids
    if has_lids:  # both sides together close them once
        morphs = figure.levels[0].morphs
        downs_m = [morphs[f"{side}_blink"].delta_m[:, 1].min() for side in ("left", "right")]
        assert pytest.approx(-0.005 * len(shapes), rel=1e-3) == sum(downs_m)


def _as_vrm(path: Path, extensions: dict[str, Any]) -> None:
    """Write a file again with extensions that say what its shapes are."""
    data = path.read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    text = json.dumps(json.loads(data[20 : 20 + length]) | {"extensions": extensions}).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    path.write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text + rest)


def _vrm(version: str, node: int, targets_of: dict[str, tuple[Any, float]]) -> dict[str, Any]:
    """Return what a VRM says of presets: the number of a target and how far it goes, 0 to 1."""
    if version == "VRMC_vrm":
        presets = {
            name: {"morphTargetBinds": [{"node": node, "index": k, "weight": weight_01}]}
            for name, (k, weight_01) in targets_of.items()
        }
        return {version: {"expressions": {"preset": presets}}}
    groups = [
        {
            "name": "x",
            "presetName": {"blinkLeft": "blink_l", "blinkRight": "blink_r"}.get(name, name),
            "binds": [{"mesh": 0, "index": k, "weight": 100 * weight_01}],
        }
        for name, (k, weight_01) in targets_of.items()
    ]
    return {version: {"blendShapeMaster": {"blendShapeGroups": groups}}}


@pytest.mark.parametrize("version", ["VRM", "VRMC_vrm"])
@pytest.mark.parametrize(
    ("targets_of", "downs_m"),
    [
        ({"blinkLeft": (1, 1.0), "blinkRight": (0, 1.0)}, [-0.005, -0.005]),
        ({"blink": (1, 0.5)}, [-0.00125, -0.00125]),
    ],
    ids=["each", "both"],
)
def test_lids_are_those_that_presets_of_a_vrm_bind_by_number(
    tmp_path: Path, version: str, targets_of: dict[str, tuple[int, float]], downs_m: list[float]
) -> None:
    path = tmp_path / "mascot.glb"
    write_glb(path, **UNTURNABLE["on discs"], shapes=["expr07", "expr12"])
    assert not import_gltf(path, gaze=False).has_lids
    data = path.read_bytes()
    tree = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    (node,) = (i for i, one in enumerate(tree["nodes"]) if one.get("mesh") == 0)
    _as_vrm(path, _vrm(version, node, targets_of))
    figure = import_gltf(path, gaze=False)
    assert figure.has_lids
    morphs = figure.levels[0].morphs
    lowest_m = [morphs[f"{side}_blink"].delta_m[:, 1].min() for side in ("left", "right")]
    assert pytest.approx(downs_m, rel=1e-3) == lowest_m


@pytest.mark.parametrize(
    "extensions",
    [
        None,
        {"VRM": None},
        {"VRM": {"blendShapeMaster": {"blendShapeGroups": 7}}},
        {"VRM": {"blendShapeMaster": {"blendShapeGroups": [None, {"binds": [None, {}]}]}}},
        _vrm("VRM", 0, {"blink": (None, 1.0)}),
        _vrm("VRM", 0, {"blink": (0, float("nan"))}),
        _vrm("VRMC_vrm", 0, {"blink": (0, float("inf"))}),
        {"VRMC_vrm": {"expressions": {"preset": {"blink": None, "aa": {"morphTargetBinds": 7}}}}},
        {
            "VRMC_vrm": {
                "expressions": {
                    "preset": {
                        "blink": {"morphTargetBinds": [{"node": 0, "index": 1, "weight": "x"}]}
                    }
                }
            }
        },
    ],
)
def test_presets_that_bind_nothing_move_nothing(extensions: Any) -> None:
    file: Any = SimpleNamespace(tree={"extensions": extensions}, items=lambda _: [{"mesh": 0}])
    assert {} == preset_amounts(file, 0)


@pytest.mark.parametrize(
    ("version", "presets"),
    [
        ("VRM", ("a", "joy", "lookup", "lookdown")),
        ("VRMC_vrm", ("aa", "happy", "lookUp", "lookDown")),
    ],
)
def test_presets_of_mouth_and_looks_become_ours(version: str, presets: tuple[str, ...]) -> None:
    amounts_01 = dict(zip(presets, ((3, 1.0), (2, 0.5), (1, 1.0), (0, 0.25)), strict=True))
    extensions = _vrm(version, 0, {**amounts_01, "angry": (4, 1.0)})
    file: Any = SimpleNamespace(tree={"extensions": extensions}, items=lambda _: [{"mesh": 0}])
    expected = {
        "jaw_open": {3: 1.0},
        "smile": {2: 0.4},
        "lids_up": {1: 1.0},
        "lids_down": {0: 0.25},
    }
    assert expected == preset_amounts(file, 0)


def test_who_has_no_gaze_blinks_with_the_lids_of_their_file() -> None:
    m, close = 11, 3
    scene = audience_scene([f"c{i}" for i in range(m)])
    agents = tuple(
        replace(a, has_gaze=i != close, has_lids=True) for i, a in enumerate(scene.agents)
    )
    blinks = Blinks(*(np.array([row], np.int64) for row in (close, 0, 10**9)))
    eyes = EyeBehaviour.of_scene(
        replace(scene, agents=agents), target_m=SPEAKER_EYE_M, blinks=blinks
    )
    for t_ns, openness_01 in ((4 * 10**8, 0.0), (2 * 10**9, 1.0)):
        gaze, openness, is_moving = eyes.at(t_ns, PARTICIPANT_EYE_M)
        assert openness_01 == openness[close]
        assert (openness_01 < 1) == is_moving
        np.testing.assert_array_equal(np.arange(m) == close, np.isnan(gaze.sum(axis=1)))
    assert np.isnan(eyes.distance_m(0, PARTICIPANT_EYE_M)[close])


@pytest.mark.usefixtures("nobody_cast")
@pytest.mark.parametrize("is_closed", [True, False])
def test_a_figure_without_gaze_in_a_gathering_is_drawn_with_its_lids(
    tmp_path: Path, is_closed: bool
) -> None:
    library, mascot = tmp_path / "characters", tmp_path / "mascot.glb"
    write_glb(mascot, **UNTURNABLE["on discs"], shapes=BLINKS["ARKit"][0])
    (result,) = import_characters(mascot, library, gender="male", gaze=False)
    assert result.character, result.problem
    use_cast(members_of(["mascot"], tmp_path, library), library)
    scene = person(Staging(np.random.default_rng(0), 5.0), character="mascot", eyes="none").scene
    assert [True] == [agent.has_lids for agent in scene.agents]
    openness_01 = np.array([float(not is_closed)])
    picture = gathering_picture(SceneFrame(scene, 0, np.full((1, 3), np.nan), openness_01))
    row = MORPHS.index("left_blink")
    assert float(is_closed) == picture.people.morphs_01[0, row]


def test_a_head_with_flat_sides_has_no_ear() -> None:
    box = np.array([[-0.12, y, z] for y in np.linspace(0, 0.1, 20) for z in (-0.1, 0.0, 0.1)])
    assert tragus_m(box, np.array([-0.03, 0.06, -0.05])) is None


@pytest.mark.slow
def test_import_and_list_say_who_has_no_gaze(tmp_path: Path, mascot: Path) -> None:
    library = ["--library", str(tmp_path / "characters")]

    def output_of(*words: str) -> str:
        result = CliRunner().invoke(app, ["character", *words, *library])
        assert result.exit_code == 0, result.output
        return result.output

    words = ("import", str(mascot), "--without-gaze", "--stature", "1.2")
    assert "mascot: a figure, 1.20 m, without gaze" in output_of(*words)
    rows = {row["name"]: row["has_gaze"] for row in json.loads(output_of("list", "--json"))}
    assert (True, False) == (rows["anna"], rows["mascot"])
