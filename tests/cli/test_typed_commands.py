"""Every command that a message prints goes on when it is typed where it was printed."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.cli.test_commands_in_docs import problem_of
from tests.sessions import STUDIES
from visavis.cli.main import app
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import LabError

PRINTED = re.compile(r"visavis ((?:participant|[a-z-]+)(?: (?:'[^']*'|\"[^\"]*\"|[^\s`;,]+))+)")
PLACES = ("ID", "STUDY", "MODEL")
FAST = ("--devices", "sim", "--fast")
QUICKLY = {"run": FAST, "simulate": ("--participants", "1", "--processes", "1")}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a lab's folder with a study file in a folder of a name with a blank."""
    here = tmp_path / "my lab"
    (here / "studies of ours").mkdir(parents=True)
    (here / "lab_config.yaml").write_bytes(EXAMPLE.read_bytes())
    shutil.copy(STUDIES / "asking.py", here / "studies of ours" / "asking.py")
    monkeypatch.chdir(here)
    return here


FILE = "./studies of ours/asking.py"


def typed(*words: str) -> str:
    """Return all that a command says, whether it goes on or not."""
    result = CliRunner().invoke(app, words)
    if isinstance(result.exception, LabError):
        return str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), words
    return " ".join(result.output.split())


def commands_in(said: str) -> list[list[str]]:
    """Return the words of every command that a message prints."""
    found = []
    for line in PRINTED.findall(said):
        words = shlex.split(line)
        while words and re.fullmatch(r"(or|and|to|a|at|in)", words[-1]):
            words.pop()
        found.append([w.rstrip(".:") if w.startswith("-") else w for w in words])
    return found


@pytest.mark.parametrize(
    "words",
    [
        ("participant", "withdraw", FILE, "9", "--devices", "real"),
        ("participant", "list", FILE, "--devices", "real"),
        ("check", FILE),
        ("analyse", FILE),
        ("resume",),
        ("resume", FILE),
        ("run", FILE, "--participant", "1", "--devices", "real", "--on", "browser"),
    ],
)
def test_commands_printed_where_nothing_was_performed_find_the_study(
    lab: Path, words: tuple[str, ...]
) -> None:
    said = typed(*words)
    for command in commands_in(said):
        assert "" == problem_of(command), said
        if not set(command) & set(PLACES):
            again = typed(*command, *QUICKLY.get(command[0], ()))
            assert "there is no study" not in again, f"{said} → {command} → {again}"
            assert "does not exist" not in again, f"{said} → {command} → {again}"


def test_person_who_is_not_registered_is_added_by_the_command_that_is_printed(lab: Path) -> None:
    said = typed("participant", "withdraw", FILE, "9", "--devices", "real")
    (command,) = [c for c in commands_in(said) if c[:2] == ["participant", "add"]]
    assert [FILE, "9"] == command[2:4]
    assert "is participant 9 of" in typed(*command, "--devices", "real")


def test_commands_printed_of_a_session_that_is_there_go_on(lab: Path) -> None:
    run = ("run", FILE, "--participant", "1", *FAST)
    assert "next" in typed(*run) or list(lab.rglob("ses-001"))
    said = typed(*run)
    assert "resume" not in said  # it is complete: there is nothing to resume
    assert "add --session 2" in said
    for command in commands_in(said):
        assert "" == problem_of(command)
        assert "not a session" not in typed(*command)
    (session,) = lab.rglob("ses-001")
    said = typed("resume", str(session))
    (further,) = [c for c in commands_in(said) if c[0] == "run"]
    assert FILE in further
    typed(*further, *FAST)
    assert 2 == len(list(lab.rglob("ses-*/manifest.json")))


def test_parquet_is_not_mixed_into_a_bids_data_set(lab: Path) -> None:
    typed("run", FILE, "--participant", "1", *FAST)
    typed("export", FILE, "--format", "bids", "-o", "out")
    assert Path("out/dataset_description.json").exists()
    before = sorted(Path("out").rglob("*"))
    said = typed("export", FILE, "-o", "out")
    assert "is a BIDS data set" in said
    assert before == sorted(Path("out").rglob("*"))
