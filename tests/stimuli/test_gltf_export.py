"""Exported characters: valid glTF, and the same when they are imported again."""

import json
import shutil
import struct
import subprocess
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from visavis.lab.geometry import rotate
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.character import Character, Maps
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.gltf.exporting import glb_of_character, write_glb
from visavis.stimuli.characters.gltf.file import GltfFile, read_glb
from visavis.stimuli.motion.baking import KINDS_BY_NAME, bake
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward

MAX_BYTES = 4_000_000
VALIDATE = """
const validator = require("gltf-validator");
const fs = require("fs");
(async () => {
  for (const path of process.argv.slice(1)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)));
    console.log(JSON.stringify(report.issues.messages));
  }
})();
"""


def _walk(character: Character, seconds: float) -> Clip:
    return bake(Person(build_of_character(character), KINDS_BY_NAME["walk"], seed=5), seconds)


def _written(path: Path, data: bytes) -> GltfFile:
    write_glb(path, data)
    return read_glb(path)


def test_round_trip_gives_the_same_skeleton_and_mesh(tmp_path: Path) -> None:
    person = load_character("chloe")
    write_glb(tmp_path / "somebody.glb", glb_of_character(person))
    back = import_gltf(tmp_path / "somebody.glb")
    assert (back.name, back.gender, back.licence) == ("chloe", "female", person.licence)
    assert back.skeleton.names == person.skeleton.names
    np.testing.assert_array_equal(back.skeleton.parents, person.skeleton.parents)
    np.testing.assert_array_equal(back.skeleton.offsets_m, person.skeleton.offsets_m)
    np.testing.assert_array_equal(back.skeleton.tips_m, person.skeleton.tips_m)
    assert [(m.name, m.kind, m.roughness_01, m.double_sided) for m in back.materials] == [
        (m.name, m.kind, m.roughness_01, m.double_sided)
        for m in person.materials
        if m.name in {x.name for x in back.materials}
    ]
    mesh, again = person.levels[0], back.levels[0]
    # Meshes go out one material after another, triangles by part; vertices keep their order.
    order = np.lexsort((mesh.triangle_part, mesh.triangle_material))
    corners, corners_again = mesh.triangles[order], again.triangles
    np.testing.assert_array_equal(again.triangle_part, mesh.triangle_part[order])
    np.testing.assert_array_equal(again.vertices_m[corners_again], mesh.vertices_m[corners])
    np.testing.assert_allclose(again.normals[corners_again], mesh.normals[corners], atol=1e-6)
    np.testing.assert_array_equal(again.weights[corners_again], mesh.weights[corners])
    names = [m.name for m in person.materials]
    is_eye = np.array(names)[mesh.triangle_material[order]] == "eye"
    np.testing.assert_array_equal(
        again.colour_srgb[corners_again[~is_eye]], mesh.colour_srgb[corners[~is_eye]]
    )
    assert again.morphs.keys() == mesh.morphs.keys()
    for name in mesh.morphs:
        moved, moved_again = np.zeros_like(mesh.vertices_m), np.zeros_like(again.vertices_m)
        moved[mesh.morphs[name].vertices] = mesh.morphs[name].delta_m
        moved_again[again.morphs[name].vertices] = again.morphs[name].delta_m
        np.testing.assert_array_equal(moved_again[corners_again], moved[corners])
    assert [c.part for c in back.capsules] == [c.part for c in person.capsules]
    assert asdict(back.eyeball) == asdict(person.eyeball)


def test_a_file_that_another_program_wrote_again_keeps_kinds_and_shapes(tmp_path: Path) -> None:
    person = load_character("anna")
    path = tmp_path / "anna_F.glb"
    data = glb_of_character(person)
    write_glb(path, data.replace(b'"generator":"Visavis"', b'"generator":"Blender"'))
    back = import_gltf(path)
    assert {m.kind for m in back.materials} == {
        person.materials[k].kind for k in np.unique(person.levels[0].triangle_material)
    }
    assert set(back.levels[0].morphs) == set(person.levels[0].morphs)


def test_the_figure_stands_on_the_floor_and_faces_forward_in_gltf(tmp_path: Path) -> None:
    person = load_character("anna")
    file = _written(tmp_path / "anna.glb", glb_of_character(person))
    nodes = file.items("nodes")
    x, y, z, w = nodes[0]["rotation"]
    toes = person.skeleton.rest_m[person.skeleton.index("left_toes")]
    foot = person.skeleton.rest_m[person.skeleton.index("left_foot")]
    assert rotate(np.array([w, x, y, z]), toes - foot)[2] > 0.05
    hips_m = nodes[1]["translation"][1]
    sole_m = person.levels[0].vertices_m[:, 1].min() + hips_m
    assert abs(sole_m) < 0.02


def test_turns_go_out_as_x_y_z_w_and_place_joints_as_the_clip_does(tmp_path: Path) -> None:
    person = load_character("anna")
    clip = _walk(person, 1.0)
    file = _written(tmp_path / "anna.glb", glb_of_character(person, clip))
    animation = file.items("animations")[0]
    turns = np.zeros((len(clip.root_m), 55, 4))
    roots_m = np.zeros((len(clip.root_m), 3))
    for channel in animation["channels"]:
        values = file.accessor(animation["samplers"][channel["sampler"]]["output"])
        if channel["target"]["path"] == "translation":
            roots_m[:] = values
        else:
            turns[:, channel["target"]["node"] - 1] = values[:, [3, 0, 1, 2]]
    expected = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz)
    placed = forward(person.skeleton, roots_m, turns.astype(np.float64))
    np.testing.assert_allclose(placed.position_m, expected.position_m, atol=2e-6)


def test_a_loop_ends_where_it_began_and_says_how_far_it_travelled(tmp_path: Path) -> None:
    person = load_character("anna")
    walk = replace(_walk(person, 1.0), is_loop=True, travel_m=(0.0, 0.0, -1.2))
    file = _written(tmp_path / "anna.glb", glb_of_character(person, walk))
    animation = file.items("animations")[0]
    assert animation["extras"] == {"is_loop": True, "travel_m": [0.0, 0.0, -1.2]}
    roots = file.accessor(animation["samplers"][-1]["output"])
    np.testing.assert_allclose(roots[-1] - roots[0], [0.0, 0.0, -1.2], atol=1e-6)


def test_nobody_is_larger_than_four_megabytes_and_bytes_repeat() -> None:
    person = load_character("chloe")  # the largest: much hair
    data = glb_of_character(person, _walk(person, 4.0))
    assert len(data) <= MAX_BYTES
    assert data == glb_of_character(person, _walk(person, 4.0))


def test_a_motion_of_another_skeleton_and_a_missing_level_are_refused() -> None:
    person = load_character("anna")
    few = canonical_skeleton()
    other = replace(few, names=tuple(f"x_{name}" for name in few.names))
    clip = replace(_walk(person, 0.2), skeleton=other)
    with pytest.raises(CharacterError, match="retarget it"):
        glb_of_character(person, clip)
    with pytest.raises(CharacterError, match="levels 0 to 2, not 7"):
        glb_of_character(person, level=7)


def _issues(paths: list[Path]) -> list[list[dict[str, Any]]]:
    """Return what the Khronos validator says of files; it is an npm package."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node; apt install nodejs npm")
    said = subprocess.run(
        [node, "-e", VALIDATE, *map(str, paths)],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=Path(__file__).parents[2],
    )
    if "Cannot find module 'gltf-validator'" in said.stderr:
        pytest.skip("there is no gltf-validator; npm install --no-save gltf-validator")
    assert said.returncode == 0, said.stderr
    return [json.loads(line) for line in said.stdout.splitlines()]


def test_the_khronos_validator_finds_nothing(tmp_path: Path) -> None:
    paths = []
    for name in cast_names():
        person = load_character(name)
        paths.append(tmp_path / f"{name}.glb")
        write_glb(paths[-1], glb_of_character(person, _walk(person, 0.5), level=len(paths) % 3))
    # Somebody with all maps, such as imported figures have.
    anna = load_character("anna")
    grey = np.full((32, 32, 3), 128, np.uint8)
    maps = Maps(np.full((32, 32, 3), (128, 128, 255), np.uint8), grey, grey, grey)
    skin = replace(anna.materials[0], maps=maps)
    paths.append(tmp_path / "maps.glb")
    write_glb(paths[-1], glb_of_character(replace(anna, materials=(skin, *anna.materials[1:]))))
    *of_cast, of_maps = _issues(paths)
    assert of_cast == [[] for _ in cast_names()]
    # Tangents are left to who draws, as glTF recommends where they come from the normal map.
    assert {issue["code"] for issue in of_maps} == {"MESH_PRIMITIVE_GENERATED_TANGENT_SPACE"}


def test_the_header_counts_all_bytes() -> None:
    data = glb_of_character(load_character("anna"), level=2)
    magic, version, total = struct.unpack("<4sII", data[:12])
    assert (magic, version, total) == (b"glTF", 2, len(data))
