"""Two tiers of tests, chosen by what each was measured to take of a processor.

A test that took more than `LIMIT_S` is marked `slow`: `pytest -m "not slow"` runs the first tier,
`pytest -m slow` the second, `pytest` both. What tests took stands in `tests/costs.txt`;
`pytest --record-costs` measures the tests that it runs and writes their lines anew.

A test's cost is its own processor time and that of processes that it began or that work for it, as
a module's browser (where there is /proc: on Linux), and with it that of every
fixture it uses: one that a module shares counts in full for each of the module's tests, because any
of them may be the first that needs it; so does recording a session that came from the store
(`tests.store`). Compiling kernels does not count: that is done once for all.
"""

import json
import os
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import pytest

from tests.commands import COMMANDS
from tests.store import STORE

LIMIT_S: Final = 2.0
MARGIN: Final = 10.0
"""How many times the limit a test may take before it fails: another computer may be slower, and the
first test of a process that needs a thing makes it for all others (films, plans, compiled code)."""
LISTED_S: Final = 0.5
"""Tests that take less have no line of their own."""
ROOT: Final = Path(__file__).parents[1]
COSTS: Final = ROOT / "tests" / "costs.txt"
PROCESSES: Final = Path("/proc")
TICKS_HZ: Final = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100
RECORD: Final = "--record-costs"
MARKED: Final = "mark.slow"
"""What stands in files whose tests were put into the second tier by hand."""


def read_costs(text: str) -> dict[str, float]:
    """Return the seconds of each test in a file of costs; `#` begins a comment."""
    lines = (line.partition(" ") for line in text.splitlines() if not line.startswith("#"))
    return {test: float(seconds) for seconds, _, test in lines}


def write_costs(costs: Mapping[str, float]) -> str:
    """Return the text of a file of costs: a line for each test, the most expensive first."""
    head = (
        "# CPU seconds of tests, fixtures and child processes included, compiling excluded.\n"
        f'# Written by `pytest {RECORD}`; more than {LIMIT_S:g} s: second tier ("slow").\n'
    )
    listed = sorted((-round(cost, 1), test) for test, cost in costs.items() if cost >= LISTED_S)
    return head + "".join(f"{-cost:.1f} {test}\n" for cost, test in listed)


def is_there(test: str, root: Path = ROOT) -> bool:
    """Return whether a test's file has a function of its name."""
    name, _, rest = test.partition("::")
    file, function = root / name, rest.partition("[")[0].rpartition("::")[2]
    return file.exists() and f"def {function}(" in file.read_text("utf-8")


def file_of(test: str) -> str:
    """Return the file of a test, relative to `ROOT`."""
    return test.partition("::")[0]


def is_slow(cost_s: float) -> bool:
    """Return whether a test of this cost belongs to the second tier."""
    return cost_s > LIMIT_S


def complaint(cost_s: float, is_marked_slow: bool) -> str:
    """Return what is wrong with a test that has grown out of the first tier; nothing: empty."""
    if is_marked_slow or cost_s <= LIMIT_S * MARGIN:
        return ""
    return (
        f"this test took {cost_s:.1f} s of a processor; tests of the first tier take up to "
        f"{LIMIT_S:g} s. Make it cheaper, or measure it with `pytest {RECORD}`, which moves it to "
        "the second"
    )


def _processor_s() -> float:
    """Return the processor time of this process, of its children and of commands that ended."""
    return sum(os.times()[:4]) + COMMANDS.spent_s


def _with_living_s() -> float:
    """Return the same with what lives on, as a browser; what begins commands is no test's."""
    return _processor_s() + living_s(os.getpid(), COMMANDS.server_pid)


def living_s(process: int, but: int | None = None, folder: Path = PROCESSES) -> float:
    """Return the processor time of all that a process began and that has not ended, in seconds.

    What theirs took that ended is counted with them; of `but`, only what it began and still lives.
    Without a `folder` of processes it is 0.
    """
    took, began = dict[int, int](), defaultdict[int, list[int]](list)
    for file in folder.glob("[0-9]*/stat"):
        try:
            fields = file.read_text("utf-8", "replace").rpartition(")")[2].split()
        except OSError:  # it ended meanwhile
            continue
        took[int(file.parent.name)] = sum(map(int, fields[11:15]))
        began[int(fields[1])].append(int(file.parent.name))
    descendants = list(began[process])
    for one in descendants:
        descendants += began[one]
    return sum(took[one] for one in descendants if one != but) / TICKS_HZ


class _Compiling:
    """Counts the seconds spent compiling kernels, nested ones once."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._begins: list[float] = []

    def on_start(self, event: object) -> None:
        """Begin to count."""
        self._begins.append(_processor_s())

    def on_end(self, event: object) -> None:
        """Count what the outermost compilation took."""
        begin = self._begins.pop()
        if not self._begins:
            self.seconds += _processor_s() - begin


def _listen_to_compiling() -> _Compiling:
    from numba.core.event import Listener, register

    counter = _Compiling()

    class Ear(Listener):
        """Passes on what the compiler reports."""

        on_start = staticmethod(counter.on_start)
        on_end = staticmethod(counter.on_end)

    register("numba:compile", Ear())
    return counter


class Tiers:
    """A plugin of pytest: marks the second tier, and measures every test of this process."""

    def __init__(
        self,
        costs: Mapping[str, float],
        *,
        is_strict: bool = True,
        processor_s: Callable[[], float] = _processor_s,
    ) -> None:
        self._costs, self._processor_s = costs, processor_s
        self._longest_s: dict[str, float] = {}
        for test, cost_s in costs.items():
            file = file_of(test)
            self._longest_s[file] = max(cost_s, self._longest_s.get(file, 0.0))
        self._is_strict = is_strict
        self._compiling = _listen_to_compiling()
        self._fixture_s: dict[tuple[str, str], float] = {}
        self._start_s = self._latest_s = self._lost_s = 0.0
        self._is_whole = True
        self._shared_s = 0.0
        self.measured: dict[str, float] = {}
        self.grown: dict[str, float] = {}
        """Tests of the first tier that took more than its limit, in seconds."""

    def computed_s(self) -> float:
        """Return the processor time of this process and its children, compiling apart."""
        now_s = self._processor_s() + self._lost_s
        self._lost_s += max(0.0, self._latest_s - now_s)  # of those that nobody waited for
        self._latest_s = max(self._latest_s, now_s)
        return self._latest_s - self._compiling.seconds

    def _now_s(self) -> float:
        # Another order of tests, or another test left out, and this one would have recorded it.
        return self.computed_s() + STORE.saved_s

    def pytest_ignore_collect(self, collection_path: Path, config: pytest.Config) -> bool | None:
        """Do not import files without a test of the second tier where that alone is asked for."""
        if config.option.markexpr != "slow" or not collection_path.name.startswith("test_"):
            return None
        file = collection_path.relative_to(ROOT).as_posix()
        if is_slow(self._longest_s.get(file, 0.0)) or MARKED in collection_path.read_text("utf-8"):
            return None
        return True

    @pytest.hookimpl(tryfirst=True)  # before pytest deselects by marks
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Mark what belongs to the second tier; put files with the longest tests first."""
        for item in items:
            if is_slow(self._costs.get(item.nodeid, 0.0)):
                item.add_marker(pytest.mark.slow)
        items.sort(key=lambda item: -self._longest_s.get(file_of(item.nodeid), 0.0))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: Any, request: pytest.FixtureRequest
    ) -> Generator[None, Any, Any]:
        """Measure a fixture that tests share."""
        begin_s, inner_s = self._now_s(), self._shared_s
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                # What another shared fixture took meanwhile is counted there.
                own_s = self._now_s() - begin_s - (self._shared_s - inner_s)
                self._fixture_s[fixturedef.argname, fixturedef.baseid] = own_s
                self._shared_s += own_s

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Begin to measure a test."""
        self._start_s, self._shared_s, self._is_whole = self._now_s(), 0.0, True
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """End to measure it; fail a test of the first tier that has grown."""
        report = yield
        self._is_whole &= report.passed
        now_s = self._now_s()
        if call.when == "teardown" and self._is_whole:  # else its cost is not known
            own_s = now_s - self._start_s - self._shared_s
            cost_s = own_s + sum(map(self._shared_cost, _fixtures(item)))
            self.measured[item.nodeid] = round(cost_s, 2)
            is_marked_slow = item.get_closest_marker("slow") is not None
            if is_slow(cost_s) and not is_marked_slow and self._is_strict:
                self.grown[item.nodeid] = round(cost_s, 1)
            wrong = complaint(cost_s, is_marked_slow)
            if wrong and self._is_strict:
                report.outcome, report.longrepr = "failed", wrong
        return report

    def _shared_cost(self, fixture: tuple[str, str]) -> float:
        return self._fixture_s.get(fixture, 0.0)


def _fixtures(item: pytest.Item) -> Iterable[tuple[str, str]]:
    """Yield the fixtures that a test uses, also those that ask for one another."""
    information: Any = getattr(item, "_fixtureinfo", None)
    definitions = information.name2fixturedefs if information else {}
    return {(each.argname, each.baseid) for one in definitions.values() for each in one}


class CostCollector:
    """A plugin of pytest: brings together what all workers measured, and tells when the run ends.

    It names tests that took more than the first tier allows and, if asked for, writes the file.
    """

    def __init__(self, tiers: Tiers, *, is_recording: bool, file: Path = COSTS) -> None:
        self._tiers, self._is_recording, self._file = tiers, is_recording, file

    @pytest.hookimpl(optionalhook=True)  # of pytest-xdist
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """Take what a worker measured."""
        measured, grown = json.loads(getattr(node, "workeroutput", {}).get("costs", "[{}, {}]"))
        self._tiers.measured |= measured
        self._tiers.grown |= grown

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the file; a worker hands its costs on instead."""
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output["costs"] = json.dumps([self._tiers.measured, self._tiers.grown])
        elif self._is_recording:
            former = read_costs(self._file.read_text("utf-8"))
            before = {test: cost for test, cost in former.items() if is_there(test)}
            self._file.write_text(write_costs({**before, **self._tiers.measured}), "utf-8")

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Name the tests that took more than the first tier allows."""
        for test, cost_s in sorted(self._tiers.grown.items()):
            terminalreporter.write_line(
                f"{test} took {cost_s:g} s of a processor, more than {LIMIT_S:g}: {RECORD}?"
            )


def install(config: pytest.Config) -> None:
    """Register both plugins with pytest."""
    is_recording = config.getoption(RECORD)
    tiers = Tiers(
        read_costs(COSTS.read_text("utf-8")),
        is_strict=not is_recording,
        processor_s=_with_living_s if is_recording else _processor_s,
    )
    STORE.processor_s = tiers.computed_s
    collector = CostCollector(tiers, is_recording=is_recording)
    config.pluginmanager.register(tiers, "visavis-tiers")
    config.pluginmanager.register(collector, "visavis-costs")
