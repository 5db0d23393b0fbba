"""Commands that tests start in processes of their own, without importing everything each time.

A command takes two seconds of a processor to import what it needs. Here it is forked from a server
(tests/command_server.py) that has imported it already, one for each worker of the tests, and goes
on as a new process would. It is a new process where nothing can be forked (Windows), and where its
environment differs in variables that Python or a library reads as it starts. Tests of the start
itself, of imports and of empty caches start processes by `subprocess`.
"""

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, Final, Protocol, Self

ROOT: Final = Path(__file__).parents[1]
AT_START: Final = ("PYTHON", "NUMBA_", "LC_", "LANG", "TZ", "MPL", "OMP_", "OPENBLAS_", "MKL_")
"""Beginnings of variables that are read as Python starts or a library is imported."""
FREE: Final = ("PYTHONPATH", "PYTHONUNBUFFERED")
"""Those that a forked command obeys all the same."""


class RunningCommand(Protocol):
    """A process as `subprocess.Popen` shows it."""

    pid: int
    returncode: Any
    stdin: IO[str] | None
    stdout: IO[str] | None
    stderr: IO[str] | None

    def poll(self) -> int | None:
        """Return its exit code; None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait until it has ended; return its exit code."""

    def communicate(self, *, timeout: float | None = None) -> tuple[Any, Any]:
        """Read what it says until it has ended; return stdout and stderr."""

    def send_signal(self, sig: int, /) -> None:
        """Send it a signal."""

    def kill(self) -> None:
        """End it at once."""


class ForkedCommand:
    """A command that the server forked.

    Attributes are those of `subprocess.Popen`, with texts as streams.
    """

    def __init__(self, own: socket.socket, streams: Sequence[IO[str] | None], owner: "Commands"):
        self._own, self._owner = own, owner
        self.stdin, self.stdout, self.stderr = streams
        self.returncode: int | None = None
        self._readers: list[_Reader] = []
        message = b""
        while not message.endswith(b"\n"):
            more = own.recv(1)
            assert more, "the server of commands has ended"
            message += more
        self.pid = int(message)

    def poll(self) -> int | None:
        """Return its exit code; None while it runs."""
        return self._code_within(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Wait until it has ended; return its exit code.

        Raises:
            subprocess.TimeoutExpired: it runs after so many seconds.
        """
        code = self._code_within(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
        return code

    def communicate(self, *, timeout: float | None = None) -> tuple[str | None, str | None]:
        """Read what it says until it has ended; return stdout and stderr.

        Raises:
            subprocess.TimeoutExpired: as `wait`; what it says comes with the next call.
        """
        if not self._readers:
            self._readers = [_Reader(stream) for stream in (self.stdout, self.stderr)]
        if self.stdin is not None and not self.stdin.closed:
            self.stdin.close()
        self.wait(timeout)
        out, err = (reader.text() for reader in self._readers)
        return out, err

    def send_signal(self, sig: int, /) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, sig)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def _code_within(self, timeout_s: float | None) -> int | None:
        if self.returncode is None and select.select([self._own], [], [], timeout_s)[0]:
            with self._own:
                message = b"".join(iter(lambda: self._own.recv(4096), b""))
            assert message, "the server of commands has ended"
            end = json.loads(message)
            self.returncode = end["code"]
            self._owner.spent_s += end["s"]
        return self.returncode

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for stream in (self.stdin, self.stdout, self.stderr):
            if stream is not None:
                stream.close()
        self.wait()


class _Reader:
    """Reads a stream to its end beside everything else."""

    def __init__(self, stream: IO[str] | None) -> None:
        self._stream, self._text = stream, ""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        if self._stream is not None and not self._stream.closed:
            self._text = self._stream.read()
            self._stream.close()

    def text(self) -> str | None:
        """Wait for the end and return what was read; None without a stream."""
        self._thread.join()
        return None if self._stream is None else self._text


class Commands:
    """Starts commands, and owns the server that forks them."""

    def __init__(self) -> None:
        self.spent_s = 0.0
        """Processor time of forked commands that have ended, in seconds, which `os.times` lacks."""
        self._server: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._environment: dict[str, str] = {}

    @property
    def server_pid(self) -> int | None:
        """Which process forks them; None where none does yet."""
        return None if self._server is None else self._server.pid

    def start(
        self,
        *arguments: str,
        cwd: Path | None = None,
        env: Mapping[str, str] | None = None,
        stdin: int | None = None,
        stdout: int | None = None,
        stderr: int | None = None,
    ) -> RunningCommand:
        """Start what `python` with these arguments would: `-m MODULE …` or `-c PROGRAM …`, with
        `-u` before it or not. The rest is as for `subprocess.Popen`; streams are texts.
        """
        environment = dict(os.environ if env is None else env)
        if sys.platform == "win32" or not self._may_fork(environment):
            return subprocess.Popen(
                [sys.executable, *arguments],
                cwd=cwd,
                env=environment,
                text=True,
                stdin=stdin,
                stdout=stdout,
                stderr=stderr,
            )
        request = {
            "arguments": arguments,
            "cwd": os.fspath(cwd or Path.cwd()),
            "env": environment,
        }
        ours, theirs = socket.socketpair()
        with contextlib.ExitStack() as stack:
            stack.callback(theirs.close)
            streams, ends = zip(
                *(_stream(number, target, stack) for number, target in enumerate((stdin, stdout))),
                strict=True,
            )
            if stderr == subprocess.STDOUT:
                streams, ends = (*streams, None), (*ends, ends[1])
            else:
                last, end = _stream(2, stderr, stack)
                streams, ends = (*streams, last), (*ends, end)
            socket.send_fds(self._serving(), [b"1"], [*ends, theirs.fileno()])
        command = ForkedCommand(ours, streams, self)
        ours.sendall(json.dumps(request).encode() + b"\n")
        return command

    def run(
        self,
        *arguments: str,
        cwd: Path | None = None,
        env: Mapping[str, str] | None = None,
        timeout: float | None = None,
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end, as `subprocess.run` with what it says captured."""
        pipe = subprocess.PIPE
        process = self.start(
            *arguments, cwd=cwd, env=env, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe
        )
        try:
            out, err = process.communicate(timeout=timeout)
        finally:
            if process.poll() is None:
                process.kill()
                process.communicate()
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    def close(self) -> None:
        """End the server, whose time is no test's; what it forked goes on."""
        if self._server is not None and self._control is not None:
            before_s = _of_children_s()
            self._control.close()
            self._server.wait()
            self.spent_s -= _of_children_s() - before_s
        self._server = self._control = None

    def _may_fork(self, environment: Mapping[str, str]) -> bool:
        mine = self._environment if self._server is not None else os.environ
        return _at_start(environment) == _at_start(mine)

    def _serving(self) -> socket.socket:
        if self._control is None:
            ours, theirs = socket.socketpair()
            self._environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
            with theirs:
                self._server = subprocess.Popen(
                    [sys.executable, "-m", "tests.command_server", str(theirs.fileno())],
                    cwd=ROOT,
                    env=self._environment,
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                )
            self._control = ours
        return self._control


def _of_children_s() -> float:
    """Return the processor time of child processes that have ended, in seconds."""
    return sum(os.times()[2:4])


def _at_start(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables of an environment that only a new process obeys."""
    return {k: v for k, v in environment.items() if k.startswith(AT_START) and k not in FREE}


def _stream(
    number: int, target: int | None, stack: contextlib.ExitStack
) -> tuple[IO[str] | None, int]:
    """Return our end of a standard stream, if any, and the command's, which `stack` closes."""
    if target is None:
        return None, number
    if target == subprocess.DEVNULL:
        end = os.open(os.devnull, os.O_RDWR)
        stack.callback(os.close, end)
        return None, end
    if target != subprocess.PIPE:
        return None, target
    read, write = os.pipe()
    ours, theirs = (write, read) if number == 0 else (read, write)
    stack.callback(os.close, theirs)
    return open(ours, "w" if number == 0 else "r"), theirs


COMMANDS: Final = Commands()
"""Those of this process."""
