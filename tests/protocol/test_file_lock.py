"""Locks of files that several processes change."""

import subprocess
import sys
from pathlib import Path

import pytest

from visavis.lab.errors import LedgerError
from visavis.protocol.people.file_lock import locked

HOLD = """
import sys
from pathlib import Path
from visavis.protocol.people.file_lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.readline()
"""
TRY = """
import sys
from pathlib import Path
from visavis.protocol.people.file_lock import locked
with locked(Path(sys.argv[1])):
    print("mine")
"""


def process(program: str, path: Path) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", program, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def ended(running: "subprocess.Popen[str]") -> str:
    return running.communicate(timeout=60)[0]


def test_a_second_process_waits_until_the_first_is_done(tmp_path: Path) -> None:
    first = process(HOLD, tmp_path / "lock")
    assert first.stdout is not None
    assert "held\n" == first.stdout.readline()
    second = process(TRY, tmp_path / "lock")
    with pytest.raises(subprocess.TimeoutExpired):
        second.wait(timeout=2.0)
    ended(first)
    assert "mine\n" == ended(second)


def test_a_process_that_is_killed_holds_nothing(tmp_path: Path) -> None:
    first = process(HOLD, tmp_path / "lock")
    assert first.stdout is not None
    first.stdout.readline()
    first.kill()
    ended(first)
    assert (tmp_path / "lock").exists()
    assert "mine\n" == ended(process(TRY, tmp_path / "lock"))


def test_the_lock_is_dropped_where_the_work_fails(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), locked(tmp_path / "lock"):
        raise ZeroDivisionError
    assert "mine\n" == ended(process(TRY, tmp_path / "lock"))


def test_a_lock_nobody_else_may_read_and_a_folder_that_is_a_file(tmp_path: Path) -> None:
    with locked(tmp_path / "new" / "lock"):
        if sys.platform != "win32":
            assert 0o600 == (tmp_path / "new" / "lock").stat().st_mode & 0o777
    (tmp_path / "file").touch()
    refused = pytest.raises(LedgerError, match="cannot be locked")
    with refused, locked(tmp_path / "file" / "lock"):
        pass
