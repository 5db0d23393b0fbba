"""Quiet frames of a simulated session are passed without asking the plan, and recorded the same."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.faults.sessions import lab, request
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.operator import UnattendedOperator
from visavis.protocol.session.operator_desk import OperatorDesk
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import Request, simulated_request

STUDY = """
from visavis import Factor, Keys, Scene, Study

study = Study("waits", factors=[Factor("eyes", ["directed", "averted"])])


@study.trial
def trial(t):
    yield t.dark(0.5)
    yield t.show(Scene("two_people", eyes=t.eyes), seconds=1.5)
    yield t.ask(Keys("choice", limit_s=2.0))
    yield t.wait(0.5)
"""


class Watching(UnattendedOperator):
    """Asks for nothing, but might at every frame."""


def stare(folder: Path) -> Request:
    return request(lab(folder))


def waits(folder: Path) -> Request:
    path = folder.with_name("waits.py")
    path.write_text(STUDY, encoding="utf-8")
    study = find_study(str(path))
    return simulated_request(study, study.experiment({}), lab(folder), label="S01", index=0, seed=1)


@pytest.mark.parametrize("make", [stare, waits])
def test_passed_frames_are_recorded_as_frames_that_the_plan_was_asked_about(
    make: Callable[[Path], Request], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = []
    next_frame = FrameLoop.next

    def counted(self: FrameLoop, *args: Any) -> Any:
        steps.append(1)
        return next_frame(self, *args)

    monkeypatch.setattr(FrameLoop, "next", counted)

    def recorded(name: str, operator: UnattendedOperator) -> tuple[int, Mapping[str, bytes]]:
        (tmp_path / name).mkdir()
        steps.clear()
        folder = perform_new(replace(make(tmp_path / name / "data"), operator=operator))
        files = {
            str(file.relative_to(folder)): file.read_bytes()
            for file in sorted(folder.rglob("*"))
            if file.is_file()
        }
        return len(steps), files

    asked_often, expected = recorded("watched", Watching())
    asked, passed = recorded("unattended", UnattendedOperator())
    # where something may be found, each frame in which faults are looked for comes back
    monkeypatch.setattr(OperatorDesk, "is_calm", lambda _: False)
    asked_uneasily, uneasy = recorded("uneasy", UnattendedOperator())

    for files in (passed, uneasy):
        assert files.keys() == expected.keys()
        assert [name for name in expected if files[name] != expected[name]] == []
    assert asked < asked_uneasily / 2 < asked_often / 4
