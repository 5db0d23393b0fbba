"""What sessions call is compiled before them, once, by processes that share the work."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.sessions import STUDIES as STUDIES_OF_TESTS
from tools.kernel_list import STUDIES
from visavis.lab.compile_ahead import SIMULATING
from visavis.results.opened_study import find_study
from visavis.running.sessions import studies
from visavis.running.sessions.simulation import kernels_of
from visavis.running.sessions.studies import QuietNotifier, _do, _Work

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("study", STUDIES)
def test_sessions_call_nothing_that_the_list_lacks(study: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.running.kernel_list_child", study, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True)
    count, others = json.loads(done.stdout)
    assert count > 0
    assert [] == others, "write the list anew: python -m tools.kernel_list"


def test_a_study_of_a_labs_own_that_rests_on_gaze_calls_what_a_listed_one_does() -> None:
    stare, own = (
        find_study(name).experiment({}) for name in ("stare", str(STUDIES_OF_TESTS / "duel.py"))
    )
    assert kernels_of(stare, SIMULATING)
    assert own.rests_on_gaze
    assert kernels_of(stare, SIMULATING) == kernels_of(own, SIMULATING)
    listed = find_study("interpolation").experiment({})
    assert not listed.rests_on_gaze
    assert () == kernels_of(listed, SIMULATING)


class Heard(QuietNotifier):
    """Notes what is done, and how far it has come."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, int, int]] = []

    @contextmanager
    def progress(self, what: str) -> Iterator[Callable[[int, int], None]]:
        yield lambda count, total: self.lines.append((what, count, total))


def double(number: int) -> int:
    return 2 * number


def test_there_are_no_more_processes_than_sessions(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def run(_: object, jobs: list[Any], processes: int) -> Iterator[tuple[int, Any]]:
        asked.append(processes)
        return iter([(number, None) for number in range(len(jobs))])

    monkeypatch.setattr(studies, "on_this_machine", run)
    _do(_Work(double, (1, 2), ("a.b:c()",) * 20, "doubling"), 64, None, QuietNotifier())
    assert [2] == asked


@pytest.mark.parametrize(
    ("processes", "numbers", "before"),
    [(2, (1, 2, 3), True), (1, (1, 2, 3), False), (2, (1,), False)],
)
def test_processes_that_share_the_work_get_its_kernels_ready_first(
    processes: int, numbers: tuple[int, ...], before: bool
) -> None:
    kernels = ("visavis.analysis.gaze.stamps:_is_increasing(int64[1])", "gone.since:then()")
    heard = Heard()
    work = _Work(double, numbers, kernels, "doubling")
    assert [2 * one for one in numbers] == _do(work, processes, None, heard)
    last = len(numbers)
    ready = [line for line in heard.lines if line[0] == "getting numeric code ready"]
    assert ([("getting numeric code ready", i, 2) for i in range(3)] if before else []) == ready
    assert ("doubling", last, last) == heard.lines[-1]
    assert {"doubling"} == {name for name, _, _ in heard.lines[len(ready) :]}
