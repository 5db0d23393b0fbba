"""Which body participants see as their own: asked once, by demand of the study, recorded."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.faults.sessions import lab
from visavis.cli.commands import session as commands
from visavis.experiments.crowd.study import look_down
from visavis.lab.clock import SimClock
from visavis.lab.errors import UsageError
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.people.own_body import read_own_body
from visavis.protocol.plan.steps import AskReply, Mark, NextFrame, Prompt
from visavis.results.opened_study import find_study
from visavis.running.sessions.session_request import Request, body_of, simulated_request
from visavis.study.dry_run import still_view


def request_of(
    study: str, folder: Path, index: int = 0, own: str = "none", **set_to: Any
) -> Request:
    opened = find_study(study)
    config = lab(folder)
    display = config.display.model_copy(update={"own_body": own})
    return simulated_request(
        opened,
        opened.experiment(set_to),
        config.model_copy(update={"display": display}),
        label=f"S{index + 1:02d}",
        index=index,
        seed=1,
    )


def test_crowd_gives_a_body_and_stare_none_unless_the_lab_gives_everybody_one(
    tmp_path: Path,
) -> None:
    assert ["female", "male"] == [body_of(request_of("crowd", tmp_path, i)) for i in (0, 1)]
    assert "none" == body_of(request_of("crowd", tmp_path, own_body=False))
    assert "none" == body_of(request_of("stare", tmp_path))
    assert "male" == body_of(request_of("stare", tmp_path, own="male"))
    request = request_of("crowd", tmp_path)
    assert "male" == body_of(replace(request, person=replace(request.person, body="male")))


@pytest.mark.parametrize(
    ("own_body", "asked"), [(True, ("embodiment", "presence")), (False, ("presence",))]
)
def test_questions_about_ones_body_are_asked_where_one_is_seen(
    own_body: bool, asked: tuple[str, ...]
) -> None:
    plan = find_study("crowd").experiment({"own_body": own_body}).plan(0, 1)
    assert [(), asked, asked, asked] == [block.questionnaires for block in plan.blocks]


class Terminal:
    """A study of a folder, its ledger, and somebody who answers at the terminal."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, answers: list[str]) -> None:
        self.asked: list[str] = []
        ledger = Ledger(folder / "crowd", SimClock())
        config = lab(folder)
        self.entry = ledger.add(consent_version="1", group="haptics")
        self.ledger = ledger
        self.here: Any = SimpleNamespace(
            study=find_study("crowd"), ledger=ledger, lab=config, is_simulated=False
        )
        monkeypatch.setattr(commands.sys.stdin, "isatty", lambda: True, raising=False)

        def said(prompt: str) -> str:
            self.asked.append(prompt)
            return answers.pop(0)

        monkeypatch.setattr(commands.console, "input", said)

    def run(self, given: str | None = None, **set_to: Any) -> Any:
        entry = self.ledger.resolve(self.entry.label)
        settings: Any = SimpleNamespace(parameters=set_to)
        commands.ask_body(self.here, settings, entry, given)
        return self.ledger.own_body(entry.label)


def test_body_and_stature_are_asked_once_and_kept_in_the_folder_of_the_person(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Terminal(tmp_path, monkeypatch, ["3", "2", "17", "1,74"])
    first = terminal.run()
    assert ("male", 1.74) == (first.body, first.stature_m)
    assert first == terminal.run()
    assert 4 == len(terminal.asked)
    assert first == read_own_body(tmp_path / "crowd" / f"sub-{terminal.entry.label}")
    assert "1.74" not in terminal.ledger.path.read_text("utf-8")


def test_body_that_is_given_is_not_asked_for_and_another_takes_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Terminal(tmp_path, monkeypatch, [])
    assert "female" == terminal.run("female").body
    assert "male" == terminal.run("male").body
    with pytest.raises(UsageError, match="female or male"):
        terminal.run("mle")


def test_nobody_is_asked_where_the_study_wants_no_body(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "" == Terminal(tmp_path, monkeypatch, []).run(own_body=False).body


def test_without_a_terminal_the_option_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Terminal(tmp_path, monkeypatch, [])
    monkeypatch.setattr(commands.sys.stdin, "isatty", lambda: False, raising=False)
    with pytest.raises(UsageError, match="add --body female or --body male"):
        terminal.run()


def test_looking_down_waits_for_the_operator_and_is_recorded() -> None:
    steps = look_down()
    assert isinstance(next(steps), Prompt)
    assert isinstance(steps.send(None), NextFrame)
    assert isinstance(steps.send(still_view()), NextFrame)
    assert Prompt("") == steps.send(still_view()._replace(went_on=True))
    assert Mark("own_body_seen") == steps.send(None)


def test_looking_down_takes_no_frame_where_nobody_watches() -> None:
    steps = look_down()
    next(steps)
    with pytest.raises(StopIteration):
        steps.send(AskReply(None, 0))
