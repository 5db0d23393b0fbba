"""The table of commands says what the modules register, and `--help` imports none of them."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_group
from typer.testing import CliRunner

from visavis.cli import commands
from visavis.cli.app import app
from visavis.cli.command_table import COMMANDS

HEAVY = ("pydantic", "numpy", "numba", "pandas", "pyarrow", "scipy", "matplotlib", "zmq", "yaml")


@pytest.fixture(scope="module")
def registered():
    for entry in COMMANDS.values():
        importlib.import_module(f"visavis.cli.commands.{entry.module}")
    return get_group(app).commands


def test_every_registered_command_is_in_the_table(registered):
    assert set(COMMANDS) == set(registered)


def test_every_command_module_is_in_the_table():
    modules = {path.stem for path in Path(commands.__file__).parent.glob("*.py")} - {"__init__"}
    assert modules == {entry.module for entry in COMMANDS.values()}


@pytest.mark.parametrize("name", COMMANDS)
def test_line_in_the_table_is_the_commands_own(name, registered):
    said = (registered[name].help or "").split("\n\n")[0]
    assert COMMANDS[name].help == " ".join(said.split())


PROGRAM = (
    "import atexit, sys\n"
    f"atexit.register(lambda: print('loaded', *(m for m in {HEAVY!r} if m in sys.modules)))\n"
    "sys.argv[0] = 'visavis'\n"
    "from visavis.cli.main import main\nmain()"
)
"""The command; its last line names the heavy libraries that were loaded."""


def answered(*arguments: str, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, **environment},
    )
    assert "" == done.stderr
    return done.stdout.splitlines()


def test_help_lists_every_command_in_full_and_loads_nothing_heavy():
    *lines, loaded = answered("--help", COLUMNS="80")
    assert "loaded" == loaded
    said = " ".join(" ".join(lines).split())
    assert [] == [name for name, entry in COMMANDS.items() if f"{name} {entry.help}" not in said]


def test_version_loads_nothing_heavy():
    assert ["loaded"] == answered("--version")[1:]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_of_commands_loads_nothing_heavy(shell):
    typed = {"COMP_WORDS": "visavis re", "COMP_CWORD": "1"}
    typed |= {"_TYPER_COMPLETE_ARGS": "visavis re", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    *lines, loaded = answered(_VISAVIS_COMPLETE=f"complete_{shell}", **typed)
    expected = [name for name in COMMANDS if name.startswith("re")]
    assert [] == [name for name in expected if name not in " ".join(lines)]
    assert "Simulate a whole study" not in " ".join(lines)
    assert "loaded" == loaded


def test_options_of_a_command_are_completed():
    typed = {"COMP_WORDS": "visavis init --", "COMP_CWORD": "2"}
    assert "--help" in answered(_VISAVIS_COMPLETE="complete_bash", **typed)


def test_completion_is_shown_for_the_shell_in_use(monkeypatch):
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: "zsh")
    shown = CliRunner().invoke(app, ["--show-completion"], prog_name="visavis").stdout
    assert "#compdef visavis" in shown
    assert "_VISAVIS_COMPLETE=complete_zsh" in shown


def test_mistyped_command_is_refused_with_the_nearest():
    done = subprocess.run(
        [sys.executable, "-m", "visavis.cli.main", "docter"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert "did you mean 'doctor'" in done.stderr


def test_verbs_of_a_study_begin_without_the_viewer_and_what_films_need():
    names = ("visavis.cli.viewer.content", "scipy.ndimage", "scipy.sparse.csgraph", "matplotlib")
    program = "import sys, visavis.cli.commands.study; print(*sys.modules)"
    modules = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout.split()
    assert [] == [name for name in names if name in modules]
