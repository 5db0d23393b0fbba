"""Who plays goes from the lab's configuration into the session, and to whatever reads it."""

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from tests.stimuli.glb_figure import Plate, write_glb
from visavis.cli.app import load_lab
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import LabConfig, parse_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DataError, UsageError
from visavis.recording.reader import Recording
from visavis.running.film_store import FilmStore
from visavis.running.sessions import simulation
from visavis.running.sessions.simulation import SimulationTask
from visavis.stimuli.characters.library import import_characters
from visavis.stimuli.dressing import casting, gathering
from visavis.stimuli.dressing.casting import default_casting, members_of
from visavis.study.cast import use_cast_of, use_recorded_cast
from visavis.study.films import Film
from visavis.study.scenes import Scene

pytestmark = pytest.mark.usefixtures("nobody_cast")


def _anew() -> None:
    """Go on as in another process."""
    casting._in_force.__init__()  # type: ignore[misc]
    default_casting.cache_clear()
    casting._person.cache_clear()
    gathering._set_of.cache_clear()


def _lab(folder: Path, line: str) -> LabConfig:
    text = EXAMPLE.read_text("utf-8") + line
    return parse_config(text, EXAMPLE, OPTION_MODELS, folder=folder)


@dataclass(frozen=True)
class _Kept:
    path: Path
    manifest: Any

    @staticmethod
    def of(path: Path, configuration: dict[str, Any]) -> Recording:
        """Return what reads of a session ask: its folder and what it keeps of the lab."""
        manifest = SimpleNamespace(configuration=configuration)
        return cast("Recording", _Kept(path, manifest))


def _imported(tmp_path: Path) -> None:
    write_glb(tmp_path / "one_F.glb")
    assert all(r.character for r in import_characters(tmp_path, tmp_path / "data" / "characters"))


def test_session_keeps_names_and_hashes_and_what_reads_it_shows_the_same(tmp_path: Path) -> None:
    _imported(tmp_path)
    lab = _lab(tmp_path, "cast: [one_F, anna]\n")
    elsewhere = lab.model_copy(update={"data_root": tmp_path / "out"})
    kept = use_cast_of(elsewhere)
    assert [entry["name"] for entry in kept["cast"]] == ["one_F", "anna"]
    assert default_casting("female_01").name == "one_F"
    beside = tmp_path / "out" / "characters" / "one_F.npz"
    assert beside.read_bytes() == (tmp_path / "data" / "characters" / "one_F.npz").read_bytes()

    _anew()
    session = tmp_path / "out" / "simulated" / "stare" / "sub-S01" / "ses-001"
    use_recorded_cast(_Kept.of(session, kept))
    assert default_casting("female_01").name == "one_F"


def test_without_a_cast_nothing_is_kept_and_nobody_changes(tmp_path: Path) -> None:
    assert use_cast_of(_lab(tmp_path, "")) == {}
    use_recorded_cast(_Kept.of(tmp_path, {}))
    assert default_casting("female_01").name == "anna"


def test_another_file_beside_the_data_is_not_overwritten(tmp_path: Path) -> None:
    _imported(tmp_path)
    beside = tmp_path / "out" / "characters"
    beside.mkdir(parents=True)
    (beside / "one_F.npz").write_bytes(b"another")
    lab = _lab(tmp_path, "cast: [one_F]\n").model_copy(update={"data_root": tmp_path / "out"})
    with pytest.raises(UsageError, match="another file"):
        use_cast_of(lab)
    assert (beside / "one_F.npz").read_bytes() == b"another"


def test_cast_that_a_session_does_not_tell_whole_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cast cannot be read"):
        use_recorded_cast(_Kept.of(tmp_path, {"cast": [{"name": "one_F"}]}))


class _Made(Exception):
    """A study was asked for."""


def _asked(_: object) -> None:
    raise _Made


def test_cast_is_chosen_before_a_study_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The crowd lays its people out by stature as soon as its trials are read.
    _imported(tmp_path)
    monkeypatch.setattr(simulation, "find_study", _asked)
    task = cast("Any", SimpleNamespace(config=_lab(tmp_path, "cast: [one_F]\n"), study="crowd"))
    with pytest.raises(_Made):
        simulation.simulate_one(task)
    assert default_casting("female_01").name == "one_F"


def test_commands_have_the_cast_of_the_configuration_in_force(tmp_path: Path) -> None:
    _imported(tmp_path)
    path = tmp_path / "lab_config.yaml"
    path.write_text(EXAMPLE.read_text("utf-8") + "cast: [one_F]\n", "utf-8")
    load_lab(path, quiet=True, with_cast=False)
    assert casting._in_force.members == ()
    load_lab(path, quiet=True)
    assert default_casting("female_01").name == "one_F"


def test_session_on_a_page_keeps_who_its_films_show(tmp_path: Path) -> None:
    _imported(tmp_path)
    study = str(Path(__file__).parents[1] / "studies" / "films.py")
    lab = _lab(tmp_path, "cast: [one_F]\n")
    session = simulation.simulate_one(SimulationTask(study, lab, "S01", 0, "", 1, True, {}))
    kept = Recording(session).manifest.configuration["cast"]
    assert ["one_F"] == [entry["name"] for entry in kept]


def test_film_of_a_figure_that_was_imported_anew_is_another(tmp_path: Path) -> None:
    film = Film(Scene("person", motion="wave"), 0.1, size_px=(64, 64), rate_hz=30)
    names = []
    for red in (40, 200):
        look = {"pbrMetallicRoughness": {"baseColorFactor": [red / 255, 0.2, 0.2, 1.0]}}
        write_glb(tmp_path / "one_F.glb", plate=Plate({"name": "Badge"} | look))
        assert all(r.character for r in import_characters(tmp_path, tmp_path / "characters"))
        _anew()
        members = members_of(["one_F"], tmp_path, tmp_path / "characters")
        casting.use_cast(members, tmp_path / "characters")
        names.append(FilmStore({}, tmp_path / str(red)).name_of(film))
    assert 2 == len(set(names))
