"""What takes long says so before it begins; what is refused is refused before it is worked out."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from visavis.cli import main as command
from visavis.cli.commands import preview, session
from visavis.cli.notifier import build_missing_films, prepare_pages
from visavis.lab.config_files import EXAMPLE
from visavis.results.opened_study import find_study
from visavis.running import live_film
from visavis.running.film_store import FilmFile, FilmStore, film_store
from visavis.running.sessions.session_request import Request
from visavis.study.experiment import StudyExperiment
from visavis.study.films import Film
from visavis.study.scenes import Scene

FILMS = (Film(Scene("person", motion="wave"), 0.1), Film(Scene("person", motion="idle"), 0.1))


@pytest.mark.usefixtures("hooks_restored")
def test_a_session_of_nobody_is_announced_before_its_first_trial_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before_the_first: list[str] = []

    def performed(request: Request) -> None:
        before_the_first.append(capsys.readouterr().err)
        assert request.on_trial is not None
        request.on_trial("trial 1", 1, 12)
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(session, "perform_new", performed)
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    with pytest.raises(SystemExit) as ended:
        command.main(["run", "interpolation", "--participant", "1", "--fast", "--devices", "sim"])
    assert 130 == ended.value.code
    assert "performing interpolation" in before_the_first[0]
    assert "1/12" in capsys.readouterr().err


@pytest.mark.usefixtures("hooks_restored")
def test_a_window_of_a_page_is_refused_before_anything_is_performed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(preview, "Capture", None)
    monkeypatch.setattr(preview, "plan_inputs_of", None)
    with pytest.raises(SystemExit) as ended:
        command.main(["preview", "hybrid"])
    assert 2 == ended.value.code
    said = capsys.readouterr().err.replace("\n", " ")
    assert "hybrid shows its films on a page: give --png, --sheet or --video FILE" in said


def test_films_are_looked_for_and_drawn_with_a_word_before_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said_before: list[str] = []

    class Slow(FilmStore):
        """Films of which one is missing; notes what was said before work begins."""

        def file_of(self, film: Film) -> FilmFile | None:
            said_before.append(capsys.readouterr().err)
            return None if film is FILMS[1] else FilmFile(tmp_path, "", 0)

        def build(self, films: Sequence[Film], report_progress: Callable[[int, int], None]) -> None:
            assert [FILMS[1]] == films
            report_progress(0, 30)
            said_before.append(capsys.readouterr().err)

    build_missing_films(Slow({}, tmp_path, tmp_path), FILMS)
    looks, _, draws = said_before
    assert "looking for films" in looks
    assert "drawing 1 film" in draws


def test_scenes_that_pages_draw_are_computed_with_a_word_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said_before: list[str] = []
    monkeypatch.setattr(
        live_film, "live_film_files", lambda *_: said_before.append(capsys.readouterr().err)
    )
    experiment = find_study("waving_page").experiment({"increment": 0.0})
    assert isinstance(experiment, StudyExperiment)
    prepare_pages(FilmStore({}, tmp_path, tmp_path), experiment)
    assert len(experiment.lives) == len(said_before)
    assert "computing everybody's poses" in said_before[0]


def test_a_session_finds_the_names_of_its_films_once() -> None:
    experiment = find_study("hybrid").experiment({})
    assert film_store(experiment) is film_store(experiment)
