"""visavis character sheet: faces of those named; refusals before anything is drawn."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageFont
from typer.testing import CliRunner

from visavis.cli.commands.character import SHEET_TILE_PX
from visavis.cli.main import app
from visavis.cli.preview.people import TILE_PX, _away_m
from visavis.cli.preview.pictures import FACE_AWAY_M, TITLE_PX, contact_sheet
from visavis.lab.errors import LabError, UsageError
from visavis.stage.errors import StageError
from visavis.stage.renderer import Renderer
from visavis.stimuli.characters.cast import cast_names, load_character
from visavis.stimuli.characters.sizing import scale_to_stature


def sheet(*arguments: object) -> None:
    result = CliRunner().invoke(app, ["character", "sheet", *map(str, arguments)])
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exit_code == 0, result.output


@pytest.fixture
def can_draw() -> None:
    """Skip where nothing can be drawn."""
    try:
        Renderer().close()
    except StageError as problem:
        pytest.skip(str(problem))


@pytest.mark.usefixtures("can_draw")
def test_sheet_holds_two_faces_of_everybody_named(tmp_path: Path) -> None:
    sheet(tmp_path / "two.png", "anna", "henrik", "--library", tmp_path)
    with Image.open(tmp_path / "two.png") as picture_of_all:
        assert picture_of_all.height == TITLE_PX + SHEET_TILE_PX[1]
        left, right = (
            picture_of_all.crop((x, TITLE_PX, x + 480, TITLE_PX + 260)) for x in (0, 960)
        )
        assert len(left.convert("RGB").getcolors(10**6) or ()) > 500
        assert left.tobytes() != right.tobytes()


@pytest.mark.usefixtures("can_draw")
@pytest.mark.parametrize("more", [(), ("--at", "2")])
def test_faces_by_a_lamp_in_the_evening_are_darker_and_warmer(
    more: tuple[str, ...], tmp_path: Path
) -> None:
    means = []
    for light in ("day", "evening"):
        sheet(tmp_path / f"{light}.png", "anna", "--light", light, *more, "--library", tmp_path)
        with Image.open(tmp_path / f"{light}.png") as picture:
            face = np.asarray(picture.convert("RGB"), np.float64)[100:200, 80:160]
        means.append(face.mean(axis=(0, 1)))
    day, evening = means
    assert evening.mean() < 0.7 * day.mean()
    assert day[0] / day[2] < evening[0] / evening[2]


@pytest.mark.usefixtures("can_draw")
def test_sheet_shows_expressions_that_are_made_at_once(tmp_path: Path) -> None:
    sheet(tmp_path / "faces.png", "anna", "--face", "smile,smile+open_mouth", "--library", tmp_path)
    with Image.open(tmp_path / "faces.png") as picture_of_all:
        one, both = (picture_of_all.crop((x, TITLE_PX, x + 480, TITLE_PX + 260)) for x in (0, 480))
        assert one.tobytes() != both.tobytes()


@pytest.mark.usefixtures("can_draw")
def test_sheet_shows_each_expression_asked_for(tmp_path: Path) -> None:
    sheet(tmp_path / "faces.png", "anna", "--face", "neutral, smile,frown", "--library", tmp_path)
    with Image.open(tmp_path / "faces.png") as picture_of_all:
        assert TITLE_PX + SHEET_TILE_PX[1] == picture_of_all.height
        faces = [
            picture_of_all.crop((x, TITLE_PX, x + 480, TITLE_PX + 260)).tobytes()
            for x in (0, 480, 960)
        ]
    assert 3 == len(set(faces))


@pytest.mark.parametrize(
    ("options", "says"),
    [(["--face", "smlie"], "did you mean 'smile'"), (["--face", "smile", "--at", "2"], "or --at")],
)
def test_faces_that_cannot_be_drawn_are_refused(
    tmp_path: Path, options: list[str], says: str
) -> None:
    with pytest.raises(UsageError, match=says):
        sheet(tmp_path / "faces.png", "anna", *options)
    assert not (tmp_path / "faces.png").exists()


@pytest.mark.usefixtures("can_draw")
def test_sheet_without_names_shows_the_shipped_cast_where_nobody_was_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sheet("everybody.png")
    with Image.open("everybody.png") as picture_of_all:
        assert (
            TITLE_PX + len(cast_names()) / 3 * SHEET_TILE_PX[1] == picture_of_all.height
        )  # three in a row


def test_a_library_without_anybody_is_said_not_replaced(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nobody has been imported"):
        sheet(tmp_path / "none.png", "--library", tmp_path / "mistyped")


@pytest.mark.usefixtures("can_draw")
def test_faces_at_distances_are_shown_in_the_display_s_own_pixels(tmp_path: Path) -> None:
    sheet(tmp_path / "far.png", "anna", "--at", "1,5", "--library", tmp_path)
    with Image.open(tmp_path / "far.png") as picture_of_all:
        assert picture_of_all.width >= 2 * TILE_PX
        row = [
            picture_of_all.getpixel((x, TITLE_PX + TILE_PX // 2))
            for x in range(picture_of_all.width)
        ]
    near, far = row[:TILE_PX], row[TILE_PX : 2 * TILE_PX]
    changes = [sum(a != b for a, b in pairwise(tile)) for tile in (near, far)]
    # 0.42 m are 4.8° at 5 m, 58 pixels of 12 a degree; at 1 m more than the tile has.
    assert changes[1] <= 57 < changes[0]


def test_a_title_is_wholly_on_its_sheet() -> None:
    tile = Image.new("RGB", (240, 240))
    narrow = contact_sheet([tile], "faces as 12 pixels a degree show them", 6)
    wide = contact_sheet([tile] * 12, "faces", 6)

    assert narrow.width > ImageFont.load_default(20).getlength(
        "faces as 12 pixels a degree show them"
    )
    assert (6 * 240, 2 * 240 + TITLE_PX) == wide.size


@pytest.mark.usefixtures("can_draw")
def test_whose_gaze_is_hardly_told_from_afar_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("visavis.cli.preview.readable_gaze.POSES", 4)
    given = [
        str(tmp_path / "far.png"),
        "anna",
        "--at",
        "2,30",
        "--gaze",
        "--library",
        str(tmp_path),
    ]
    result = CliRunner().invoke(app, ["character", "sheet", *given])
    near, far = (line for line in result.output.splitlines() if "gaze recognised" in line)
    assert "anna: gaze recognised at 2 m in" in near
    assert "below 90%" not in near
    assert "below 90%" in far


def test_gaze_without_distances_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--gaze needs --at"):
        sheet(tmp_path / "near.png", "anna", "--gaze", "--library", tmp_path)


def test_distances_that_are_none_are_refused(tmp_path: Path) -> None:
    for wrong in ("near", "0", "1,400"):
        with pytest.raises(UsageError, match="--at"):
            sheet(tmp_path / "far.png", "anna", "--at", wrong, "--library", tmp_path)


def test_nobody_imported_is_said_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="see visavis character import"):
        sheet(tmp_path / "all.png", "--library", tmp_path)


def test_stranger_is_named_beside_those_known(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"there is no bob .* known: anna"):
        sheet(tmp_path / "bob.png", "bob", "--library", tmp_path)


def test_picture_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "old.png").write_bytes(b"old")
    with pytest.raises(UsageError, match="exists already"):
        sheet(tmp_path / "old.png", "anna", "--library", tmp_path)


def test_all_of_a_head_is_on_the_sheet_however_large_that_of_a_mascot_is() -> None:
    anna = load_character("anna")
    small, large = (
        _away_m(scale_to_stature(replace(anna, eyeball=None), stature_m))
        for stature_m in (1.6, 2.4)
    )
    assert FACE_AWAY_M == _away_m(anna)
    assert 1.5 == pytest.approx(large / small)
    assert small >= FACE_AWAY_M
