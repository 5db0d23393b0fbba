"""visavis character fetch and import: where others' people lie, how they come in."""

import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.stimuli.glb_figure import bone_names, write_glb
from visavis.cli.main import app
from visavis.lab.errors import LabError, UsageError
from visavis.lab.yaml_lines import ProblemsError
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.library import library_names


def character(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["character", *map(str, arguments)])
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_valid_is_told_with_address_licence_and_source() -> None:
    told = character("fetch", "valid")
    address, doi = "github.com/c-frame/valid-avatars-glb", "10.3389/frvir.2023.1248915"
    for word in (address, "MIT", doi, "pip install visavis[avatars]"):
        assert word in told


def test_download_is_imported_from_its_zip_and_from_its_folder(tmp_path: Path) -> None:
    inside = tmp_path / "valid-avatars-glb-main" / "avatars" / "Asian"
    inside.mkdir(parents=True)
    for name in ("Asian_F_1_Casual", "Asian_M_1_Busi"):
        write_glb(inside / f"{name}.glb")
    packed = tmp_path / "valid.zip"
    with zipfile.ZipFile(packed, "w") as file:
        for path in inside.glob("*.glb"):
            file.write(path, f"valid-avatars-glb-main/avatars/Asian/{path.name}")
    character("fetch", "valid", packed, "--only", "*_Casual", "--library", tmp_path / "one")
    assert library_names(tmp_path / "one") == ("Asian_F_1_Casual",)
    character("fetch", "valid", inside.parents[1], "--library", tmp_path / "two")
    assert library_names(tmp_path / "two") == ("Asian_F_1_Casual", "Asian_M_1_Busi")


def test_what_is_no_download_is_said(tmp_path: Path) -> None:
    (tmp_path / "text.zip").write_text("no archive")
    with pytest.raises(CharacterError, match=r"text\.zip: neither a folder nor a whole \.zip"):
        character("fetch", "valid", tmp_path / "text.zip", "--library", tmp_path)
    with pytest.raises(CharacterError, match=r"no \.glb file called"):
        character("fetch", "valid", tmp_path, "--library", tmp_path)
    with pytest.raises(UsageError, match="known: valid"):
        character("fetch", "everybody")


def test_joint_map_is_read_from_a_file(tmp_path: Path) -> None:
    write_glb(tmp_path / "someone_F.glb")
    said = tmp_path / "joints.yaml"
    said.write_text(f"left_hand: {bone_names()['left_hand']}\n")
    character(
        "import", tmp_path / "someone_F.glb", "--joint-map", said, "--library", tmp_path / "lib"
    )
    assert library_names(tmp_path / "lib") == ("someone_F",)
    said.write_text("- left_hand\n")
    with pytest.raises(UsageError, match="one line a joint"):
        character("import", tmp_path / "someone_F.glb", "--joint-map", said, "--library", tmp_path)
    said.write_text("left_hand: one\nleft_hand: another\n")
    with pytest.raises(ProblemsError, match="given twice"):
        character("import", tmp_path / "someone_F.glb", "--joint-map", said, "--library", tmp_path)


def test_names_with_brackets_are_told_as_they_are(tmp_path: Path) -> None:
    write_glb(tmp_path / "some[bold]one_F.glb")
    told = character("import", tmp_path / "some[bold]one_F.glb", "--library", tmp_path / "lib")
    assert "some[bold]one_F: female" in told


def test_import_says_what_is_odd_and_how_to_look_at_whom_it_imported(tmp_path: Path) -> None:
    write_glb(tmp_path / "boxes_F.glb")
    told = " ".join(
        character("import", tmp_path / "boxes_F.glb", "--library", tmp_path / "lib").split()
    )
    assert "its right lids do not close: give the file a shape such as eyeBlinkRight" in told
    assert "visavis character sheet imported.png --at 1,2,3.5,5,8" in told


def test_files_that_cannot_be_imported_are_counted_and_the_others_are_there(
    tmp_path: Path,
) -> None:
    source, library = tmp_path / "people", tmp_path / "lib"
    source.mkdir()
    for name in ("one_F", "two_M"):
        write_glb(source / f"{name}.glb")
    (source / "three_F.glb").write_bytes(b"no glTF")
    with pytest.raises(CharacterError, match="1 of 3 files could not be imported"):
        character("import", source, "--library", library)
    assert ("one_F", "two_M") == library_names(library)
