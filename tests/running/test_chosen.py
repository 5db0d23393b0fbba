"""Every choice has a result: how often each option was taken, by condition."""

from pathlib import Path

import pandas as pd
import pytest

from tests.sessions import opened, perform
from visavis.lab.errors import DesignError
from visavis.recording.folder import study_dir
from visavis.running.sessions.studies import analyse_study
from visavis.running.sessions.study_folder import settle, wanted_settings
from visavis.study.responses import Choice


@pytest.fixture(scope="module")
def derived(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chosen")
    settings_at = study_dir(folder, "greeting", is_simulated=True)
    wanted = wanted_settings(settings_at, opened("greeting"), is_simulated=True)
    settle(settings_at, wanted, seed_given=False)
    for index in range(3):
        perform("greeting", folder, index)
    return analyse_study(study_dir(folder, "greeting", is_simulated=True), processes=1).parent


def test_a_choice_is_counted_by_condition(derived: Path) -> None:
    choices = pd.read_csv(derived / "choices.csv")
    trials = pd.read_csv(derived / "trials.csv")
    trials = trials[~trials["is_practice"]]
    assert 12 == len(choices)
    for row in choices.itertuples():
        here = trials[(trials["motion"] == row.motion) & (trials["distance_m"] == row.distance_m)]
        assert (here["do"] == row.option).sum() == row.times_chosen
        assert len(here) == row.answers
        assert 3 == row.people
        assert row.times_chosen / row.answers == pytest.approx(row.share_01)
        assert 0 <= row.share_low_01 <= row.share_01 <= row.share_high_01 <= 1


def test_the_report_says_what_was_chosen(derived: Path) -> None:
    report = (derived / "report.html").read_text("utf-8")
    assert "What was chosen" in report
    assert "how often each option was chosen" in report
    assert "Motion, distance in m" in report


def test_the_methods_say_what_was_shown_and_asked_and_why_trials_went(derived: Path) -> None:
    report = (derived / "report.html").read_text("utf-8")
    assert (
        "Trials showed the scene person (motion: idle or wave; distance in m: 1.5 or 3.0)" in report
    )
    assert "(approachable: a rating from 1 to 7)" in report
    assert "(do: greet, wait, leave)" in report
    assert "distance in m (1.5, 3.0; within participants)" in report
    assert "below 200, answered too fast to have read the question" in report
    assert "The aligned rank transform was taken as the test over several factors" in report


@pytest.fixture(scope="module")
def swapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swapped")
    settings_at = study_dir(folder, "swapped", is_simulated=True)
    wanted = wanted_settings(settings_at, opened("swapped"), is_simulated=True)
    settle(settings_at, wanted, seed_given=False)
    for index in range(2):
        perform("swapped", folder, index)
    return analyse_study(study_dir(folder, "swapped", is_simulated=True), processes=1).parent


def test_where_trials_swap_sides_what_an_option_meant_is_counted(swapped: Path) -> None:
    trials = pd.read_csv(swapped / "trials.csv")
    assert {"left"} == set(trials["livelier"])  # always the left one, whoever that was
    is_left = trials["waver_side"] == "left"
    assert is_left.map({True: "waver", False: "other"}).equals(trials["livelier_means"])
    assert is_left.map({True: "me", False: "them"}).equals(trials["who_means"])
    choices = pd.read_csv(swapped / "choices.csv").groupby(["asked", "option"]).sum()
    assert {"waver": 4, "other": 4} == choices.loc["livelier", "times_chosen"].to_dict()
    assert {"me": 4, "them": 4} == choices.loc["who", "times_chosen"].to_dict()


def test_a_choice_with_fewer_meanings_than_options_is_refused() -> None:
    with pytest.raises(DesignError, match="2 options and 1 meanings"):
        Choice("who", ["a", "b"], means=["me"])
