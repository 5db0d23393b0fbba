"""Processes are begun from anything that runs Python, as it stands: scripts need no guard."""

import subprocess
import sys
from pathlib import Path

import pytest

from visavis.lab.processes import main_unseen, needs_main
from visavis.running.sessions import runners

CODE = """
from visavis.running.sessions.runners import on_this_machine

print(sorted(on_this_machine(abs, [-1, -2], 2)))
"""


@pytest.mark.parametrize("way", ["script", "-c", "stdin", "-m"])
def test_jobs_are_done_in_processes_without_a_guard(tmp_path: Path, way: str) -> None:
    (tmp_path / "mine.py").write_text(CODE, "utf-8")
    arguments = {"script": ["mine.py"], "-c": ["-c", CODE], "stdin": ["-"], "-m": ["-m", "mine"]}
    done = subprocess.run(
        [sys.executable, *arguments[way]],
        cwd=tmp_path,
        input=CODE if way == "stdin" else None,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "[(0, 1), (1, 2)]\n" == done.stdout, done.stderr
    assert "" == done.stderr


STUDY = """
from dataclasses import dataclass

from visavis import Choice, Compare, Factor, Measure, Rating, Scene, Study


@dataclass(frozen=True)
class Own:
    seconds: float


def steadiness(record):
    return Own(record.number("t_end_ns") / 1e9).seconds


study = Study(
    "own",
    factors=[Factor({factor!r}, {levels!r})],
    measures=[Measure("steadiness", "s", "Steadiness", steadiness)],
    compare=[Compare({answer!r}, within={factor!r})],
    calibrate=False,
)


@study.trial
def trial(t):
    yield t.show(Scene("two_people"), seconds=0.2)
    yield t.ask({response})
"""
SCRIPT = """
import visavis

data = visavis.simulate({file!r}, 2, output="out", seed=2, parameters=dict(repetitions=1))
print(len(data.sessions), visavis.analyse(data).exists())
"""


@pytest.mark.parametrize(
    ("way", "file", "factor", "levels", "response"),
    [
        ("script", "my study.py", "größe", ["klein", "groß"], 'Rating("effort", 1, 9)'),
        ("-c", "multiprocessing_of_mine.py", "n_back", [0.5, 1.5, 2.0], 'Rating("effort", 0, 3)'),
        ("stdin", "a.py", "noise", ["off", "low"], 'Choice("effort", ["a", "b"], right="a")'),
    ],
    ids=["script", "command", "stdin"],
)
def test_any_study_is_simulated_and_analysed_from_anything_that_runs_python(
    tmp_path: Path, way: str, file: str, factor: str, levels: list[object], response: str
) -> None:
    study = STUDY.format(
        factor=factor,
        levels=levels,
        response=response,
        answer="effort_is_right" if "right" in response else "effort",
    )
    (tmp_path / file).write_text(study, "utf-8")
    script = SCRIPT.format(file=file)
    (tmp_path / "do it.py").write_text(script, "utf-8")
    arguments = {"script": ["do it.py"], "-c": ["-c", script], "stdin": ["-"]}
    done = subprocess.run(
        [sys.executable, *arguments[way]],
        cwd=tmp_path,
        input=script if way == "stdin" else None,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "2 True\n" == done.stdout, done.stderr
    assert "" == done.stderr


def test_main_module_is_as_it_was_after_processes_were_begun() -> None:
    main = sys.modules["__main__"]
    before = dict(vars(main))
    with main_unseen():
        assert None is vars(main).get("__file__")
    assert before == vars(main)
    vars(main)["_of_main"] = _OfMain
    try:
        assert needs_main(_OfMain)
    finally:
        del vars(main)["_of_main"]
    assert not needs_main(runners.on_this_machine, [Path("a")])


class _OfMain: ...


_OfMain.__module__, _OfMain.__qualname__ = "__main__", "_of_main"


def test_where_no_process_can_be_begun_jobs_are_done_here_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "executable", "")
    with pytest.warns(UserWarning, match="2 jobs are done one after another in this process"):
        assert [(0, 1), (1, 2)] == list(runners.on_this_machine(abs, [-1, -2], 2))
