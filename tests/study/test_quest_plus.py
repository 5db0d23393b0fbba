"""QUEST+: its rule, planted functions that it finds again, and its state from rows."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.study.simulated_study import simulate_and_analyse
from tests.study.test_staircase import _Stops, request_of
from visavis.lab.errors import DesignError, SessionAborted
from visavis.recording.reader import Recording
from visavis.running.new_study import READY
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.study.measures import aggregate_cells, staircase_measures
from visavis.study.quest_plus import (
    QuestPlus,
    QuestPlusTrial,
    columns_of_quest,
    posterior_after,
    share_right,
)

RULE = QuestPlus(
    "q",
    levels=np.geomspace(0.005, 0.5, 21),
    thresholds=np.geomspace(0.01, 0.3, 25),
    slopes=(2, 3, 4, 5),
)


def trials(rule, count, seed, threshold=0.05, slope=3.0, of=""):
    """Return the rows of a simulated person's trials, each made from the rows before."""
    rng, rows = np.random.default_rng(seed), []
    for number in range(count):
        row = {}
        trial = QuestPlusTrial(rule, of, rows, row)
        trial.take(bool(rng.random() < share_right(trial.level, threshold, slope, 0.5, 0.02)))
        rows.append({"participant": "01B", "number": number, **row})
    return rows


def test_half_the_way_and_its_ends_are_those_of_the_function():
    rises = share_right([1e-9, 0.1, 10], 0.1, 3, 0.5, 0.02)
    assert [0.5, 0.5 + 0.48 * (1 - np.exp(-1)), 0.98] == pytest.approx(rises.tolist())
    assert 0.5 == pytest.approx(float(share_right(3, 3, 1, 0, 0, "normal")))


def test_the_next_level_leaves_the_least_expected_entropy():
    """By the definition, cell by cell, for a rule small enough to write out."""
    rule = QuestPlus("q", levels=(1, 2, 4), thresholds=(1, 3), slopes=(2,), lapses=(0.02,))
    posterior = posterior_after(rule, [(2.0, True), (1.0, False)])
    prior = posterior.probability.ravel()
    expected = []
    for level in rule.levels:
        right = [float(share_right(level, t, 2, 0.5, 0.02)) for t in rule.thresholds]
        total = 0.0
        for likelihood in (right, [1 - r for r in right]):
            joint = [p * q for p, q in zip(prior, likelihood, strict=True)]
            after = [j / sum(joint) for j in joint]
            total -= sum(joint) * sum(a * np.log(a) for a in after)
        expected.append(total)
    assert expected == pytest.approx(posterior.entropies.tolist(), abs=1e-12)
    assert rule.levels[int(np.argmin(expected))] == posterior.next_level


@pytest.mark.parametrize("threshold", [0.03, 0.12])
def test_a_planted_threshold_is_found_again_within_a_twentieth_in_sixty_trials(threshold):
    found = [trials(RULE, 60, seed, threshold)[-1]["q_threshold"] for seed in range(40)]
    assert threshold == pytest.approx(np.exp(np.mean(np.log(found))), rel=0.05)


def test_intervals_hold_the_planted_threshold_about_as_often_as_they_say():
    last = [trials(RULE, 40, seed)[-1] for seed in range(60)]
    inside = [r["q_threshold_low"] <= 0.05 <= r["q_threshold_high"] for r in last]
    assert 0.88 <= np.mean(inside) <= 1.0


def test_the_state_is_the_rows_so_that_a_resumed_session_goes_on_at_the_same_level():
    whole = trials(RULE, 12, 1)
    again = {}
    level = QuestPlusTrial(RULE, "", whole[:7], again).level
    assert whole[7]["q_level"] == level


def test_several_run_beside_each_other_and_no_answer_teaches_nothing():
    rows = trials(RULE, 6, 1, of="a") + trials(RULE, 6, 2, of="b")
    alone = QuestPlusTrial(RULE, "a", rows[:6], {}).level
    row = {}
    beside = QuestPlusTrial(RULE, "a", rows, row)
    assert alone == beside.level
    beside.take(None)
    assert row["q_is_right"] is None
    assert row["q_threshold"] is None
    assert {c.name for c in columns_of_quest(RULE)} == set(row)


def test_the_measure_of_a_cell_is_what_is_known_after_its_last_answer():
    rows = trials(RULE, 9, 1)
    means = aggregate_cells(pd.DataFrame(rows), staircase_measures(RULE), [])
    assert rows[-1]["q_threshold"] == means["q_threshold"].iloc[0]
    assert rows[-1]["q_slope_low"] == means["q_slope_low"].iloc[0]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"levels": (0.1,)}, "two or more levels"),
        ({"thresholds": (0.3, 0.1)}, "rise"),
        ({"slopes": ()}, "rise"),
        ({"levels": (0.0, 1.0)}, "above 0"),
        ({"guess": 0.99}, "below 1"),
        ({"function": "logit"}, "'weibull' or 'normal'"),
        ({"name": "a b"}, "letters"),
    ],
)
def test_a_grid_without_room_is_refused(wrong, says):
    with pytest.raises(DesignError, match=says):
        replace(RULE, **wrong)


def source():
    """Return the ready study of contrasts with QUEST+ in place of its staircase."""
    text = (READY / "contrast.py.txt").read_text("utf-8")
    rule = """CONTRAST = QuestPlus(
    "contrast", levels=np.geomspace(0.002, 0.6, 21), thresholds=np.geomspace(0.004, 0.4, 21)
)"""
    lines = [rule if line.startswith("CONTRAST =") else line for line in text.splitlines()]
    return "\n".join(lines).replace(" Staircase,", " QuestPlus,") + "\n"


def test_a_resumed_session_goes_on_at_the_level_that_its_rows_lead_to(tmp_path):
    with pytest.raises(SessionAborted):
        perform_new(request_of(tmp_path, _Stops(900), source()))
    (path,) = (tmp_path / "data").rglob("ses-001")
    assert 4 < len(Recording(path).trials()) < 28
    rows = Recording(perform_rest(request_of(tmp_path, text=source()), path)).trials()
    rows = rows[rows["status"] == "complete"]
    rule = QuestPlus(
        "contrast", levels=np.geomspace(0.002, 0.6, 21), thresholds=np.geomspace(0.004, 0.4, 21)
    )
    for _, own in rows.groupby("contrast_of"):
        answers = list(zip(own["contrast_level"], own["contrast_is_right"], strict=True))
        expected = [posterior_after(rule, answers[:n]).next_level for n in range(len(answers))]
        assert expected == own["contrast_level"].tolist()


@pytest.mark.parametrize("rule", ["Staircase", "QuestPlus"])
def test_a_study_of_thresholds_is_analysed(tmp_path, rule):
    text = source() if rule == "QuestPlus" else (READY / "contrast.py.txt").read_text("utf-8")
    file, short = tmp_path / "contrast.py", ("--set", "repetitions=8")
    folder = simulate_and_analyse(file, text, *short, participants=3)
    means = pd.read_csv(folder / "derived" / "cell_means.csv")
    assert means["contrast_threshold"].notna().any()
    described = json.loads((folder / "derived" / "trials.json").read_text("utf-8"))
    own = [name for name in described if name.startswith("contrast_")]
    assert not [n for n in own if "describes it nowhere" in described[n]["Description"]]
