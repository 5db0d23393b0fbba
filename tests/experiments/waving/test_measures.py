"""Which trials of the waving study count, and the exact bounds of its measures."""

import pandas as pd
import pytest

from visavis.experiments.waving.clips import DIRECTIONS, TECHNIQUES
from visavis.experiments.waving.sections import relative_confusion
from visavis.experiments.waving.study import study
from visavis.results.opened_study import OpenedStudy
from visavis.study.measures import aggregate_cells

WAVING = OpenedStudy(study)


def trial(**changed):
    row = {
        "participant": "S01",
        "session": 1,
        "trial_id": "T01",
        "attempt": 1,
        "is_practice": False,
        "status": "complete",
        "technique": "warping",
        "direction": "self",
        "participant_place": "place_3",
        "target_place": "place_3",
        "who": "place_3",
        "is_right": True,
        "who_ms": 1000.0,
        "realism": 7,
        "eye_height_m": 1.62,
        "planned_eye_height_m": 1.62,
    }
    return {**row, **changed}


def selected(*rows):
    table = pd.DataFrame(rows)
    planned = dict.fromkeys(table["participant"], 54)
    off = dict.fromkeys(("min_cell_trials", "min_cell_01", "min_completed_01"))
    return WAVING.selection_of(WAVING.experiment({}), table, planned_counts=planned, settings=off)


def counted(*rows):
    return selected(*rows).counted


def test_of_a_trial_finished_twice_the_last_attempt_counts():
    answers = ("place_1", "place_2", "place_4")
    rows = [trial(who=who, attempt=i) for i, who in enumerate(answers, start=1)]
    assert ["place_4"] == counted(*rows)["who"].tolist()


def test_an_attempt_that_was_not_finished_or_not_answered_does_not_replace_one_that_was():
    rows = [
        trial(who="place_1"),
        trial(who="place_2", status="interrupted", attempt=2),
        trial(who=None, attempt=3),
    ]
    assert ["place_1"] == counted(*rows)["who"].tolist()


def test_training_never_counts():
    assert counted(trial(is_practice=True)).empty


@pytest.mark.parametrize("other", [{"participant": "S02"}, {"session": 2}, {"trial_id": "T02"}])
def test_attempts_are_of_one_trial_of_one_session_of_one_person(other):
    assert 2 == len(counted(trial(), trial(**other)))


def test_only_a_participant_with_every_cell_is_complete():
    cells = [(t, d) for t in TECHNIQUES for d in DIRECTIONS]
    every = [
        trial(participant=name, technique=t, direction=d, trial_id=f"T{i}")
        for name, met in (("S01", cells), ("S02", cells[1:]))
        for i, (t, d) in enumerate(met)
    ]
    table = pd.DataFrame(every)
    selection = WAVING.selection_of(
        WAVING.experiment({}), table, planned_counts={"S01": 6, "S02": 6}
    ).counted
    assert {"S01"} == set(selection["participant"])


def test_response_time_is_the_median_and_accuracy_the_mean_of_a_cell():
    table = counted(
        trial(who_ms=100.0, realism=1, trial_id="T01"),
        trial(who_ms=200.0, realism=1, is_right=False, trial_id="T02"),
        trial(who_ms=900.0, realism=4, trial_id="T03"),
    )
    measures = WAVING.measures(WAVING.experiment({}))
    (cell,) = aggregate_cells(table, measures, ["technique", "direction"]).to_dict("records")
    assert (200.0, 2.0, 3) == (cell["who_ms"], cell["realism"], cell["n"])
    assert 2 / 3 == pytest.approx(cell["is_right"])


@pytest.mark.parametrize(
    ("who", "told"),
    [
        ("place_1", "farther"),
        ("place_2", "left"),
        ("place_3", "self"),
        ("place_4", "right"),
        ("place_5", "farther"),
    ],
)
def test_an_answer_one_place_aside_is_left_or_right_and_two_places_farther(who, told):
    table = relative_confusion(pd.DataFrame([trial(who=who)]))
    counts = table[["left", "self", "right", "farther"]].sum()
    assert told == counts.idxmax()
    assert 1 == counts.sum()
