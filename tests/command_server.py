"""Forks the commands that tests start (tests/commands.py): what they import is imported once.

`python -m tests.command_server DESCRIPTOR`, of a socket through which requests come: a byte each,
with the descriptors of a command's stdin, stdout, stderr and of a socket of its own. There the
command says its process id and reads a line about what to run; there the server says how it ended.
The server imports and loads code, runs nothing, and ends with its socket.
"""

import gc
import importlib
import io
import json
import os
import runpy
import select
import signal
import socket
import sys
import tempfile
from types import FrameType, ModuleType
from typing import Any, Final

assert sys.platform != "win32", "nothing can be forked there"

MODULES: Final = (
    "matplotlib.figure",
    "scipy.optimize",
    "scipy.spatial.transform",
    "scipy.stats",
    "pyarrow.parquet",
    "visavis.analysis.session_check",
    "visavis.devices.drivers.pupil.wiring",
    "visavis.devices.sim.body.wiring",
    "visavis.results.figures.study_figures",
    "visavis.results.report.study_report",
    "visavis.running.page.seen_trial",
    "visavis.running.page.server",
    "visavis.running.scripts",
    "visavis.running.sessions.folder_check",
    "visavis.running.sessions.next_session",
    "visavis.running.sessions.perform",
    "visavis.running.sessions.studies",
    "visavis.stage.renderer",
)
"""What most commands import. Nothing that looks at a terminal as it is imported, so no command."""


def main() -> None:
    """Serve until the socket is closed; in a forked process run its command and return."""
    control = socket.socket(fileno=int(sys.argv[1]))
    # An interruption of a terminal's whole group is for the commands, in which it does what it did
    # in whoever began this: whatever runs behind a shell ignores it.
    on_interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN)
    _load()
    descriptors = _serve(control, on_interrupt)
    if descriptors is not None:
        _perform(descriptors)


def _load() -> None:
    for name in MODULES:
        importlib.import_module(name)
    from visavis.running.sessions.simulation import KERNEL_LIST, make_ready

    for line in KERNEL_LIST.read_text("utf-8").splitlines():
        if not line.startswith("#"):
            make_ready(line.split(" ", 3)[3])
    gc.collect()
    gc.freeze()  # so that no collection in a command copies what all share


def _serve(control: socket.socket, on_interrupt: Any) -> list[int] | None:
    """Fork a process for every request; return its descriptors there, nothing at the end here."""
    wake_reader, wake_writer = os.pipe()
    for end in (wake_reader, wake_writer):
        os.set_blocking(end, False)
    signal.set_wakeup_fd(wake_writer)
    signal.signal(signal.SIGCHLD, _wake)
    running: dict[int, socket.socket] = {}
    while True:
        ready, _, _ = select.select([control, wake_reader], [], [])
        if wake_reader in ready:
            os.read(wake_reader, 4096)
            _say_ends(running)
        if control not in ready:
            continue
        request, descriptors, _, _ = socket.recv_fds(control, 1, 4)
        if not request:
            return None
        pid = os.fork()
        if not pid:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            signal.signal(signal.SIGINT, on_interrupt)
            for other in (control, *running.values()):
                other.close()
            os.close(wake_reader)
            os.close(wake_writer)
            return descriptors
        for end in descriptors[:3]:
            os.close(end)
        running[pid] = socket.socket(fileno=descriptors[3])


def _wake(number: int, frame: FrameType | None) -> None:
    """Do nothing: with a handler, a child's end is written to the pipe."""


def _say_ends(running: dict[int, socket.socket]) -> None:
    """Say of every process that has ended how it did and what it took, children included."""
    while running:
        pid, status, usage = os.wait4(-1, os.WNOHANG)
        if not pid:
            return
        end = {"code": os.waitstatus_to_exitcode(status), "s": usage.ru_utime + usage.ru_stime}
        with running.pop(pid) as own:
            try:
                own.sendall(json.dumps(end).encode())
            except OSError:
                continue  # nobody waits for it


def _perform(descriptors: list[int]) -> None:
    """Run the command that the process's own socket tells of, as a new process would."""
    with socket.socket(fileno=descriptors[3]) as own, own.makefile("rb") as lines:
        own.sendall(f"{os.getpid()}\n".encode())
        what_to_run: dict[str, Any] = json.loads(lines.readline())
    for standard, end in enumerate(descriptors[:3]):
        os.dup2(end, standard)
        os.close(end)
    os.chdir(what_to_run["cwd"])
    os.environ.clear()
    os.environ.update(what_to_run["env"])
    tempfile.tempdir = None  # of its own environment
    sys.modules["numpy"].random.seed()
    arguments: list[str] = what_to_run["arguments"]
    sys.orig_argv[:] = [sys.executable, *arguments]
    is_unbuffered = arguments[0] == "-u" or bool(os.environ.get("PYTHONUNBUFFERED"))
    _open_streams(is_unbuffered=is_unbuffered)
    way, what, *words = arguments[1:] if arguments[0] == "-u" else arguments
    path = os.environ.get("PYTHONPATH", "")
    sys.path[:1] = [os.getcwd() if way == "-m" else "", *filter(None, path.split(os.pathsep))]
    for name in [one for one in sys.modules if one.partition(".")[0] == "tests"]:
        del sys.modules[name]
    importlib.invalidate_caches()
    sys.argv[:] = [way, *words]
    if way == "-m":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        module = ModuleType("__main__")
        sys.modules["__main__"] = module
        exec(compile(what, "<string>", "exec"), vars(module))  # noqa: S102 - as python -c does


def _open_streams(*, is_unbuffered: bool) -> None:
    """Open stdin, stdout and stderr as Python does at its start."""
    for standard, name in enumerate(("stdin", "stdout", "stderr")):
        before = getattr(sys, name)
        is_raw = is_unbuffered and before.mode == "w"
        file: Any = open(standard, f"{before.mode}b", 0 if is_raw else -1, closefd=False)
        (file if is_raw else file.raw).name = before.name
        is_by_line = not is_unbuffered and (name == "stderr" or file.isatty())
        stream = io.TextIOWrapper(
            file, before.encoding, before.errors, None, is_by_line, is_unbuffered
        )
        stream.mode = before.mode  # type: ignore[misc]
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


if __name__ == "__main__":
    main()
