"""A command that is forked from the server of commands behaves as a process that is started."""

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.commands import COMMANDS, Commands, ForkedCommand
from tests.sessions import STUDIES
from visavis.lab.config_files import EXAMPLE

pytestmark = [
    pytest.mark.slow,  # the server takes longer to start than most of the tests
    pytest.mark.skipif(os.name != "posix", reason="Windows forks no process"),
    pytest.mark.timeout(600),
]

TELL = """
import json, os, signal, sys, threading
print(json.dumps({
    "words": sys.argv, "original": sys.orig_argv, "here": os.getcwd(), "path": sys.path,
    "environment": dict(os.environ), "read": sys.stdin.read(),
    "main": sorted(vars().keys() - {"__annotations__"}),
    "streams": [(s.fileno(), s.name, s.mode, s.encoding, s.errors, s.line_buffering,
                 s.write_through) for s in (sys.stdin, sys.stdout, sys.stderr)],
    "descriptors": sorted(os.listdir("/proc/self/fd")) if os.path.exists("/proc/self/fd") else [],
    "signals": [str(signal.getsignal(n)) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGCHLD)],
    "group": os.getpgrp(), "threads": [t.name for t in threading.enumerate()],
}))
sys.stderr.write("said\\n")
sys.exit(7)
"""
COMMAND = ["-m", "visavis.cli.main"]
VERBS = [
    "run ./duel.py --participant 1 --fast --devices sim --set repetitions=1",
    "run ./duel.py --participant 1 --fast --devices sim",  # refused: it is there already
    "check ./duel.py",
    "analyse ./duel.py --processes 1",
]
CHANGING = re.compile(
    rb'"(?:code_revision|sha256|created_utc|after|crc32)": ?"[^"]*"'
    rb"|\d{4}-\d\d-\d\dT[\d:.]+(?:Z|\+00:00)?"
)
"""The time of day, and checks over a text with it."""


def run_new(
    *arguments: str, cwd: Path, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a new process, as `Commands.run` runs a forked one."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


def lab_in(folder: Path) -> Path:
    """Return a lab's folder with a study."""
    folder.mkdir()
    shutil.copytree(STUDIES / "texts", folder / "texts")
    shutil.copy(STUDIES / "duel.py", folder)
    (folder / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    return folder


def digests(folder: Path) -> dict[str, str]:
    """Hash every file below a folder but what names a time of day."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(
            CHANGING.sub(b"", path.read_bytes())
        ).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }


@pytest.mark.parametrize("before", [[], ["-u"]])
@pytest.mark.parametrize("way", ["-c", "-m"])
def test_words_folder_environment_and_streams_are_those_of_a_new_process(
    before: list[str], way: str, tmp_path: Path
) -> None:
    (tmp_path / "telling.py").write_text(TELL, "utf-8")
    what = TELL if way == "-c" else "telling"
    more = {"OWN": "grüße", "PYTHONPATH": str(tmp_path / "more"), "PYTHONUNBUFFERED": ""}
    environment = {**os.environ, **more}
    arguments = [*before, way, what, "--word", "a b"]
    expected = run_new(*arguments, cwd=tmp_path, env=environment)
    actual = COMMANDS.run(*arguments, cwd=tmp_path, env=environment)
    assert json.loads(expected.stdout) == json.loads(actual.stdout)
    assert (7, "said\n") == (expected.returncode, expected.stderr)
    assert (7, "said\n") == (actual.returncode, actual.stderr)


def output_of(process: subprocess.CompletedProcess[str]) -> tuple[int, str, str]:
    """Return how a command ended and what it said, whatever time it took."""
    out, err = (re.sub(r"\d+:\d\d:\d\d|in \d+ s", "", s) for s in (process.stdout, process.stderr))
    return process.returncode, out, err


def test_commands_say_and_write_what_new_processes_do(tmp_path: Path) -> None:
    environment = {**os.environ, "COLUMNS": "200"}
    outputs, files = [], []
    for run in (run_new, COMMANDS.run):
        lab = lab_in(tmp_path / "lab")
        outputs.append(
            [output_of(run(*COMMAND, *v.split(), cwd=lab, env=environment)) for v in VERBS]
        )
        files.append(digests(lab))
        shutil.rmtree(lab)
    for verb, expected, actual in zip(VERBS, *outputs, strict=True):
        assert expected == actual, verb
    assert files[0] == files[1]


def test_nothing_of_the_commands_or_of_the_tests_is_there_before_they_import_it() -> None:
    program = "import sys; print({one.partition('.')[0] for one in sys.modules})"
    tops = COMMANDS.run("-c", program).stdout
    assert "'visavis'" in tops
    for top in ("tests", "typer", "rich"):  # the last two look at the terminal
        assert f"'{top}'" not in tops
    program = "import sys; print([one for one in sys.modules if one.startswith('visavis.cli')])"
    assert "[]\n" == COMMANDS.run("-c", program).stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_signals_reach_the_command_and_end_it_as_a_new_process(number: int) -> None:
    program = "import signal; print('ready', flush=True); signal.pause()"
    with subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as new:
        assert new.stdout is not None
        assert "ready\n" == new.stdout.readline()
        new.send_signal(number)
        expected = new.wait(60)
    pipe = subprocess.PIPE
    command = COMMANDS.start("-c", program, stdout=pipe, stderr=subprocess.DEVNULL)
    assert command.stdout is not None
    assert "ready\n" == command.stdout.readline()
    assert command.poll() is None
    command.send_signal(number)
    assert expected == command.wait(60) == command.returncode
    command.send_signal(number)  # nobody is there any more
    assert ("", None) == command.communicate()


def test_streams_are_joined_and_fed(tmp_path: Path) -> None:
    program = "import sys; print(input(), flush=True); print('b', file=sys.stderr)"
    pipe = subprocess.PIPE
    with COMMANDS.start("-c", program, stdin=pipe, stdout=pipe, stderr=subprocess.STDOUT) as one:
        assert isinstance(one, ForkedCommand)
        assert one.stdin is not None
        one.stdin.write("a\n")
        assert ("a\nb\n", None) == one.communicate(timeout=60)
    assert 0 == one.returncode


def test_a_command_that_goes_on_is_waited_for_no_longer_than_asked() -> None:
    program = "import sys; print('here', flush=True); sys.stdin.read()"
    pipe = subprocess.PIPE
    command = COMMANDS.start("-c", program, stdin=pipe, stdout=pipe)
    with pytest.raises(subprocess.TimeoutExpired):
        command.wait(0.05)
    assert ("here\n", None) == command.communicate(timeout=60)  # whose stdin is closed now
    assert 0 == command.returncode


def test_what_a_command_took_counts_once_it_has_ended() -> None:
    before_s = COMMANDS.spent_s
    program = "import time\nwhile time.process_time() < 0.3: pass"
    assert 0 == COMMANDS.run("-c", program).returncode
    assert 0.3 <= COMMANDS.spent_s - before_s < 3.0


def test_an_environment_that_python_reads_as_it_starts_takes_a_new_process() -> None:
    before_s = COMMANDS.spent_s
    program = "import sys; print(sys.flags.hash_randomization)"
    fixed = {**os.environ, "PYTHONHASHSEED": "0"}
    assert "0\n" == COMMANDS.run("-c", program, env=fixed).stdout
    assert before_s == COMMANDS.spent_s
    assert "1\n" == COMMANDS.run("-c", program).stdout
    assert before_s < COMMANDS.spent_s


def test_what_was_forked_outlives_its_server_whose_time_is_no_tests() -> None:
    commands, pipe = Commands(), subprocess.PIPE
    command = commands.start("-c", "print(input())", stdin=pipe, stdout=pipe)
    before_s = sum(os.times()[2:4]) + commands.spent_s
    commands.close()
    assert before_s == pytest.approx(sum(os.times()[2:4]) + commands.spent_s)
    assert command.stdin is not None
    command.stdin.write("on\n")
    command.stdin.close()
    assert command.stdout is not None
    assert "on\n" == command.stdout.read()
    command.stdout.close()
    with pytest.raises(AssertionError, match="the server of commands has ended"):
        command.wait(60)
