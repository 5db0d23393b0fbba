"""The table of commands says what the modules register, and `--help` imports none of them."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_group

import cli
from cli.app import app
from cli.command_table import COMMANDS

HEAVY = ("numba", "pandas", "pyarrow", "scipy", "matplotlib", "zmq")


@pytest.fixture(scope="module")
def registered():
    for entry in COMMANDS.values():
        importlib.import_module(f"cli.{entry.module}")
    return get_group(app).commands


def test_every_registered_command_is_in_the_table(registered):
    assert set(COMMANDS) == set(registered)


def test_every_command_module_is_in_the_table():
    modules = {path.stem for path in Path(cli.__file__).parent.glob("*_commands.py")}
    assert modules == {entry.module for entry in COMMANDS.values()}


@pytest.mark.parametrize("name", COMMANDS)
def test_line_in_the_table_is_the_commands_own(name, registered):
    said = (registered[name].help or "").split("\n\n")[0]
    assert COMMANDS[name].help == " ".join(said.split())


def test_help_imports_no_heavy_library():
    program = (
        "import sys\nfrom cli.main import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n"
        f"    print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.rstrip().endswith("[]"), done.stdout[-300:] + done.stderr[-300:]
    assert "doctor" in done.stdout


def test_mistyped_command_is_refused_with_the_nearest():
    done = subprocess.run(
        [sys.executable, "-m", "cli.main", "docter"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert "did you mean 'doctor'" in done.stderr
