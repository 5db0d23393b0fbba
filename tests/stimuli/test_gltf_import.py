import io
import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from PIL import Image

from tests.stimuli.glb_figure import (
    HEAD_HALF_M,
    SKIN_SRGB,
    SUIT_SRGB,
    Apart,
    Plate,
    bone_names,
    write_glb,
)
from tests.stimuli.valid_avatars import avatar_files, needs_avatars
from visavis.lab.geometry import angle_deg, unit
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import MORPHS, SkinnedMesh
from visavis.stimuli.characters.closing import collision_mesh, is_closed
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.gltf.eyes import fit_eye, iris_colour
from visavis.stimuli.characters.gltf.figure import Surface, read_figure
from visavis.stimuli.characters.gltf.file import GltfFile, read_glb
from visavis.stimuli.characters.gltf.looks import (
    CLOTH_ROUGHNESS_01,
    SKIN_ROUGHNESS_01,
    linear_of,
    srgb_of,
)
from visavis.stimuli.characters.gltf.skin import like_the_face, look_of_face
from visavis.stimuli.characters.library import import_characters, library_names
from visavis.stimuli.motion.skeleton import canonical_skeleton


@pytest.fixture
def glb(tmp_path: Path) -> Path:
    path = tmp_path / "probe_F_1.glb"
    write_glb(path)
    return path


def test_imported_figure_stands_in_our_t_pose_and_faces_forward(glb: Path) -> None:
    person = import_gltf(glb)
    assert person.gender == "female"
    assert person.skeleton.names == canonical_skeleton().names
    rest = person.skeleton.rest_m
    pattern = canonical_skeleton(1.70).rest_m
    body = [j for j, n in enumerate(person.skeleton.names) if "arm" in n or "leg" in n]
    np.testing.assert_allclose(rest[body], pattern[body], atol=0.002)
    mesh = person.levels[0]
    hand = mesh.triangles[mesh.triangle_part == PART_INDEX["left_hand"]]
    middle = mesh.vertices_m[np.unique(hand)].mean(axis=0)
    np.testing.assert_allclose(middle, rest[person.skeleton.index("left_hand")], atol=0.005)
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1, atol=1e-6)


def test_collar_bones_come_down_in_a_figure_made_with_its_arms_spread(tmp_path: Path) -> None:
    path = tmp_path / "spread_F.glb"
    heights = {}
    for down_deg in (0.0, 40.0):
        write_glb(path, arms_down_deg=down_deg)
        skeleton = import_gltf(path).skeleton
        at = {name: skeleton.rest_m[skeleton.index(name)] for name in skeleton.names}
        length = np.linalg.norm(at["left_upper_arm"] - at["left_shoulder"])
        np.testing.assert_allclose(
            at["left_upper_arm"] * [-1, 1, 1], at["right_upper_arm"], atol=1e-6
        )
        heights[down_deg] = at["left_upper_arm"][1] - at["left_shoulder"][1], length
    # A quarter of 35°, of a collar bone that lay level.
    spread, length = heights[0.0]
    assert spread == pytest.approx(heights[40.0][0] - length * np.sin(np.radians(8.75)), abs=1e-3)


def test_what_looks_like_the_face_is_skin_and_the_rest_is_not() -> None:
    skin, shirt, brown_shirt = (205, 150, 120), (40, 60, 120), (124, 102, 88)
    pixels = np.array([[skin, (150, 106, 84), shirt, brown_shirt]], np.uint8)
    column = np.array([0, 0, 1, 1, 2, 3])
    n = 12
    tiles = np.repeat(column, n)
    corners = np.arange(3 * len(tiles)).reshape(-1, 3)
    uv = np.repeat(np.stack([(tiles + 0.5) / 4, np.full(len(tiles), 0.5)], axis=1), 3, axis=0)
    faces = np.arange(len(tiles)) < 2 * n
    found = like_the_face(pixels, uv, corners, look_of_face(pixels, uv, corners, faces))
    np.testing.assert_array_equal(found, tiles < 2)


def test_eye_axis_is_fitted_from_the_eyeball_not_its_bone(glb: Path) -> None:
    file = read_glb(glb)
    figure = read_figure(file)
    y = np.radians(4.0)
    leaning = np.array([-np.sin(y), 0, -np.cos(y)])
    for side in ("left", "right"):
        eye = fit_eye(file, figure, side)
        assert angle_deg(eye.axis, leaning) < 0.05
        assert eye.radius_m == pytest.approx(0.014, abs=1e-5)


def test_eyeballs_on_the_head_get_bones_of_their_own(tmp_path: Path, glb: Path) -> None:
    """Mixamo's figures hang them there; nobody can look round with eyes that do not turn."""
    path = tmp_path / "staring_F.glb"
    write_glb(path, eyes_on_head=True)
    expected, person = import_gltf(glb), import_gltf(path)
    np.testing.assert_allclose(person.skeleton.rest_m, expected.skeleton.rest_m, atol=1e-6)
    assert person.eyeball.radius_m == pytest.approx(expected.eyeball.radius_m, rel=1e-6)
    for side in ("left", "right"):
        part = PART_INDEX[f"{side}_eye"]
        theirs, ours = (
            mesh.triangles[mesh.triangle_part == part]
            for mesh in (expected.levels[0], person.levels[0])
        )
        assert len(theirs) == len(ours) > 0
        bone = person.skeleton.index(f"{side}_eye")
        held = person.levels[0].joints[np.unique(ours)]
        assert (held[:, 0] == bone).all()


def test_imported_eyeball_looks_straight_ahead(glb: Path) -> None:
    person = import_gltf(glb)
    mesh = person.levels[0]
    for side in ("left", "right"):
        faces = mesh.triangles[mesh.triangle_part == PART_INDEX[f"{side}_eye"]]
        corners, count = np.unique(faces, return_counts=True)
        poles = mesh.vertices_m[corners[count == count.max()]]
        centre = person.skeleton.rest_m[person.skeleton.index(f"{side}_eye")]
        front = poles[poles[:, 2].argmin()] - centre
        assert angle_deg(front / np.linalg.norm(front), np.array([0, 0, -1.0])) < 0.1


def test_shapes_get_our_names(glb: Path) -> None:
    person = import_gltf(glb)
    assert set(person.levels[0].morphs) <= set(MORPHS)
    assert "left_blink" in person.levels[0].morphs


@pytest.mark.parametrize(
    ("names", "shapes"),
    [
        (["mouthSmileLeft", "mouthSmileRight", "jawOpen"], {"smile": 1.6, "jaw_open": 1.0}),
        # Old figures have one name for both corners; new ones may carry it beside two.
        (["mouthSmile"], {"smile": 0.8}),
        (["mouthSmile", "mouthSmileLeft", "mouthSmileRight"], {"smile": 1.6}),
        (["Fcl_MTH_Fun", "Fcl_MTH_A", "Fcl_ALL_Joy"], {"smile": 0.8, "jaw_open": 1.0}),
        # VRoid's files carry ARKit's names, some of which move nothing.
        (["jawOpen (empty)", "Fcl_MTH_A"], {"jaw_open": 1.0}),
        (["jawOpen (empty)", "mouthSmileLeft (empty)"], {}),
        (["Fcl_EYE_Close", "Fcl_EYE_Close_L"], {"left_blink": 1.0, "lids_down": 0.45}),
        (["Fcl_EYE_Close_L", "eyeBlinkLeft"], {"left_blink": 1.0, "lids_down": 0.45}),
        (["LeyeClose"], {"left_blink": 1.0, "lids_down": 0.45}),
        (["left_eye_close"], {"left_blink": 1.0}),
        (["browDownLeft", "mouthFrownLeft", "browInnerUp"], {"frown": 1.6}),
        (["mouthFrownLeft", "mouthFrownRight (empty)"], {"frown": 0.8}),
        # A frown of brows alone would leave out the mouth.
        (["browDownLeft", "mouthFrownLeft (empty)", "mouthSmileLeft"], {"smile": 0.8}),
    ],
)
def test_shapes_are_known_by_the_names_of_several_makers(
    tmp_path: Path, glb: Path, names: list[str], shapes: dict[str, float]
) -> None:
    path = tmp_path / "shaped_F.glb"

    def with_these_names(tree: dict[str, Any]) -> object:
        (primitive,) = tree["meshes"][0]["primitives"]
        (target,) = primitive["targets"]
        accessors = tree["accessors"]
        nothing = {k: v for k, v in accessors[target["POSITION"]].items() if k != "bufferView"}
        accessors.append(nothing)
        empty = {"POSITION": len(accessors) - 1}
        primitive["targets"] = [empty if "empty" in name else target for name in names]
        tree["meshes"][0]["extras"]["targetNames"] = [n.removesuffix(" (empty)") for n in names]
        return tree

    _retold(glb, path, with_these_names)
    whole = import_gltf(glb).levels[0].morphs["left_blink"].delta_m
    morphs = import_gltf(path).levels[0].morphs
    assert shapes.keys() == morphs.keys()
    for name, amount in shapes.items():
        np.testing.assert_allclose(morphs[name].delta_m, amount * whole, atol=1e-7)


def test_shapes_that_a_file_wears_at_rest_are_worn(tmp_path: Path, glb: Path) -> None:
    path = tmp_path / "smiling_F.glb"

    def worn(tree: dict[str, Any]) -> object:
        tree["meshes"][0]["weights"] = [0.5]
        return tree

    _retold(glb, path, worn)
    plain, moved = (read_figure(read_glb(p)).surfaces[0] for p in (glb, path))
    np.testing.assert_allclose(
        moved.vertices_m - plain.vertices_m, 0.5 * plain.shapes["eyeBlinkLeft"], atol=1e-7
    )


def test_imported_body_has_a_closed_surface_and_capsules(glb: Path) -> None:
    person = import_gltf(glb)
    assert is_closed(collision_mesh(person))
    assert len(person.capsules) >= 4


def test_skin_eyes_and_suit_of_one_material_called_body_are_told_apart(tmp_path: Path) -> None:
    """Suits shone like skin and irises turned red where a file calls everything a body."""
    path = tmp_path / "suited_F.glb"
    write_glb(path, head_squares=16, worn_as="_Body")
    person = import_gltf(path)
    mesh = person.levels[0]

    def worn(part: str) -> set[str]:
        own = np.unique(mesh.triangle_material[mesh.triangle_part == PART_INDEX[part]])
        return {person.materials[m].kind for m in own}

    assert {"skin"} == worn("face") == worn("left_hand")
    assert {"eye"} == worn("left_eye") == worn("right_eye")
    assert {"cloth"} == worn("left_thigh") == worn("right_upper_arm")
    kinds = {material.kind: material for material in person.materials}
    assert kinds["cloth"].texture_srgb is kinds["skin"].texture_srgb
    # The file says 0.5 of both.
    assert kinds["skin"].roughness_01 == SKIN_ROUGHNESS_01 < CLOTH_ROUGHNESS_01
    assert kinds["cloth"].roughness_01 == CLOTH_ROUGHNESS_01


@pytest.mark.parametrize(
    ("temples", "hairy"), [("bare", False), ("dark", True), ("reddish", False)]
)
def test_what_is_dark_before_the_ears_is_hair(
    tmp_path: Path, temples: Literal["bare", "dark", "reddish"], hairy: bool
) -> None:
    """Painted sideburns shone grey, as skin; ears that are redder than the face are no hair."""
    path = tmp_path / "dressed_F.glb"
    write_glb(path, head_squares=16, worn_as="_Body", temples=temples)
    person = import_gltf(path)
    mesh = person.levels[0]
    middle = mesh.vertices_m[mesh.triangles].mean(axis=1)
    eye = person.skeleton.rest_m[person.skeleton.index("left_eye")]
    at_temple = (np.abs(middle[:, 0]) > HEAD_HALF_M - 1e-3) & (
        np.abs(middle - eye)[:, 1:] < 0.012
    ).all(axis=1)

    assert at_temple.sum() >= 2
    kinds = {person.materials[m].kind for m in mesh.triangle_material[at_temple]}
    assert kinds == ({"hair"} if hairy else {"skin"})


@pytest.mark.parametrize(
    ("apart", "kind"),
    [
        (Apart(SKIN_SRGB, rims=False), "skin"),
        (Apart(SUIT_SRGB, rims=False), "other"),
        (Apart(SUIT_SRGB, rims=True), "other"),
    ],
)
def test_a_surface_apart_is_skin_where_it_looks_like_the_face(
    tmp_path: Path, apart: Apart, kind: str
) -> None:
    """Arms of Ready Player Me were no skin, for they have no face; rims of glasses were one."""
    path = tmp_path / "apart_F.glb"
    write_glb(path, head_squares=16, worn_as="_Body", apart=apart)
    person = import_gltf(path)
    assert {m.kind for m in person.materials if m.name.startswith("Apart")} == {kind}
    assert {"skin", "cloth"} <= {m.kind for m in person.materials if m.name.startswith("_Body")}


def test_only_copies_for_measuring_are_bent_to_a_measure(
    glb: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is shown was bent, too, by up to 14 mm: mouths were crooked and noses caved in."""
    expected = import_gltf(glb)

    def bent(thin: SkinnedMesh, full: SkinnedMesh) -> SkinnedMesh:
        return replace(thin, vertices_m=thin.vertices_m + np.float32(0.014))

    monkeypatch.setattr("visavis.stimuli.characters.gltf.importing.match_areas", bent)
    person = import_gltf(glb)
    for level, as_before in zip(person.levels, expected.levels, strict=True):
        np.testing.assert_array_equal(level.vertices_m, as_before.vertices_m)
    for copy, as_before in zip(person.measuring, expected.measuring, strict=True):
        assert not np.allclose(copy.vertices_m, as_before.vertices_m, atol=0.005)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"with_skin": False}, "no skin"),
        ({"leave_out": ("left_lower_arm", "left_hand")}, "left_lower_arm"),
        ({"leave_out": ("right_eye",)}, "right_eye"),
        ({"eye_radius_m": 0.05}, "not an eyeball"),
        ({"eyes_on_head": True, "eye_radius_m": 0.035}, "no bone for left_eye.*--joint-map FILE"),
        ({"eye_ahead_m": 0.05}, "its sphere lies 50 mm off"),
    ],
)
def test_unusable_figure_names_file_bone_and_next_step(
    tmp_path: Path, change: dict[str, object], told: str
) -> None:
    path = tmp_path / "bad_M.glb"
    write_glb(path, **change)  # type: ignore[arg-type]
    with pytest.raises(CharacterError, match=told) as caught:
        import_gltf(path)
    assert "bad_M.glb" in str(caught.value)
    assert ";" in str(caught.value)


def test_broken_files_are_named(tmp_path: Path, glb: Path) -> None:
    whole = glb.read_bytes()
    cases = {
        "text_M.glb": b"solid cube",
        "cut_M.glb": whole[: len(whole) // 2],
        "torn_M.glb": whole[:12] + b"\xff" * (len(whole) - 12),
    }
    for name, data in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(CharacterError, match=name):
            import_gltf(tmp_path / name)
    with pytest.raises(CharacterError, match="absent"):
        import_gltf(tmp_path / "absent_M.glb")


def _few_joints(tree: dict[str, Any]) -> object:
    tree["skins"][0]["joints"] = tree["skins"][0]["joints"][:5]
    return tree


def _no_view(tree: dict[str, Any]) -> object:
    tree["accessors"][0]["bufferView"] = 9999
    return tree


def _less_than_nothing(tree: dict[str, Any]) -> object:
    tree["accessors"][0]["count"] = -7
    return tree


def _nodes_in_a_circle(tree: dict[str, Any]) -> object:
    joint = tree["skins"][0]["joints"][0]
    for i, node in enumerate(tree["nodes"]):
        node["children"] = [joint] if i == joint else []
    return tree


def _only_a_list(tree: dict[str, Any]) -> object:
    return [tree]


@pytest.mark.parametrize(
    "spoiled", [_few_joints, _no_view, _less_than_nothing, _nodes_in_a_circle, _only_a_list]
)
def test_file_that_contradicts_itself_is_named(
    tmp_path: Path, glb: Path, spoiled: Callable[[dict[str, Any]], object]
) -> None:
    path = tmp_path / "odd_M.glb"
    _retold(glb, path, spoiled)
    with pytest.raises(CharacterError, match=r"odd_M\.glb: .*export"):
        import_gltf(path)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
@pytest.mark.parametrize("array", ["POSITION", "WEIGHTS_0", "inverseBindMatrices"])
def test_numbers_that_are_not_finite_are_refused_wherever_they_stand(
    tmp_path: Path, glb: Path, array: str, value: float
) -> None:
    def spoil(tree: dict[str, Any]) -> object:
        index = tree["skins"][0].get(
            array, tree["meshes"][0]["primitives"][0]["attributes"].get(array)
        )
        accessor = tree["accessors"][index]
        view = tree["bufferViews"][accessor["bufferView"]]
        offset.append(view.get("byteOffset", 0) + accessor.get("byteOffset", 0))
        return tree

    offset: list[int] = []
    path = tmp_path / "odd_M.glb"
    _retold(glb, path, spoil)
    data = bytearray(path.read_bytes())
    binary = 20 + struct.unpack("<I", data[12:16])[0] + 8
    struct.pack_into("<f", data, binary + offset[0], value)
    path.write_bytes(data)
    with pytest.raises(CharacterError, match=r"odd_M\.glb: .*not finite"):
        import_gltf(path)


def _retold(glb: Path, path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Write a file again with its description changed."""
    data = glb.read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    text = json.dumps(change(json.loads(data[20 : 20 + length]))).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    path.write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text + rest)


def _numbered(tree: dict[str, Any]) -> dict[str, str]:
    """Give bones names that say nothing; return them by Mixamo's."""
    names = {node["name"]: f"bone_{i}" for i, node in enumerate(tree["nodes"][:-1])}
    for node in tree["nodes"][:-1]:
        node["name"] = names[node["name"]]
    return names


def test_bones_may_be_said_where_their_names_tell_nothing(tmp_path: Path, glb: Path) -> None:
    path, theirs = tmp_path / "numbered_F.glb", dict[str, str]()

    def numbered(tree: dict[str, Any]) -> object:
        theirs.update(_numbered(tree))
        return tree

    _retold(glb, path, numbered)
    with pytest.raises(CharacterError, match="--joint-map"):
        import_gltf(path)
    said = {ours: theirs[mixamo] for ours, mixamo in bone_names().items()}
    person = import_gltf(path, joint_map=said)
    np.testing.assert_array_equal(person.skeleton.rest_m, import_gltf(glb).skeleton.rest_m)


def test_what_hangs_on_a_bone_without_a_skin_is_worn(tmp_path: Path) -> None:
    worn, hung = tmp_path / "worn_F.glb", tmp_path / "hung_F.glb"
    write_glb(worn, plate=Plate({"name": "badge"}))

    def unskinned(tree: dict[str, Any]) -> object:
        """Hang the plate on the chest's bone, half as large as twice its size."""
        names = [node["name"] for node in tree["nodes"]]
        plate = tree["meshes"][0]["primitives"].pop()
        for name in ("JOINTS_0", "WEIGHTS_0"):
            del plate["attributes"][name]
        tree["meshes"].append({"primitives": [plate]})
        chest = names.index("Spine2")
        at = np.zeros(3)
        above: int | None = chest
        while above is not None:
            at = at + tree["nodes"][above]["translation"]
            parents = [i for i, n in enumerate(tree["nodes"]) if above in n.get("children", [])]
            above = parents[0] if parents else None
        tree["nodes"][chest]["children"].append(len(names))
        tree["nodes"].append({"name": "hook", "scale": [0.5] * 3, "children": [len(names) + 1]})
        tree["nodes"].append(
            {"name": "badge", "mesh": 1, "scale": [2.0] * 3, "translation": (-2 * at).tolist()}
        )
        return tree

    _retold(worn, hung, unskinned)
    expected, person = (import_gltf(path).levels[0] for path in (worn, hung))
    assert expected.vertices_m.shape == person.vertices_m.shape
    np.testing.assert_allclose(person.vertices_m, expected.vertices_m, atol=1e-5)
    np.testing.assert_allclose(person.normals, expected.normals, atol=1e-5)
    np.testing.assert_array_equal(person.weights, expected.weights)


def test_more_than_four_bones_of_a_vertex_are_heard(tmp_path: Path, glb: Path) -> None:
    path = tmp_path / "eight_F.glb"

    def second_set(tree: dict[str, Any]) -> object:
        """Let the first four bones of every vertex weigh nothing, the next four all."""
        attributes = tree["meshes"][0]["primitives"][0]["attributes"]
        for name in ("JOINTS", "WEIGHTS"):
            attributes[f"{name}_1"] = attributes[f"{name}_0"]
            nothing = dict(tree["accessors"][attributes[f"{name}_0"]])
            del nothing["bufferView"]
            attributes[f"{name}_0"] = len(tree["accessors"])
            tree["accessors"].append(nothing)
        return tree

    _retold(glb, path, second_set)
    expected, person = import_gltf(glb).levels[0], import_gltf(path).levels[0]
    np.testing.assert_array_equal(person.vertices_m, expected.vertices_m)
    np.testing.assert_array_equal(person.weights, expected.weights)


@pytest.mark.parametrize("version", ["VRM", "VRMC_vrm"])
def test_vrm_itself_says_which_bone_is_which(tmp_path: Path, glb: Path, version: str) -> None:
    path = tmp_path / "vrm_F.vrm"

    def as_vrm(tree: dict[str, Any]) -> object:
        theirs = _numbered(tree)
        nodes = [node["name"] for node in tree["nodes"]]
        bones = {}
        for ours, mixamo in bone_names().items():
            first, *rest = ours.split("_")
            bones[first + "".join(map(str.title, rest))] = nodes.index(theirs[mixamo])
        listed: object = [{"bone": bone, "node": node} for bone, node in bones.items()]
        if version == "VRMC_vrm":
            listed = {bone: {"node": node} for bone, node in bones.items()}
        return tree | {"extensions": {version: {"humanoid": {"humanBones": listed}}}}

    _retold(glb, path, as_vrm)
    person = import_gltf(path)
    np.testing.assert_array_equal(person.skeleton.rest_m, import_gltf(glb).skeleton.rest_m)


def test_gender_that_the_name_does_not_say_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "somebody.glb"
    write_glb(path)
    with pytest.raises(CharacterError, match="--gender"):
        import_gltf(path)
    assert import_gltf(path, gender="male").gender == "male"


def test_folder_is_imported_line_by_line_and_a_bad_file_stops_nothing(tmp_path: Path) -> None:
    source, library = tmp_path / "avatars", tmp_path / "library"
    source.mkdir()
    write_glb(source / "first_F.glb")
    (source / "second_M.glb").write_bytes(b"nothing")
    write_glb(source / "third_M.glb")
    results = list(import_characters(source, library))
    assert [r.character.name if r.character else r.problem[-4:] for r in results][::2] == [
        "first_F",
        "third_M",
    ]
    assert "second_M.glb" in results[1].problem
    assert library_names(library) == ("first_F", "third_M")
    assert load_character("third_M", library).gender == "male"
    with pytest.raises(CharacterError, match=r"no \.glb, \.vrm"):
        list(import_characters(library, source))


@needs_avatars
def test_valid_avatars_import_whole() -> None:
    for path in avatar_files()[:2]:
        person = import_gltf(path)
        assert set(person.levels[0].morphs) == set(MORPHS)
        assert is_closed(collision_mesh(person))
        assert set(np.unique(person.levels[0].triangle_part)) == set(range(1, 20))
        assert 1.5 < person.stature_m < 2.1
        assert len(person.capsules) >= 19
        body = {m.kind: m for m in person.materials if m.name.startswith("_Body")}
        assert {"skin", "cloth"} <= set(body)
        assert body["cloth"].roughness_01 > 0.8 > body["skin"].roughness_01
        assert body["skin"].texture_srgb is body["cloth"].texture_srgb
        assert body["skin"].texture_srgb is not None
        assert body["skin"].texture_srgb.shape[0] == 2048
        assert body["skin"].maps is not None
        mesh = person.levels[0]
        thigh = mesh.triangle_part == PART_INDEX["left_thigh"]
        worn = [person.materials[m].kind for m in np.unique(mesh.triangle_material[thigh])]
        assert "cloth" in worn


def test_a_description_nested_without_end_is_named(tmp_path: Path) -> None:
    deep = b'{"asset": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    size = len(deep)
    path = tmp_path / "deep_F.glb"
    head = b"glTF" + struct.pack("<II", 2, 20 + size) + struct.pack("<I4s", size, b"JSON")
    path.write_bytes(head + deep)
    with pytest.raises(CharacterError, match="nested deeper"):
        read_glb(path)


def test_colour_of_an_iris_lies_between_its_picture_with_and_without_painted_glints() -> None:
    # Across the picture the slant from the axis, 0 to 180°; downwards once round the eye.
    pixels = np.full((256, 512, 3), 220, np.uint8)
    pixels[:, : 512 * 22 // 180] = (50, 4, 6)
    pixels[:64, : 512 * 22 // 180] = 200
    pixels[:, : 512 * 8 // 180] = 0
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, format="PNG")
    data = packed.getvalue()
    tree = {
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 0}],
        "bufferViews": [{"byteLength": len(data)}],
    }
    slant, turn = np.meshgrid(np.linspace(0, np.pi, 60), np.linspace(0, 2 * np.pi, 60))
    rim = np.sin(slant)
    ball = np.stack([rim * np.cos(turn), rim * np.sin(turn), -np.cos(slant)], axis=-1)
    uv = np.stack([slant / np.pi, turn / (2 * np.pi)], axis=-1).reshape(-1, 2)
    at = np.arange(3600).reshape(60, 60)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    points = 0.012 * ball.reshape(-1, 3)
    surface = Surface(
        "eye",
        points,
        unit(points),
        uv,
        triangles,
        np.zeros((3600, 1), np.int64),
        np.ones((3600, 1)),
        0,
        {},
    )
    paint, glint = linear_of(np.array([50, 4, 6]) / 255), linear_of(np.full(3, 200) / 255)
    light = 0.5 * paint + 0.5 * (0.75 * paint + 0.25 * glint)
    file = GltfFile(Path("eye.glb"), tree, data)
    found = iris_colour(file, surface, np.arange(3600), np.zeros(3), np.array([0.0, 0.0, -1.0]))
    assert 255 * srgb_of(light) == pytest.approx(found, abs=4)
