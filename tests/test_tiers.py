from collections.abc import Callable, Generator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests import tiers
from tests.store import STORE
from tests.tiers import (
    COSTS,
    LIMIT_S,
    MARGIN,
    TICKS_HZ,
    CostCollector,
    Tiers,
    complaint,
    is_slow,
    is_there,
    living_s,
    read_costs,
    write_costs,
)


def test_costs_are_read_as_they_were_written_the_most_expensive_first() -> None:
    costs = {"tests/a.py::test_b[1 2-x]": 2.5, "tests/a.py::test_c": 0.1, "tests/a.py::test_d": 9.0}
    text = write_costs(costs)
    assert {"tests/a.py::test_b[1 2-x]": 2.5, "tests/a.py::test_d": 9.0} == read_costs(text)
    assert ["9.0", "2.5"] == [line.split()[0] for line in text.splitlines()[-2:]]


def test_a_test_of_more_than_two_seconds_belongs_to_the_second_tier() -> None:
    assert [False, True] == [is_slow(2.0), is_slow(2.1)]


def test_a_test_that_grew_out_of_the_first_tier_is_named_and_those_of_the_second_may_grow() -> None:
    limit_s = LIMIT_S * MARGIN
    assert "" == complaint(limit_s, is_marked_slow=False)
    assert f"{limit_s + 0.1:.1f} s" in complaint(limit_s + 0.1, is_marked_slow=False)
    assert "" == complaint(100.0, is_marked_slow=True)


def test_every_test_that_has_a_cost_is_there() -> None:
    assert [] == [test for test in read_costs(COSTS.read_text("utf-8")) if not is_there(test)]


def test_a_test_is_there_by_its_name_in_its_file(tmp_path: Path) -> None:
    (tmp_path / "test_a.py").write_text("def test_b() -> None: ...", "utf-8")
    names = (
        "test_a.py::test_b",
        "test_a.py::test_b[1-x]",
        "test_a.py::test_c",
        "test_d.py::test_b",
    )
    assert [True, True, False, False] == [is_there(name, tmp_path) for name in names]


def test_whatever_a_process_began_and_still_lives_is_counted_with_theirs_that_ended(
    tmp_path: Path,
) -> None:
    def ticks(process: int) -> list[int]:
        return [process * 10 + i for i in range(4)]  # its own, and of theirs that ended

    for process, parent in {10: 1, 11: 10, 12: 11, 13: 1}.items():
        (tmp_path / str(process)).mkdir()
        line = f"{process} (a) b) S {parent} {'0 ' * 9}{' '.join(map(str, ticks(process)))} 20 0\n"
        (tmp_path / str(process) / "stat").write_text(line, "utf-8")
    assert sum(ticks(11) + ticks(12)) / TICKS_HZ == living_s(10, folder=tmp_path)
    assert sum(ticks(12)) / TICKS_HZ == living_s(10, but=11, folder=tmp_path)
    assert 0 == living_s(12, folder=tmp_path) == living_s(10, folder=tmp_path / "nowhere")


def named(name: str) -> Any:
    return SimpleNamespace(nodeid=name, add_marker=lambda _: None)


def test_files_with_the_longest_tests_come_first_and_tests_of_a_file_stay_in_their_order() -> None:
    names = ["a.py::test_1", "b.py::test_2", "b.py::test_3", "c.py::test_4"]
    items = [named(name) for name in names]
    plugin = Tiers({"b.py::test_3": 30.0, "c.py::test_4": 9.0})
    plugin.pytest_collection_modifyitems(items)
    assert [names[i] for i in (1, 2, 3, 0)] == [item.nodeid for item in items]


def test_where_the_second_tier_alone_is_asked_for_only_files_that_hold_some_are_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tiers, "ROOT", tmp_path)
    texts = {"test_a.py": "", "test_b.py": "", "test_c.py": "@pytest.mark.slow", "conftest.py": ""}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, "utf-8")
    plugin = Tiers({"test_a.py::test_1": 30.0, "test_b.py::test_1": 1.0})

    def ignored(marks: str) -> list[str]:
        asked: Any = SimpleNamespace(option=SimpleNamespace(markexpr=marks))
        return [n for n in texts if plugin.pytest_ignore_collect(tmp_path / n, asked)]

    assert ["test_b.py"] == ignored("slow")
    assert [] == ignored("") == ignored("not slow")


class Clock:
    """The processor time that a test of tests says has passed."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(STORE, "saved_s", 0.0)
    return made


def finish(hook: Generator[None, Any, Any], result: Any) -> Any:
    """Return what a wrapper of pytest makes of a hook's result."""
    next(hook)
    with pytest.raises(StopIteration) as end:
        hook.send(result)
    return end.value.value


def item_of(name: str, fixtures: tuple[Any, ...] = (), *, is_slow: bool = False) -> Any:
    information = SimpleNamespace(name2fixturedefs={one.argname: (one,) for one in fixtures})
    return SimpleNamespace(
        nodeid=f"tests/test_a.py::{name}",
        get_closest_marker=lambda marker: object() if is_slow else None,
        _fixtureinfo=information,
    )


def run(
    plugin: Any, item: Any, steps: dict[str, Callable[[], None]], outcome: str = "passed"
) -> Any:
    """Let a plugin see a test whose phases do the steps; return the report of its end."""
    report: Any = None
    protocol = plugin.pytest_runtest_protocol(item)
    next(protocol)
    for phase in ("setup", "call", "teardown"):
        steps.get(phase, lambda: None)()
        whole = "passed" if phase != "call" else outcome
        report = SimpleNamespace(outcome=whole, passed=whole == "passed", longrepr="")
        call = SimpleNamespace(when=phase)
        report = finish(plugin.pytest_runtest_makereport(item, call), report)
    return report


def spend(clock: Clock, seconds: float) -> Callable[[], None]:
    def step() -> None:
        clock.now_s += seconds

    return step


def test_a_test_that_grew_fails_with_what_to_do_and_one_of_the_second_tier_does_not(
    clock: Clock,
) -> None:
    plugin = Tiers({}, processor_s=clock)
    limit_s = LIMIT_S * MARGIN
    failed = run(plugin, item_of("grown"), {"call": spend(clock, limit_s + 1)})
    assert "failed" == failed.outcome
    assert "--record-costs" in failed.longrepr
    slow = item_of("slow", is_slow=True)
    assert "passed" == run(plugin, slow, {"call": spend(clock, limit_s + 1)}).outcome
    assert "passed" == run(plugin, item_of("late"), {"call": spend(clock, LIMIT_S + 1)}).outcome
    assert ["tests/test_a.py::grown", "tests/test_a.py::late"] == list(plugin.grown)


def test_only_a_test_that_passed_is_measured(clock: Clock) -> None:
    plugin = Tiers({}, processor_s=clock)
    for outcome in ("failed", "skipped"):
        run(plugin, item_of(outcome), {"call": spend(clock, 9)}, outcome)
    run(plugin, item_of("whole"), {"call": spend(clock, 3), "teardown": spend(clock, 1)})
    assert {"tests/test_a.py::whole": 4.0} == plugin.measured


def test_what_lives_counts_for_the_test_that_it_worked_for_and_is_lost_by_none_as_it_ends(
    clock: Clock,
) -> None:
    plugin = Tiers({}, processor_s=clock)
    run(plugin, item_of("in_a_browser"), {"call": spend(clock, 4)})
    run(plugin, item_of("last"), {"call": spend(clock, 2), "teardown": spend(clock, -7)})
    assert [4.0, 2.0] == list(plugin.measured.values())


def test_a_fixture_that_tests_share_counts_for_each_of_them_and_what_the_store_saved_too(
    clock: Clock,
) -> None:
    plugin = Tiers({}, processor_s=clock)
    shared = SimpleNamespace(argname="recording", baseid="tests/test_a.py", scope="module")

    def set_up() -> None:
        hook = plugin.pytest_fixture_setup(shared, SimpleNamespace())
        next(hook)
        clock.now_s += 5
        with pytest.raises(StopIteration):
            hook.send("recorded")

    run(plugin, item_of("first", (shared,)), {"setup": set_up, "call": spend(clock, 1)})
    run(plugin, item_of("second", (shared,)), {"call": spend(clock, 2)})

    def copy() -> None:
        STORE.saved_s += 7

    run(plugin, item_of("third"), {"call": copy})
    assert [6.0, 7.0, 7.0] == list(plugin.measured.values())


def test_recorded_tests_of_the_second_tier_are_marked_before_others_are_left_out() -> None:
    marks: list[str] = []

    def item(name: str) -> Any:
        return SimpleNamespace(nodeid=name, add_marker=lambda mark: marks.append(name))

    Tiers({"b": 2.1, "c": 2.0}).pytest_collection_modifyitems([item(n) for n in "abc"])
    assert ["b"] == marks


def test_costs_of_all_workers_are_written_when_the_run_ends(tmp_path: Path) -> None:
    file, test = tmp_path / "costs.txt", "tests/test_tiers.py::clock"
    file.write_text(write_costs({test: 3.0, "tests/gone.py::test_gone": 4.0}))
    collector = CostCollector(Tiers({}), is_recording=True, file=file)
    worker = Tiers({})
    worker.measured = {"tests/test_tiers.py::finish": 2.5}
    output: dict[str, str] = {}
    session: Any = SimpleNamespace(config=SimpleNamespace(workeroutput=output))
    CostCollector(worker, is_recording=True, file=file).pytest_sessionfinish(session)
    collector.pytest_testnodedown(SimpleNamespace(workeroutput=output), None)
    collector.pytest_sessionfinish(SimpleNamespace(config=SimpleNamespace()))
    assert {test: 3.0, "tests/test_tiers.py::finish": 2.5} == read_costs(file.read_text())
