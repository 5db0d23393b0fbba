"""Simulated people before a screen answer with what a person there has: keys."""

import pytest

from visavis.lab.config import load_config
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

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


def test_people_before_a_screen_answer_questionnaires_by_keys_in_a_few_seconds(recording):
    shown = recording.events_named("panel_shown", 1)["t_ns"].to_numpy()
    answered = recording.events_named("panel_answered", 1)
    assert len(shown) == len(answered) > 0
    assert {payload["by"] for payload in answered["payload"]} == {"key"}
    assert (answered["t_ns"].to_numpy() - shown).max() < 5e9
