"""Every choice has a result: how often each option was taken, by condition."""

from pathlib import Path

import pandas as pd
import pytest

from recording.folder import study_dir
from tests.visavis.sessions import opened, perform
from visavis.sessions.studies import analyse_study
from visavis.sessions.study_folder import settle, wanted_settings


@pytest.fixture(scope="module")
def derived(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chosen")
    settings_at = study_dir(folder, "greeting", is_simulated=True)
    wanted = wanted_settings(settings_at, opened("greeting"), is_simulated=True)
    settle(settings_at, wanted, seed_given=False)
    for index in range(3):
        perform("greeting", folder, index, practice=0)
    return analyse_study(study_dir(folder, "greeting", is_simulated=True), processes=1).parent


def test_a_choice_is_counted_by_condition(derived: Path) -> None:
    choices = pd.read_csv(derived / "choices.csv")
    trials = pd.read_csv(derived / "trials.csv")
    assert 6 == len(choices)
    for row in choices.itertuples():
        here = trials[trials["motion"] == row.motion]
        assert (here["do"] == row.option).sum() == row.times_chosen
        assert len(here) == row.answers
        assert 3 == row.people
        assert row.times_chosen / row.answers == pytest.approx(row.share_01)
        assert 0 <= row.share_low_01 <= row.share_01 <= row.share_high_01 <= 1


def test_the_report_says_what_was_chosen(derived: Path) -> None:
    report = (derived / "report.html").read_text("utf-8")
    assert "What was chosen" in report
    assert "how often each option was chosen" in report
