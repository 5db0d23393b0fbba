"""examples and completion: what is written is sound as it stands."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from visavis.cli.main import app
from visavis.lab.errors import UsageError
from visavis.running.new_study import READY, write_examples
from visavis.testing import check_study

ROOT = Path(__file__).parents[2]
STUDIES = sorted(path.name.removesuffix(".txt") for path in READY.glob("*.py.txt"))
SHORT = {
    "glances.py": {"repetitions": 1, "scene_s": 0.5},
    "quick_press.py": {"repetitions": 1},
    "stroop.py": {"repetitions": 1},
    "contrast.py": {"repetitions": 2},
    "dots.py": {"repetitions": 2},
    "faces.py": {"repetitions": 2},
    "search.py": {"repetitions": 2},
    "around.py": {"repetitions": 1},
    "approach.py": {"repetitions": 1},
    "before_after.py": {"repetitions": 1, "scene_s": 0.5},
    "lively_films.py": {"repetitions": 1, "film_s": 0.2},
}


def test_examples_are_written_once_and_overwrite_nothing(tmp_path: Path) -> None:
    written = write_examples(tmp_path / "here")
    pictures = {path.name for path in written if path.suffix in (".png", ".yaml")}
    others = {"README.md", "means.R", "means.py", "faces.csv", "search.csv", *SHORT}
    assert others == {path.name for path in written} - pictures
    assert 8 + 16 + 2 == len(pictures)
    assert sorted({"means.py", *SHORT}) == STUDIES
    with pytest.raises(UsageError, match="there already"):
        write_examples(tmp_path / "here")


@pytest.mark.parametrize("name", SHORT)
def test_every_ready_study_is_sound(name: str, tmp_path: Path) -> None:
    write_examples(tmp_path)
    check_study(tmp_path / name, SHORT[name])


def test_the_ready_script_reads_what_the_ready_study_records(tmp_path: Path) -> None:
    write_examples(tmp_path)
    simulate = (
        "import visavis\n"
        "if __name__ == '__main__':\n"
        "    visavis.simulate('glances.py', 2, output='out', seed=1, parameters=\n"
        "                     {'repetitions': 1, 'practice': 0, 'scene_s': 1.0})\n"
    )
    (tmp_path / "simulated.py").write_text(simulate, "utf-8")
    said = ""
    for command in (["simulated.py"], ["means.py", "out/simulated/glances"]):
        done = subprocess.run(
            [sys.executable, *command],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert 0 == done.returncode, done.stderr
        said = done.stdout
    assert "directed" in said
    assert (tmp_path / "means.csv").exists()


def test_completion_is_installed_by_a_verb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    result = CliRunner().invoke(app, ["completion", "--shell", "bash"])
    assert 0 == result.exit_code, result.output
    (script,) = (tmp_path / ".bash_completions").iterdir()
    assert "_VISAVIS_COMPLETE" in script.read_text("utf-8")
    assert "visavis.sh" in (tmp_path / ".bashrc").read_text("utf-8")
    shown = CliRunner().invoke(app, ["completion", "--shell", "zsh", "--show"])
    assert "#compdef visavis" in shown.output
