"""A simulated pilot session end to end, and the quick path beside it."""

import numpy as np
import pytest

from devices.registry import OPTION_MODELS
from experiments.waving.analysis import effects_of
from experiments.waving.design import WavingParameters
from experiments.waving.intake import take_in
from experiments.waving.measures import cell_means
from experiments.waving.quick_study import quick_session, quick_study
from lab.config import load_config
from lab.config_files import EXAMPLE
from recording.reader import Recording
from visavis.catalogue import find_study
from visavis.sessions.perform import perform_new, simulated_request

PILOT = {
    "clerks": 1,
    "increment": 0.0,
    "before_s": 0.3,
    "wave_s": 0.6,
    "after_s": 0.1,
    "intertrial_s": 0.1,
    "blocks": 1,
}
SEED = 3


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    config = load_config(EXAMPLE, OPTION_MODELS)
    config = config.model_copy(update={"data_root": tmp_path_factory.mktemp("waving")})
    study = find_study("waving")
    request = simulated_request(
        study, study.experiment(PILOT), config, label="S01B", index=0, seed=SEED
    )
    return Recording(perform_new(request))


@pytest.fixture(scope="module")
def intake(recording):
    return take_in(recording)


def test_every_trial_is_answered_by_pointing(intake):
    rows = intake.rows
    assert 2 + 18 == len(rows)
    assert (rows["status"] == "complete").all()
    assert {"ray"} == set(rows["who_by"]) == set(rows["realism_by"])
    assert rows["realism"].between(1, 9).all()


def test_an_answer_is_right_when_it_names_the_place_waved_at(intake):
    rows = intake.rows
    assert ((rows["who"] == rows["target_place"]) == rows["is_right"]).all()


def test_answers_take_the_time_people_take(intake):
    assert intake.rows["who_ms"].between(500, 8000).all()


def test_every_trial_records_its_wave_and_both_answers(recording):
    events = recording.events()
    assert 20 == (events["name"] == "wave").sum()
    assert 40 == (events["name"] == "answered").sum()


def test_questionnaires_are_asked_at_the_end(intake):
    assert {"age", "gender", "strategy", "comment"} <= set(intake.person)
    assert "eyes" in intake.person["strategy"].lower()


def test_the_quick_path_answers_as_a_session_does(intake):
    quick = {r["trial_id"]: r for r in quick_session(0, SEED, params=WavingParameters(**PILOT))}
    rows = intake.rows[~intake.rows["is_practice"].astype(bool)]
    same = [quick[r["trial_id"]]["who"] == r["who"] for r in rows.to_dict("records")]
    assert np.mean(same) >= 0.75
    gaps = [quick[r["trial_id"]]["realism"] - r["realism"] for r in rows.to_dict("records")]
    assert np.abs(gaps).max() <= 1


def test_people_who_do_not_attend_are_at_chance_with_both_techniques():
    table = quick_study(12, 5, effect=False, params=WavingParameters(**PILOT))
    means = cell_means(table)
    overall = table["is_right"].mean()
    assert 0.1 < overall < 0.45
    technique = next(e for e in effects_of(means, "accuracy").effects if e.name == "technique")
    assert technique.p_used > 0.01
