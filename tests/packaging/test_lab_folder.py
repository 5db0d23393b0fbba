"""Whatever a laboratory calls its own files, Visavis works beside them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.packaging.lab_folder import fill_lab_folder
from tests.sessions import STUDIES


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study and the lab's own modules."""
    folder = tmp_path_factory.mktemp("lab")
    fill_lab_folder(folder)
    shutil.copytree(STUDIES / "texts", folder / "texts")
    shutil.copy(STUDIES / "duel.py", folder / "duel.py")
    return folder


def printed(folder: Path, *arguments: str) -> str:
    """Run Python in the lab's folder, as it is installed here; return what it printed."""
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert 0 == done.returncode, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def test_script_imports_its_own_modules_and_visavis(folder: Path) -> None:
    assert "visavis.study.declaration visavis.analysis.gaze" in printed(folder, "script.py")


def test_command_runs_beside_own_modules(folder: Path) -> None:
    assert "trials in" in printed(
        folder, "-m", "visavis", "plan", "./duel.py", "--participant", "1"
    )


def test_pytest_runs_beside_own_modules(folder: Path) -> None:
    assert "1 passed" in printed(folder, "-m", "pytest", "-q", "test_duel.py")


def test_type_checker_in_a_users_folder_knows_what_visavis_takes(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "typed.py"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert 'incompatible type "int"; expected "str | Path"' in done.stdout, done.stdout
    assert 'Revealed type is "pathlib.Path"' in done.stdout
    assert 'argument "practise" for "Study"; did you mean "practice"?' in done.stdout
    assert 2 == done.stdout.count("error:")
