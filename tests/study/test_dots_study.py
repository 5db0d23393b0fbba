"""The ready study of moving dots: from a killed session, resumed, to its report."""

import runpy
from dataclasses import replace

import pandas as pd
import pytest

from tests.sessions import lab_in
from tests.study.simulated_study import simulate_and_analyse
from tests.study.test_staircase import _Stops
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.lab.errors import SessionAborted
from visavis.recording.reader import Recording
from visavis.results.flat_again import read_items_text
from visavis.results.opened_study import find_study
from visavis.running.new_study import READY
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import simulated_request
from visavis.study.quest_plus import posterior_after


def request_of(folder, operator=None):
    (folder / "dots.py").write_text((READY / "dots.py.txt").read_text("utf-8"), "utf-8")
    study = find_study(str(folder / "dots.py"))
    config = lab_in(folder, SCREEN_EXAMPLE)
    experiment = study.experiment({"repetitions": 5})
    request = simulated_request(study, experiment, config, label="S01", index=0, seed=1)
    return replace(request, operator=operator or request.operator)


def shown_dots(path):
    """Return the dots of each trial, of repeated ones the last."""
    events = Recording(path).events()
    payloads = events.loc[events["name"] == "shown", "payload"]
    texts = {p["trial_id"]: p["option_items"] for p in payloads if "Dots" in p["option_items"]}
    return {trial_id: read_items_text(text)[0] for trial_id, text in texts.items()}


def test_a_resumed_session_has_the_levels_of_its_rows_and_the_dots_of_an_unbroken_one(tmp_path):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    whole.mkdir()
    broken.mkdir()
    unbroken = perform_new(request_of(whole))
    with pytest.raises(SessionAborted):
        perform_new(request_of(broken, _Stops(900)))
    (path,) = (broken / "data").rglob("ses-001")
    assert 4 < len(Recording(path).trials()) < 18
    resumed = perform_rest(request_of(broken), path)
    rows = Recording(resumed).trials()
    rows = rows[rows["status"] == "complete"]
    assert 20 == len(rows)
    rule = runpy.run_path(str(broken / "dots.py"))["COHERENCE"]
    for _, own in rows.groupby("coherence_of"):
        answers = list(zip(own["coherence_level"], own["coherence_is_right"], strict=True))
        expected = [posterior_after(rule, answers[:n]).next_level for n in range(len(answers))]
        assert expected == own["coherence_level"].tolist()
    # Guesses differ after an interruption, so levels may, too; the seeds of dots do not.
    seeds, again = (
        {trial_id: dots.seed for trial_id, dots in shown_dots(path).items()}
        for path in (unbroken, resumed)
    )
    assert seeds == again
    assert 20 == len(set(seeds.values()))


def test_planted_thresholds_of_motion_are_found_in_their_order(tmp_path):
    text = (READY / "dots.py.txt").read_text("utf-8")
    folder = simulate_and_analyse(tmp_path / "dots.py", text, participants=2)
    means = pd.read_csv(folder / "derived" / "cell_means.csv")
    by_speed = means.groupby("speed")["coherence_threshold"].mean()
    assert by_speed[2] > by_speed[6]  # planted are 0.28 and 0.16
    assert by_speed[2] == pytest.approx(0.28, rel=0.4)
    assert by_speed[6] == pytest.approx(0.16, rel=0.4)
    assert list(folder.rglob("report.html"))
