"""Settings for all tests, and the browser that some of them look at pages with."""

import gc
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from platformdirs import user_cache_path

from tests import tiers
from tests.commands import COMMANDS
from tests.store import STORE
from visavis.lab.garbage import NEW_OBJECTS

# Tests give processes of their own another cache folder; kernels need not be compiled again for it.
os.environ.setdefault(
    "NUMBA_CACHE_DIR", str(user_cache_path("visavis", appauthor=False) / "kernels" / "tests")
)

# Importing tests makes many objects and keeps them; nobody looks at a session of theirs.
gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])

# A landing must not depend on the luck of a draw; a developer's own run goes on exploring. Nor may
# any test depend on how busy the machine is.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("exploring", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "exploring")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that measures tests."""
    parser.addoption(tiers.RECORD, action="store_true", help="measure tests: tests/costs.txt")


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_configure_node(node: Any) -> None:
    """Where no machine code is kept yet, let each worker compile its share before any test."""
    node.workerinput["compiles"] = not Path(os.environ["NUMBA_CACHE_DIR"]).exists()


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile this worker's share of what sessions call; otherwise each would compile all of it."""
    about: dict[str, Any] = getattr(session.config, "workerinput", {})
    if about.get("compiles"):
        # late: it loads the engine, which most runs of a few tests need not
        from visavis.running.sessions.simulation import KERNEL_LIST, make_ready

        lines = [one for one in KERNEL_LIST.read_text("utf-8").splitlines() if one[:1] != "#"]
        number = int(about["workerid"].removeprefix("gw"))
        for line in lines[number :: about["workercount"]]:
            make_ready(line.split(" ", 3)[3])


def pytest_configure(config: pytest.Config) -> None:
    """Let costs choose the tier of each test, and whatever tests begin be interrupted.

    A run in the background of a shell ignores interruptions, and so would every process that it
    begins.
    """
    tiers.install(config)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Let no search for garbage go through what all tests have imported: it is none."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def shared_sessions(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Let all workers of this run store sessions in one folder."""
    base = tmp_path_factory.getbasetemp()
    is_worker = hasattr(request.config, "workerinput")
    STORE.folder = (base.parent if is_worker else base) / "sessions"


@pytest.fixture(scope="session", autouse=True)
def server_of_commands() -> Iterator[None]:
    """End the process that forks commands, where a test has needed it."""
    yield
    COMMANDS.close()


@pytest.fixture
def nobody_cast(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Nobody has been cast in this process yet."""
    from visavis.stimuli.dressing import audience, casting, gathering

    monkeypatch.setattr(casting, "_in_force", casting._InForce())
    functions = [
        function
        for module in (audience, casting, gathering)
        for function in vars(module).values()
        if hasattr(function, "cache_clear") and function.__module__ == module.__name__
    ]
    for function in functions:
        function.cache_clear()
    yield
    for function in functions:  # a process has one cast, so that they ask for names alone
        function.cache_clear()


@pytest.fixture(scope="module")
def playwright() -> Iterator[Any]:
    """What drives browsers for a module's tests: a thread can have one of them at a time."""
    interface = pytest.importorskip("playwright.sync_api")
    with interface.sync_playwright() as started:
        yield started


@pytest.fixture(scope="session")
def chromium_program() -> str:
    """Where Chromium is; the test is skipped where there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("there is no chromium; apt install chromium")
    return program


@pytest.fixture(scope="module")
def chromium(playwright: Any, chromium_program: str) -> Iterator[Any]:
    """A browser without a window, which a module's tests share: it takes seconds to begin."""
    opened = playwright.chromium.launch(executable_path=chromium_program, args=["--no-sandbox"])
    yield opened
    opened.close()


@pytest.fixture
def browser(chromium: Any) -> Iterator[Any]:
    """The module's browser with nothing open; the test is skipped where there is none."""
    yield chromium
    for context in chromium.contexts:
        context.close()


def _firefox(folder: Path, *, draws: bool) -> Iterator[Any]:
    pytest.importorskip("websockets")
    from tests.firefox import firefox, program

    if program() is None:
        pytest.skip("there is no Firefox; apt install firefox-esr")
    if draws and shutil.which("xvfb-run") is None:
        pytest.skip("there is no screen for Firefox; apt install xvfb")
    profile = folder / "firefox"
    profile.mkdir()
    with firefox(profile, draws=draws) as window:
        yield window


@pytest.fixture
def other_browser(tmp_path: Path) -> Iterator[Any]:
    """Debian's Firefox without a window (tests.firefox); skipped where there is none."""
    yield from _firefox(tmp_path, draws=False)


@pytest.fixture
def other_drawing_browser(tmp_path: Path) -> Iterator[Any]:
    """The same, which draws in three dimensions."""
    yield from _firefox(tmp_path, draws=True)
