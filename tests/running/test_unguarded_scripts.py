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
