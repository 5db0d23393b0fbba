"""Every headline of every shipped study says which way: data turned round change all of them."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis import running
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.report.study_report import answers_of
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.comparisons import ALONE
from visavis.study.conditions import columns_asked
from visavis.study.experiment import StudyExperiment
from visavis.study.pairs import Correlate

READY = Path(running.__file__).parent
EXAMPLES = ("ready/glances", "ready/quick_press", "ready/lively_films")
PEOPLE = 16


def table_of(
    opened: OpenedStudy, experiment: StudyExperiment, size: float
) -> tuple[pd.DataFrame, pd.DataFrame, dict[str, int]]:
    """Return trials of people on whom every level has an effect of this size, people and counts."""
    rng = np.random.default_rng(1)
    columns = compared(opened)
    shares = {m.column for m in opened.measures(experiment) if m.aggregate == "share"}
    effects: dict[tuple[str, str], float] = {}
    rows, people, counts = [], [], {}
    for index in range(PEOPLE):
        name = f"S{index:02d}"
        own = rng.normal(0, 0.5)
        trials = [t for t in experiment.plan(index, 1).trials if not t.is_practice]
        counts[name] = len(trials)
        people.append(
            {
                "participant": name,
                **dict.fromkeys(scores(opened), 3.0 * own),
                **dict.fromkeys(asked(opened), 1 + index % 4),  # some people in every group
            }
        )
        for trial in trials:
            row: dict[str, Any] = {
                "is_simulated": True,
                "participant": name,
                "session": 1,
                "trial_id": trial.trial_id,
                "attempt": 1,
                "is_practice": False,
                "status": "complete",
                "reason": None,
                "flags": "",
                "t_start_ns": len(rows),
                **trial.factors,
            }
            for column in columns:
                for factor, level in trial.factors.items():
                    key = (factor, str(level))
                    effects.setdefault(key, float(rng.normal(0, 1)))
                    row[column] = row.get(column, middle(opened, column) + own)
                    row[column] += size * effects[key]
                row[column] += rng.normal(0, 1)
                if column in shares:
                    row[column] = bool(row[column] > middle(opened, column))
            rows.append(row)
    return pd.DataFrame(rows), pd.DataFrame(people), counts


def compared(opened: OpenedStudy) -> list[str]:
    """Return the columns that comparisons and families test."""
    analysis = opened.study.analysis
    tested = [c.dv for c in analysis.compare]
    return list(dict.fromkeys((*tested, *(m for f in analysis.families for m in f.measures))))


def middle(opened: OpenedStudy, column: str) -> float:
    """Return about what a measure is turned round: 0 where it is a preference, else 5."""
    preferences = [
        c.dv
        for c in opened.study.analysis.compare
        if c.model == "bradleyterry" or (c.test in ALONE and not (c.within or c.between))
    ]
    return 0.0 if column in preferences else 5.0


def scores(opened: OpenedStudy) -> list[str]:
    families = opened.study.analysis.families
    return list(dict.fromkeys(f.score for f in families if isinstance(f, Correlate)))


def asked(opened: OpenedStudy) -> tuple[str, ...]:
    """Return the answers that groups of people and conditions of comparisons are made of."""
    analysis = opened.study.analysis
    conditions = [text for c in analysis.compare for text in c.where]
    return columns_asked(conditions, tuple(analysis.groups), analysis.groups)


def headlines(opened: OpenedStudy, experiment: StudyExperiment, table: Any) -> list[str]:
    trials, people, counts = table
    analysis = opened.analysis_of_rows(experiment, trials, people, planned_counts=counts)
    return [f"{v.status} {v.headline}" for v in answers_of(analysis, experiment)]


def turned(opened: OpenedStudy, trials: pd.DataFrame) -> pd.DataFrame:
    """Return trials of which every measure that is compared is turned round."""
    return trials.assign(
        **{
            c: ~trials[c] if trials[c].dtype == bool else 2 * middle(opened, c) - trials[c]
            for c in compared(opened)
        }
    )


UNTOUCHED: Mapping[str, tuple[str, ...]] = {"crowd": ("The same paths in every block? (H1)",)}
"""Headlines about what no compared measure holds."""


@pytest.mark.parametrize("size", [0.0, 0.8], ids=["without effects", "with effects"])
@pytest.mark.parametrize("name", [*SHIPPED_STUDIES, *EXAMPLES])
def test_every_headline_of_a_study_changes_with_its_measures_turned_round(
    name: str, size: float, tmp_path: Path
) -> None:
    if name in EXAMPLES:
        path = tmp_path / f"{Path(name).name}.py"
        path.write_text((READY / f"{name}.py.txt").read_text("utf-8"), "utf-8")
    opened = find_study(str(path) if name in EXAMPLES else name)
    # Paths of walkers are no measure, and need recordings.
    study = opened.study.with_changes(analysis=replace(opened.study.analysis, further_of=None))
    opened = OpenedStudy(study)
    experiment = opened.experiment({})
    trials, people, counts = table_of(opened, experiment, size)
    first = headlines(opened, experiment, (trials, people, counts))
    second = headlines(opened, experiment, (turned(opened, trials), people, counts))

    same = [one for one in first if one in second]
    assert [] == [s for s in same if not any(words in s for words in UNTOUCHED.get(name, ()))]
    assert len(first) == len(second) > 0
