"""A cast of the lab's own: whom a configuration names, who plays which part, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from tests.stimuli.glb_figure import Plate, write_glb
from visavis.lab.errors import DesignError
from visavis.stimuli.characters.library import import_characters
from visavis.stimuli.dressing import audience
from visavis.stimuli.dressing.casting import default_casting, members_of, use_cast


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with three figures in `figures`, imported into `characters`."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "figures").mkdir()
    shirt = np.full((4, 4, 3), (40, 60, 160), np.uint8)
    look = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    plate = Plate({"name": "Shirt", "pbrMetallicRoughness": look}, (shirt,))
    for name in ("one_F", "two_M", "three_F"):
        write_glb(folder / "figures" / f"{name}.glb", plate=plate)
    assert all(r.character for r in import_characters(folder / "figures", folder / "characters"))
    return folder


def test_folder_stands_for_the_figures_in_it_beside_names(lab: Path) -> None:
    library = lab / "characters"
    assert [m.name for m in members_of(["figures"], lab, library)] == ["one_F", "three_F", "two_M"]
    some = members_of(["three_F", "anna"], lab, library)
    assert [(m.name, len(m.sha256)) for m in some] == [("three_F", 64), ("anna", 0)]
    assert members_of([], lab, library) == ()


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        (["bob"], "nobody called bob has been imported"),
        (["anna", "bob"], "who is there: one_F, three_F, two_M, anna, bela, "),
        (["one_F", "figures"], "one_F named twice"),
        (["characters"], r"holds no \.glb"),
    ],
)
def test_cast_that_is_not_there_is_refused(lab: Path, entries: list[str], told: str) -> None:
    with pytest.raises(DesignError, match=told):
        members_of(entries, lab, lab / "characters")


@pytest.mark.usefixtures("nobody_cast")
def test_numbers_and_those_who_come_along_are_played_by_the_cast_in_order(lab: Path) -> None:
    use_cast(members_of(["three_F", "one_F", "two_M"], lab, lab / "characters"), lab / "characters")
    played = [default_casting(part).name for part in ("female_01", "female_02", "male_01")]
    assert played == ["three_F", "one_F", "two_M"]
    assert default_casting("anna") is default_casting("female_01")
    assert default_casting("male_01") is default_casting("male_01")


@pytest.mark.usefixtures("nobody_cast")
def test_somebody_who_comes_along_plays_themselves_in_a_cast_that_has_them(lab: Path) -> None:
    use_cast(members_of(["one_F", "bela"], lab, lab / "characters"), lab / "characters")
    assert default_casting("bela").name == "bela"
    assert default_casting("anna").name == "one_F"
    with pytest.raises(DesignError, match="no male person to play male_01"):
        default_casting("gabriel")


@pytest.mark.usefixtures("nobody_cast")
def test_numbers_beyond_the_cast_wear_clothes_of_another_colour(lab: Path) -> None:
    use_cast(members_of(["one_F"], lab, lab / "characters"), lab / "characters")
    first, again = default_casting("female_01"), default_casting("female_02")
    assert again.name == "one_F_2"
    cloth = next(i for i, m in enumerate(first.materials) if m.kind == "cloth")
    mesh = again.levels[0]
    worn = mesh.colour_srgb[np.unique(mesh.triangles[mesh.triangle_material == cloth])]
    picture = again.materials[cloth].texture_srgb
    assert picture is not None
    shown = worn.mean(axis=0) * picture.reshape(-1, 3).mean(axis=0) / 255
    assert np.linalg.norm(shown - [40, 60, 160]) > 40
    assert again.skeleton is first.skeleton


@pytest.mark.usefixtures("nobody_cast")
def test_the_audience_has_a_speaker_where_nobody_can_dress_anew(lab: Path, tmp_path: Path) -> None:
    write_glb(tmp_path / "bare_M.glb")
    assert all(r.character for r in import_characters(tmp_path / "bare_M.glb", lab / "characters"))
    use_cast(members_of(["bare_M"], lab, lab / "characters"), lab / "characters")
    only = default_casting("male_01")
    assert audience._speaker((only,), default_casting) is only


@pytest.mark.usefixtures("nobody_cast")
def test_one_process_shows_one_cast(lab: Path) -> None:
    library = lab / "characters"
    mine = members_of(["one_F"], lab, library)
    use_cast(members_of(["two_M"], lab, library), library)
    use_cast(mine, library)  # nobody has been cast: another choice is free
    default_casting("female_01")
    use_cast(mine, library)
    with pytest.raises(DesignError, match="different casts"):
        use_cast((), library)


@pytest.mark.usefixtures("nobody_cast")
def test_file_that_is_not_the_one_recorded_is_refused(lab: Path, tmp_path: Path) -> None:
    members = members_of(["one_F"], lab, lab / "characters")
    (tmp_path / "one_F.npz").write_bytes(b"another")
    use_cast(members, tmp_path)
    with pytest.raises(DesignError, match="not the one_F that was recorded"):
        default_casting("female_01")
