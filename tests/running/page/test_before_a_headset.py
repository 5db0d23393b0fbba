"""A study of pages goes through the same steps before a headset and on a screen."""

from dataclasses import replace
from pathlib import Path

import pandas as pd

from tests.running.page.pages import SEED, config, experiment, study
from visavis.lab.config import LabConfig
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request

ASKED = ("lively", "livelier", "effort")


def rows_on(on: str, made: LabConfig) -> pd.DataFrame:
    """Return the trials of a simulated session, performed there."""
    request = simulated_request(study(), experiment(), made, label="S01", index=0, seed=SEED)
    recording = Recording(perform_new(replace(request, on=on)))
    assert "complete" == recording.status
    return recording.trials()


def test_films_with_one_person_and_with_two_are_shown_before_a_headset_as_on_a_page(
    tmp_path: Path,
) -> None:
    page = rows_on("browser", config(tmp_path / "page"))
    lab = rows_on("lab", config(tmp_path / "lab"))
    assert list(page["trial_id"]) == list(lab["trial_id"])
    assert ["complete"] * len(page) == list(page["status"]) == list(lab["status"])
    for name in ASKED:
        assert list(page[name].notna()) == list(lab[name].notna()), name
    (session,) = tmp_path.glob("lab/simulated/films/sub-S01/ses-001")
    states = Recording(session).stream("scene_states")
    people = states.filter(like="eye_openness").notna().sum(axis=1)
    assert {0, 1, 2} == set(people)  # nobody, one film, two beside each other
