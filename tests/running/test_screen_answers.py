"""Simulated people before a screen answer with what a person there has: keys."""

from dataclasses import replace

import numpy as np
import pytest

from tests.sessions import request_in
from visavis.lab.clock import SimClock
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.people.person import StudyPerson
from visavis.protocol.session.operator import UnattendedOperator
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.stage.contracts import GeometryStage
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
    request = request_in(folder, study, SCREEN_EXAMPLE)
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
    request = request_in(tmp_path, study, SCREEN_EXAMPLE)
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


class Preparing(GeometryStage):
    """A stage that needs so many frames for every scene that it foresees."""

    def __init__(self, viewers, frames):
        super().__init__(viewers, asks=True)
        self.frames, self.left = frames, frames
        self.boards, self.foreseen = [], []

    def foresee(self, coming):
        self.foreseen.append((len(self.boards), coming()))
        self.left = self.frames

    @property
    def is_preparing(self):
        return self.left > 0

    def draw(self, view, frame, head):
        self.left -= self.left > 0
        panels = view.panels if isinstance(view, PanelFrame) else ()
        self.boards.append(panels[0].text if panels else "")
        return super().draw(view, frame, head)


def performed_while_scenes_are_prepared(folder, frames, *, for_people=False):
    """Return the recording of a session, and the stage that prepared its scenes."""
    (folder / "rated.py").write_text(RATED)
    study = find_study(str(folder / "rated.py"))
    request = request_in(folder, study, SCREEN_EXAMPLE)
    made, clock = [], SimClock()

    def stage_for(viewers):
        # Devices are simulated on a virtual clock; the session acts as it does for people.
        clock.is_virtual = not for_people
        made.append(Preparing(viewers, frames))
        return made[-1]

    recording = Recording(perform_new(replace(request, stage_for=stage_for, clock=clock)))
    return recording, made[-1]


def test_people_who_wait_for_a_scene_read_that_it_comes(tmp_path):
    recording, stage = performed_while_scenes_are_prepared(tmp_path, frames=120)
    events = recording.events()
    shown, answered = (
        next(i for i, e in events.iterrows() if e["name"] == name and "coming" in str(e["payload"]))
        for name in ("panel_shown", "panel_answered")
    )
    first_trial = events.index[events["name"] == "trial_start"][0]
    assert shown < answered < first_trial
    words = "One moment: the next scene is coming."
    waited_s = (events["t_ns"][answered] - events["t_ns"][shown]) / 1e9
    assert stage.boards.count(words) == pytest.approx(60 * waited_s, abs=1)


def test_a_scene_that_is_ready_at_once_is_not_announced(tmp_path):
    recording, stage = performed_while_scenes_are_prepared(tmp_path, frames=20)
    assert "coming" not in {p["question"] for p in recording.events_named("panel_shown", 1).payload}
    assert not any("coming" in words for words in stage.boards)


def test_the_next_scene_is_prepared_while_a_question_stands(tmp_path):
    recording, stage = performed_while_scenes_are_prepared(tmp_path, frames=20, for_people=True)
    trials = recording.trials()
    assert len(stage.foreseen) == len(trials)
    (before, first), (asked, second) = stage.foreseen
    assert before == 0
    assert "comfort" in stage.boards[asked]
    assert not np.allclose(first.gaze_direction, second.gaze_direction)  # averted, directed
