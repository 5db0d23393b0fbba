"""Verbs on a study file, from a folder of its own: check, export, redraw, replay, resume."""

import os
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.sessions import STUDIES
from visavis.cli.main import app
from visavis.lab.config_files import EXAMPLE
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a study file and one rehearsed session of it."""
    folder = tmp_path_factory.mktemp("lab")
    shutil.copytree(STUDIES / "texts", folder / "texts")
    shutil.copy(STUDIES / "duel.py", folder / "duel.py")
    shutil.copy(EXAMPLE, folder / "lab_config.yaml")
    assert 0 == said(folder, "run ./duel.py --participant 1 --fast --set repetitions=1")[0]
    return folder


def said(folder: Path, arguments: str) -> tuple[int, str]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        result = CliRunner().invoke(app, arguments.split())
    finally:
        os.chdir(before)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, " ".join(result.output.split())


def test_check_of_a_study_file_verifies_its_data(here: Path) -> None:
    code, text = said(here, "check ./duel.py")
    assert (0, True) == (code, "1 session, every file verified" in text)


def test_check_of_one_participant_says_whether_they_can_leave(here: Path) -> None:
    code, text = said(here, "check ./duel.py --participant 1")
    assert (0, True) == (code, "They can leave" in text)


def test_participant_without_a_session_is_told_who_has_one(here: Path) -> None:
    with pytest.raises(Exception, match=r"9 has no session there; there are S01B"):
        said(here, "check ./duel.py --participant 9")


def test_quality_of_a_session_is_printed_and_written_as_a_marked_page(here: Path) -> None:
    session = next(here.rglob("ses-001")).relative_to(here)
    code, text = said(here, f"quality {session}")
    assert (0, True) == (code, "Stated rate 120.0 Hz" in text)
    page = next(here.rglob("gaze_quality.html")).read_text(encoding="utf-8")
    assert "SIMULATED" in page
    assert "Precision, RMS-S2S" in page


def test_export_of_a_study_file_copies_every_session(here: Path) -> None:
    code, text = said(here, "export ./duel.py -o out")
    assert (0, True) == (code, "1 session in out" in text)
    assert list((here / "out").rglob("*.parquet"))


def test_export_says_once_whose_keys_and_privacy_are_in_force(here: Path) -> None:
    session = next(here.rglob("ses-001")).relative_to(here)
    for wanted, folder in (("./duel.py", "a"), (session, "b")):
        _, text = said(here, f"export {wanted} -o out_{folder}")
        assert text.startswith(f"configuration: {here / 'lab_config.yaml'}")
        assert 1 == text.count("configuration:")


def test_resume_of_a_study_without_a_broken_session_says_so(here: Path) -> None:
    with pytest.raises(Exception, match="no unfinished session"):
        said(here, "resume ./duel.py")


def test_film_films_a_recorded_trial_of_any_study(here: Path) -> None:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    arguments = (
        "film ./duel.py --trial T02 -o t.avi --camera eyes --seconds 0.4 --rate 5 --size 128x96"
    )
    assert 0 == said(here, arguments)[0]
    assert (here / "t.avi").stat().st_size > 3000


def test_replay_without_verify_says_what_to_type(here: Path) -> None:
    with pytest.raises(Exception, match=r"add --verify.*visavis view .*visavis film"):
        said(here, "replay ./duel.py")


def test_film_of_a_trial_that_is_not_there_lists_those_that_are(here: Path) -> None:
    with pytest.raises(Exception, match=r"has no trial T99; it has P1, P2, T01"):
        said(here, "film ./duel.py --trial T99 -o u.avi")
