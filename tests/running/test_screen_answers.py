"""Simulated people before a screen answer with what a person there has: keys."""

from dataclasses import replace

import pytest

from visavis.lab.config import load_config
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.people.person import StudyPerson
from visavis.protocol.session.operator import UnattendedOperator
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.panels import PanelFrame

READ = 'calibrate=False, instructions="read"'
RATED = """
from visavis import Choice, Compare, Factor, Rating, Scene, Study
study = Study("rated", "S", factors=[Factor("eyes", ["averted", "directed"])], calibrate=False,
    compare=[Compare("comfort", within="eyes")], questionnaires=["igroup_presence"])

@study.trial
def trial(t):
    yield t.dark(0.2)
    yield t.show(Scene("person", eyes=t.eyes), seconds=0.5)
    yield t.ask(Rating("comfort", 1, 9))
    yield t.ask(Choice("where", ["left", "right"]))
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("screen")
    (folder / "rated.py").write_text(RATED)
    study = find_study(str(folder / "rated.py"))
    config = load_config(SCREEN_EXAMPLE).model_copy(
        update={"data_root": folder / "data", "key_root": folder / "keys"}
    )
    request = simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)
    return Recording(perform_new(request))


def test_people_before_a_screen_answer_boards_by_keys_in_a_few_seconds(recording):
    trials = recording.trials()
    assert set(trials["comfort_by"]) == {"keys"}
    assert set(trials["where_by"]) == {"keys"}
    assert trials["comfort_ms"].max() < 5000


def boards(recording, name):
    """Return the events of boards of questions, and of those that are only read."""
    events = recording.events_named(name, 1)
    only_read = [p["question"] in ("instruction", "break") for p in events["payload"]]
    return events[[not r for r in only_read]], events[only_read]


def test_people_before_a_screen_answer_questionnaires_by_keys_in_a_few_seconds(recording):
    asked, _ = boards(recording, "panel_shown")
    answered, _ = boards(recording, "panel_answered")
    assert len(asked) == len(answered) > 0
    assert {payload["by"] for payload in answered["payload"]} == {"key"}
    assert (answered["t_ns"].to_numpy() - asked["t_ns"].to_numpy()).max() < 5e9


def test_instructions_stand_on_the_participants_screen(recording):
    _, read = boards(recording, "panel_shown")
    assert [p["prompt"] for p in read["payload"]] == [
        "Now the scenes that count. Say so whenever you want a break."
    ]


class Waiting(UnattendedOperator):
    """An operator who never goes on."""

    def waits_for_advance(self, prompt: str) -> bool:
        """Wait, whatever the prompt says."""
        return True


def test_participants_who_read_for_themselves_go_on_by_a_key(tmp_path, monkeypatch):
    (tmp_path / "rated.py").write_text(RATED.replace("calibrate=False", READ))
    study = find_study(str(tmp_path / "rated.py"))
    config = load_config(SCREEN_EXAMPLE).model_copy(
        update={"data_root": tmp_path / "data", "key_root": tmp_path / "keys"}
    )
    request = simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)
    # Simulated people do not read; a press of the space bar stands for somebody who has.
    see = StudyPerson.see

    def read_and_go_on(person, view, t_ns):
        if isinstance(view, PanelFrame) and view.panels and not view.panels[0].choices:
            assert view.panels[0].hint == "Space or enter goes on"
            if person.next_press_ns() is None:
                person._hand.press(t_ns + 10**9, "trigger")
        see(person, view, t_ns)

    monkeypatch.setattr(StudyPerson, "see", read_and_go_on)
    recording = Recording(perform_new(replace(request, operator=Waiting())))
    _, read = boards(recording, "panel_answered")
    assert {p["by"] for p in read["payload"]} == {"keys"}
