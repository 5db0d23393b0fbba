"""Signal detection: counts, the log-linear correction, and comparisons of people over cells."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from visavis.cli.quick_tracker import tracker_of
from visavis.lab.errors import DesignError
from visavis.results.detection_table import detection_table
from visavis.results.opened_study import find_study
from visavis.running.quick import quick_study
from visavis.study.measures import aggregate_cells
from visavis.study.signal_detection import detection

OLD = detection("answer", yes="f", signal="face", present="old")


def rows(hits: int, misses: int, alarms: int, rejections: int, **more: Any) -> pd.DataFrame:
    answers = [("old", "f")] * hits + [("old", "j")] * misses
    answers += [("new", "f")] * alarms + [("new", "j")] * rejections
    return pd.DataFrame(answers, columns=["face", "answer"]).assign(participant="S01", **more)


def measured(trials: pd.DataFrame, *factors: str) -> dict[str, float]:
    (row,) = aggregate_cells(trials, OLD, factors).to_dict("records")
    return {str(k).removeprefix("answer_"): v for k, v in row.items() if "answer" in str(k)}


def test_rates_are_shares_and_sensitivity_takes_them_with_the_correction() -> None:
    # (15 + .5) / 21 = .738095, z = .637484; (5 + .5) / 21 = .261905, z = -.637484
    row = measured(rows(15, 5, 5, 15))
    assert {"hit_01": 0.75, "false_alarm_01": 0.25} == {k: row[k] for k in list(row)[2:]}
    assert (1.274968, 0.0) == pytest.approx((row["dprime"], row["criterion"]), abs=1e-5)


def test_who_always_says_yes_has_no_sensitivity_and_a_low_criterion() -> None:
    # (10 + .5) / 11 = .954545 in both, z = 1.690622
    row = measured(rows(10, 0, 10, 0))
    assert (0.0, -1.690622) == pytest.approx((row["dprime"], row["criterion"]), abs=1e-5)


def test_who_is_always_right_has_a_number() -> None:
    row = measured(rows(10, 0, 0, 10))
    assert (2 * 1.690622, 0.0) == pytest.approx((row["dprime"], row["criterion"]), abs=1e-5)


def test_trials_without_an_answer_are_left_out_and_a_cell_needs_both_kinds() -> None:
    trials = rows(15, 5, 5, 15)
    none = trials.assign(answer=None)
    assert measured(trials) == measured(pd.concat([trials, none]))
    assert all(pd.isna(v) for v in measured(rows(5, 5, 0, 0)).values())


def test_what_tells_of_a_signal_is_no_factor_of_cells_apart() -> None:
    assert {} == {
        k: v for k, v in aggregate_cells(rows(1, 1, 1, 1), OLD, ["face"]).items() if "_01" in str(k)
    }


def test_an_answer_does_not_tell_of_its_own_signal() -> None:
    with pytest.raises(DesignError, match="is both the answer and what tells of a signal"):
        detection("answer", yes="f", signal="answer", present="f")


def test_numbers_are_the_same_however_a_table_holds_them() -> None:
    trials = rows(15, 5, 5, 15)
    numbers = trials.replace({"old": 1.0, "new": 0.5, "f": 1.0, "j": 2.0})
    (of,) = aggregate_cells(numbers, detection("answer", yes="1", signal="face", present=1), ())[
        "answer_dprime"
    ]
    assert measured(trials)["dprime"] == of


STUDY = """
from visavis import Compare, Factor, Keys, Study, Text, detection

study = Study(
    "memory", "Are smiling faces remembered better?",
    factors=[Factor("face", ["old", "new"]), Factor("mouth", ["smile", "rest"])], repetitions=20,
    calibrate=False,
    measures=[*detection("answer", yes="f", signal="face", present="old")],
    compare=[Compare("answer_dprime", within="mouth", expects="smile > rest")],
)

@study.trial
def trial(t):
    yield t.show(Text(f"{t.face} {t.mouth}"), until=Keys("f", "j"), limit_s=2)

@study.answer
def answer(seen, response, rng):
    face, mouth = seen.stimuli[0].text.split()
    is_right = rng.random() < (0.95 if mouth == "smile" and seen.effect else 0.6)
    return "f" if (face == "old") == is_right else "j"
"""


def test_a_comparison_finds_a_planted_sensitivity(tmp_path: Path) -> None:
    (tmp_path / "memory.py").write_text(STUDY, "utf-8")
    study = find_study(str(tmp_path / "memory.py"))
    trials = quick_study(study, study.experiment({}), tracker_of, [0], seed=1).trials
    cells = aggregate_cells(trials, study.study.analysis.measures, ["mouth"])
    by_mouth = cells.groupby("mouth")["answer_dprime"].mean()
    assert by_mouth["smile"] > by_mouth["rest"] + 1


def test_every_person_and_cell_stands_in_a_table_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "memory.py").write_text(STUDY, "utf-8")
    study = find_study(str(tmp_path / "memory.py"))
    experiment = study.experiment({})
    trials = quick_study(study, experiment, tracker_of, [0, 1], seed=1).trials
    selection = SimpleNamespace(counted=trials)
    analysis: Any = SimpleNamespace(
        measures=study.study.analysis.measures, cells=("face", "mouth"), selection=selection
    )
    extra = detection_table(analysis)
    table = extra.tables["detection"]
    assert ["n"] == [column.name for column in extra.columns]
    assert ["participant", "mouth", "n"] == list(table)[:3]
    assert [40] * 4 == table["n"].tolist()
    assert table["answer_dprime"].notna().all()


@pytest.mark.parametrize(
    ("line", "by", "says"),
    [
        ('yes="f"', 'yes="y"', "no option of answer 'y'; known: f, j"),
        ('present="old"', 'present="olds"', "no level of face 'olds'; did you mean 'old'"),
        ('signal="face"', 'signal="fase"', "no column of trials 'fase'; did you mean 'face'"),
        ('detection("answer"', 'detection("anwser"', "no column of trials 'anwser'; did you mean"),
    ],
)
def test_a_name_that_no_trial_has_is_refused_before_anybody_takes_part(
    tmp_path: Path, line: str, by: str, says: str
) -> None:
    study = STUDY.replace(line, by)
    if "anwser" in by:
        study = study.replace("answer_dprime", "anwser_dprime")
    (tmp_path / "memory.py").write_text(study, "utf-8")
    with pytest.raises(DesignError, match=says):
        find_study(str(tmp_path / "memory.py")).experiment({})


@pytest.mark.parametrize(
    "compare", ['within="face"', 'within=("mouth", "face")', 'within="mouth", only={"face": "old"}']
)
def test_no_comparison_parts_the_two_kinds_of_trials_that_sensitivity_needs(
    tmp_path: Path, compare: str
) -> None:
    text = STUDY.replace('within="mouth", expects="smile > rest"', compare)
    assert compare in text
    (tmp_path / "memory.py").write_text(text, "utf-8")
    with pytest.raises(DesignError, match=r"memory.py, line 9: .*'face' tells one from the other"):
        find_study(str(tmp_path / "memory.py")).experiment({})
