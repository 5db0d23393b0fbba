"""What exists on POSIX alone is called from listed places only, each with its guard.

mypy for win32 and darwin (the test command in README.md) proves what its stubs know; this list
holds what they do not.
"""

import ast
import importlib.util
import sys
import types

import pytest

from tests.product_files import PACKAGE, name_in_repository, product_files

OF_POSIX = {
    "os": {
        "openpty", "ttyname", "set_blocking", "fork", "getuid", "geteuid", "getgid", "killpg",
        "setsid", "mkfifo", "sched_getaffinity", "fchmod", "chown", "nice", "wait4", "getloadavg",
        "O_NOFOLLOW", "O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC",
    },
    "signal": {
        "SIGKILL", "SIGHUP", "SIGSTOP", "SIGCONT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGPIPE",
        "SIGQUIT", "pthread_kill", "setitimer", "alarm",
    },
    "socket": {"AF_UNIX", "AF_BLUETOOTH", "AF_NETLINK"},
    "select": {"poll", "epoll"},
    "shutil": {"chown"},
}  # fmt: skip
MODULES = {"fcntl", "pwd", "grp", "resource", "termios", "tty", "pty", "syslog", "posix"}

GUARDED = {
    ("src/visavis/cli/doctor/machine.py", "os.getloadavg"): "hasattr; no load is told without it",
    ("src/visavis/cli/main.py", "signal.pthread_kill"): "hasattr; _thread.interrupt_main otherwise",
    ("devices/drivers/triggers/links.py", "fcntl"): "sys.platform; by address on Windows",
    ("src/visavis/recording/lock.py", "fcntl"): "sys.platform; msvcrt on Windows",
    ("src/visavis/recording/durable.py", "shutil.chown"): "sys.platform; personal on Windows",
    ("src/visavis/running/sessions/simulation.py", "os.sched_getaffinity"): "platform; cpu_count",
}


def posix_calls(path):
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in OF_POSIX.get(node.value.id, ()):
                yield f"{node.value.id}.{node.attr}"
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield node.module


def test_every_call_of_posix_alone_is_listed_with_its_guard():
    found = {
        (name_in_repository(path), call) for path in product_files() for call in posix_calls(path)
    }

    assert set(GUARDED) == found


class FakeMsvcrt(types.ModuleType):
    """Windows' byte locks: exclusive, by place, held by whoever opened the file."""

    LK_NBLCK = 2

    def __init__(self):
        super().__init__("msvcrt")
        self.held = {}

    def locking(self, fd, mode, count):
        import os

        start = os.lseek(fd, 0, os.SEEK_CUR)
        places = range(start, start + count)
        if any(self.held.get(place, fd) != fd for place in places):
            raise OSError("locked")
        self.held |= dict.fromkeys(places, fd)


@pytest.fixture
def windows_lock(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "msvcrt", FakeMsvcrt())
    spec = importlib.util.spec_from_file_location("lock_of_windows", PACKAGE / "recording/lock.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.undo()
    return module._try_lock


def test_readers_on_windows_share_and_a_writer_is_alone(windows_lock, tmp_path):
    path = tmp_path / "lock"
    path.touch()
    with path.open("r+b") as one, path.open("r+b") as two, path.open("r+b") as writer:
        assert windows_lock(one.fileno(), is_shared=True)
        assert windows_lock(two.fileno(), is_shared=True)
        assert not windows_lock(writer.fileno(), is_shared=False)


def test_nobody_reads_what_is_written_on_windows(windows_lock, tmp_path):
    path = tmp_path / "lock"
    path.touch()
    with path.open("r+b") as writer, path.open("r+b") as reader:
        assert windows_lock(writer.fileno(), is_shared=False)
        assert not windows_lock(reader.fileno(), is_shared=True)
