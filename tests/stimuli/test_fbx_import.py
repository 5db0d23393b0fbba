"""FBX figures by way of Blender: the same person as from glTF, or a word of what is missing."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.stimuli.glb_figure import write_glb
from visavis.lab.errors import LabError
from visavis.stimuli.characters import fbx
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.fbx import find_blender
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.library import Imported, import_characters

needs_blender = pytest.mark.skipif(
    find_blender() is None, reason="needs Blender: apt-get install blender python3-numpy"
)
# The glTF reader of Debian's Blender 3.4 uses a name that its numpy no longer has.
TO_FBX = """
import sys
import bpy
import numpy
if not hasattr(numpy, "bool"):
    numpy.bool = bool
source, made = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=source)
bpy.ops.export_scene.fbx(filepath=made, add_leaf_bones=False, bake_anim=False)
"""


def _imported(path: Path) -> Imported:
    (result,) = import_characters(path, path.parent / "library")
    return result


@needs_blender
@pytest.mark.timeout(300)  # starts Blender twice
def test_figure_from_fbx_is_the_one_that_was_written(tmp_path: Path) -> None:
    path, fbx_path = tmp_path / "probe_F_1.glb", tmp_path / "probe_F_1.fbx"
    write_glb(path)
    blender = find_blender()
    assert blender is not None
    command = [blender, "--background", "--factory-startup", "--python-expr", TO_FBX]
    subprocess.run([*command, "--", str(path), str(fbx_path)], check=True, capture_output=True)

    result = _imported(fbx_path)

    assert result.problem == ""
    expected, person = import_gltf(path), load_character("probe_F_1", tmp_path / "library")
    assert "probe_F_1.fbx" in person.source
    assert (expected.gender, expected.skeleton.names) == (person.gender, person.skeleton.names)
    assert expected.stature_m == pytest.approx(person.stature_m, abs=0.002)
    np.testing.assert_allclose(person.skeleton.rest_m, expected.skeleton.rest_m, atol=0.002)
    assert [m.kind for m in expected.materials] == [m.kind for m in person.materials]


@needs_blender
@pytest.mark.timeout(300)  # starts Blender
def test_file_that_blender_cannot_read_is_named_with_what_blender_says(tmp_path: Path) -> None:
    path = tmp_path / "broken_F.fbx"
    path.write_bytes(b"Kaydara FBX Binary  \x00\x1a\x00" + bytes(40))
    problem = _imported(path).problem
    assert "broken_F.fbx: Blender cannot read it" in problem
    assert "export the figure as .glb" in problem


def test_what_is_wrong_with_a_figure_is_told_of_the_file_that_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Messages named a file of another folder that was gone when one read them."""
    program = tmp_path / "blender"
    program.write_text(
        '#!/bin/sh\nfor made; do :; done\ncp "$(dirname "$0")/eyeless.glb" "$made"\n'
    )
    program.chmod(0o755)
    write_glb(tmp_path / "eyeless.glb", leave_out=("left_eye", "right_eye"))
    monkeypatch.setattr(fbx, "find_blender", lambda: str(program))
    path = tmp_path / "someone_F.fbx"
    path.write_bytes(b"")
    problem = _imported(path).problem
    assert problem.startswith(f"{path}: no bone for left_eye and right_eye")


def test_without_blender_it_is_said_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(fbx, "_PLACES", {})
    path = tmp_path / "someone_F.fbx"
    path.write_bytes(b"")
    problem = _imported(path).problem
    assert "FBX files are read by Blender, which is not here; install Blender" in problem


@pytest.mark.parametrize(
    ("does", "told"),
    [
        ("echo 'RuntimeError: Version 6100 unsupported' >&2; exit 1", "Version 6100 unsupported"),
        ("exit 0", "it says nothing"),
        (
            "echo \"ModuleNotFoundError: No module named 'numpy'\" >&2; exit 1",
            "Blender lacks numpy, without which it writes no glTF; install Blender",
        ),
        ("exec sleep 60", "did not finish it in 0.2 s"),
    ],
)
def test_blender_that_fails_writes_nothing_or_hangs_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, told: str
) -> None:
    program = tmp_path / "blender"
    program.write_text(f"#!/bin/sh\n{does}\n")
    program.chmod(0o755)
    monkeypatch.setattr(fbx, "find_blender", lambda: str(program))
    monkeypatch.setattr(fbx, "TIMEOUT_S", 0.2 if "sleep" in does else 60.0)
    path = tmp_path / "someone_F.fbx"
    path.write_bytes(b"")
    assert told in _imported(path).problem


def test_folder_is_searched_for_fbx_whatever_the_case_of_its_ending(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fbx, "find_blender", lambda: None)
    for name in ("a_F.FBX", "b_M.fbx", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    results = list(import_characters(tmp_path, tmp_path / "library"))
    assert ["a_F.FBX", "b_M.fbx"] == [result.source.name for result in results]
    assert all("Blender" in result.problem for result in results)
    (tmp_path / "none").mkdir()
    with pytest.raises(LabError, match=r"no \.glb, \.vrm or \.fbx"):
        list(import_characters(tmp_path / "none", tmp_path / "library"))


# A figure as 3ds Max writes it: pictures by their places on its maker's disk, a reflection that
# Blender takes for metal, and hair that one picture both colours and hides.
DRESSED = """
import os
import sys
import bpy
import numpy
if not hasattr(numpy, "bool"):
    numpy.bool = bool
from bpy_extras.node_shader_utils import PrincipledBSDFWrapper
from io_scene_fbx import export_fbx_bin
named = dict(export_fbx_bin.PRINCIPLED_TEXTURE_SOCKETS_TO_FBX)
named["alpha_texture"] = b"TransparentColor"
export_fbx_bin.PRINCIPLED_TEXTURE_SOCKETS_TO_FBX = tuple(named.items())
source, made, textures = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=source)
mesh = next(o for o in bpy.data.objects if o.type == "MESH")
mesh.data.uv_layers.new()
mesh.data.materials.clear()

def picture(name):
    image = bpy.data.images.new(name, 4, 4, alpha=True)
    image.pixels = [0.2, 0.1, 0.1, 0.6] * 16
    image.filepath_raw = f"{textures}/{name}.png"
    image.file_format = "PNG"
    image.save()
    return image

for name in ("body", "lashes", "lost"):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    look = PrincipledBSDFWrapper(material, is_readonly=False)
    look.metallic = 1.0
    look.base_color_texture.image = picture(name)
    if name == "lashes":
        look.alpha_texture.image = picture("lashes_too")
    mesh.data.materials.append(material)
faces = mesh.data.polygons
faces.foreach_set("material_index", [i % 3 for i in range(len(faces))])
bpy.ops.export_scene.fbx(filepath=made, add_leaf_bones=False, bake_anim=False)
os.remove(f"{textures}/lost.png")
"""


@needs_blender
@pytest.mark.timeout(300)  # starts Blender twice
def test_pictures_beside_a_figure_are_found_and_those_lost_are_named(tmp_path: Path) -> None:
    for name in ("Export", "elsewhere"):
        (tmp_path / name).mkdir()
    path, fbx_path = tmp_path / "probe_F_1.glb", tmp_path / "Export" / "probe_F_1.fbx"
    write_glb(path)
    blender = find_blender()
    assert blender is not None
    command = [blender, "--background", "--factory-startup", "--python-expr", DRESSED, "--"]
    paths = (str(path), str(fbx_path), str(tmp_path / "elsewhere"))
    subprocess.run([*command, *paths], check=True, capture_output=True)
    (tmp_path / "elsewhere").rename(tmp_path / "Textures")

    result = _imported(fbx_path)

    assert result.problem == ""
    (told,) = result.odd
    assert "lacks the pictures lost.png, so" in told
    person = load_character("probe_F_1", fbx_path.parent / "library")
    worn = {m.name.partition(":")[0]: m for m in person.materials if m.texture_srgb is not None}
    assert {"body", "lashes"} == set(worn)
    lashes = worn["lashes"].texture_srgb
    assert lashes is not None
    assert pytest.approx([0.6 * 255], abs=2) == lashes[0, 0, 3:].tolist()
    # No metal, so no map of it.
    assert all(m.maps is None for m in worn.values())
