"""Confusion matrices of a choice: rows are what was right, columns the answer."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from visavis.results.confusion import confusion_counts, confusion_section
from visavis.results.opened_study import find_study
from visavis.study.sections import Confusion

STUDY = """from visavis import Choice, Confusion, Factor, Scene, Study

study = Study(
    "seeing",
    factors=[Factor("eyes", ["averted", "directed"]), Factor("distance", [1.0, 2.5])],
    sections=[Confusion("eyes", "seen", by="distance")],
)


@study.trial
def trial(t):
    yield t.show(Scene("person", distance_m=t.distance, eyes=t.eyes), seconds=1.5)
    yield t.ask(Choice("seen", ["averted", "directed"]))
"""
ROWS = [
    ("averted", 1.0, "averted"),
    ("averted", 1.0, "directed"),
    ("averted", 1.0, "directed"),
    ("directed", 1.0, "directed"),
    ("directed", 2.5, "averted"),
    ("directed", 2.5, None),
]


@pytest.fixture
def extra(tmp_path: Path) -> Any:
    path = tmp_path / "seeing.py"
    path.write_text(STUDY, "utf-8")
    opened = find_study(str(path))
    trials = pd.DataFrame(ROWS, columns=["eyes", "distance", "seen"])
    analysis: Any = SimpleNamespace(selection=SimpleNamespace(counted=trials), is_simulated=False)
    section: Any = opened.study.report.sections[0]
    return confusion_section(section, analysis, opened.experiment({}))


def test_a_row_is_what_was_right_and_a_column_the_answer(extra: Any) -> None:
    table = extra.tables["confusion"].set_index(["distance", "eyes"])

    assert [1, 2] == table.loc[(1.0, "averted")].tolist()
    assert [0, 1] == table.loc[(1.0, "directed")].tolist()
    assert [0, 0] == table.loc[(2.5, "averted")].tolist()
    assert [1, 0] == table.loc[(2.5, "directed")].tolist()


def test_a_trial_without_an_answer_is_told_and_not_counted(extra: Any) -> None:
    assert ".40 of 5 answers were right, among 2 options. 1 trial without an answer" in (
        extra.section.blocks[-1].text
    )


def test_one_matrix_for_each_level_and_none_without(extra: Any) -> None:
    (drawn,) = extra.figures

    assert ["1.0", "2.5"] == [axes.get_title("left") for axes in drawn.figure.axes]


def test_without_a_factor_all_trials_make_one_matrix() -> None:
    trials = pd.DataFrame(ROWS, columns=["eyes", "distance", "seen"])
    counts = confusion_counts(Confusion("eyes", "seen"), trials, ("averted", "directed"))

    assert [[1, 2], [1, 1]] == counts.tolist()
