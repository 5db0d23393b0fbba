"""new: the files of a study to begin with, which are sound as they are written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.sessions import STUDIES
from visavis.cli.main import app
from visavis.lab.errors import LabError, UsageError
from visavis.results.opened_study import find_study
from visavis.testing import check_study

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def new(*arguments: str) -> str:
    result = CliRunner().invoke(app, ["new", *arguments])
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_new_study_is_sound_and_says_what_to_type_next(tmp_path: Path) -> None:
    said = new("faces")
    assert "visavis simulate ./faces.py --participants 6" in said
    assert {"faces.py", "test_faces.py", "en.yaml", "de.yaml", "fr.yaml"} == {
        p.name for p in tmp_path.rglob("*") if p.is_file()
    }
    check_study(tmp_path / "faces.py", {"repetitions": 1, "scene_s": 1.0})


def test_test_that_is_written_passes_with_pytest(tmp_path: Path) -> None:
    new("faces")
    (tmp_path / "faces.py").write_text(
        (tmp_path / "faces.py").read_text("utf-8").replace('"scene_s": 4.0', '"scene_s": 0.5'),
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider", "."],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert "1 passed" in done.stdout, done.stdout + done.stderr


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "test_faces.py").write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match=r"test_faces\.py is there already"):
        new("faces")
    assert ["test_faces.py"] == [p.name for p in tmp_path.rglob("*")]


@pytest.mark.parametrize("name", ["Faces", "my-faces", "2faces"])
def test_name_that_no_study_can_have_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="cannot name a study"):
        new(name)


def test_name_of_a_shipped_study_is_refused() -> None:
    with pytest.raises(UsageError, match="there is a study stare already"):
        new("stare")


def test_study_from_another_is_the_same_until_it_says_otherwise(tmp_path: Path) -> None:
    new("my_duel", "--from", str(STUDIES / "duel.py"))
    file = tmp_path / "my_duel.py"
    text = file.read_text("utf-8")
    own = find_study(str(file)).experiment({})
    assert 22 == len(own.plan(0, 1).trials)
    file.write_text(text.replace('# "repetitions": 5', '"repetitions": 1'), encoding="utf-8")
    assert 6 == len(find_study(str(file)).experiment({}).plan(0, 1).trials)
    check_study(file)
