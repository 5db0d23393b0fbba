"""A run is compared with the last one on the same machine, row by row."""

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import all as every
from benchmarks.table import Row


def test_the_last_figure_of_each_row_on_the_same_machine_counts(tmp_path: Path) -> None:
    file = tmp_path / "runs"
    assert {} == every.last_run(file, "mine")
    file.write_text(
        '{"machine": "mine", "values": {"a": 1.0, "b": 2.0}}\n'
        '{"machine": "mine", "values": {"b": 3.0}}\n'
        '{"machine": "another", "values": {"a": 9.0}}\n',
        "utf-8",
    )
    assert {"a": 1.0, "b": 3.0} == every.last_run(file, "mine")


@pytest.fixture
def in_this_process(monkeypatch) -> None:
    class InThisProcess:
        def __init__(self, *_: object) -> None:
            self.result = lambda: None

        __enter__ = lambda self: self  # noqa: E731
        __exit__ = lambda self, *_: None  # noqa: E731

        def submit(self, work, group):
            self.result = lambda: work(group)
            return self

    monkeypatch.setattr(every, "ProcessPoolExecutor", InThisProcess)


def test_a_run_is_added_to_the_file_and_the_next_is_printed_beside_it(
    tmp_path: Path, monkeypatch, capsys, in_this_process
) -> None:
    figures = iter([4.0, 2.0])
    monkeypatch.setitem(every.GROUPS, "stage", lambda: [Row("a row", next(figures), "ms", 3.0)])
    runs = ["--only", "stage", "--compare", str(tmp_path / "runs")]
    assert 1 == every.main(runs)
    assert "before" not in capsys.readouterr().out
    assert 0 == every.main(runs)
    assert "before         4  better by 2.00" in capsys.readouterr().out


def test_a_goal_that_the_computer_cannot_reach_does_not_fail_the_run(
    monkeypatch, in_this_process
) -> None:
    beyond = Row("a row", 4.0, "ms", 1.0, floor=2.0, floor_name="the driver alone")
    monkeypatch.setitem(every.GROUPS, "stage", lambda: [beyond])
    assert 0 == every.main(["--only", "stage"])
    monkeypatch.setitem(every.GROUPS, "stage", lambda: [replace(beyond, floor=0.9)])
    assert 1 == every.main(["--only", "stage"])
