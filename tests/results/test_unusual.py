"""Which trials a report asks to look at, and where their pages are."""

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

from visavis.results.analysis import StudyAnalysis
from visavis.results.selection import PERFORMED_AGAIN, PERSON_OUT, PRACTICE
from visavis.results.unusual import looks_table, unusual_trials
from visavis.study.sections import TrialToSee


@dataclass(frozen=True)
class _Selection:
    rows: pd.DataFrame = field(repr=False)

    @property
    def counted(self) -> pd.DataFrame:
        return self.rows[self.rows["is_analysed"]]


def analysis_of(values: Any, **columns: dict[int, Any]) -> StudyAnalysis:
    """Return what an analysis knows of one person's trials of one kind, `columns` by trial."""
    n = len(values)
    rows = pd.DataFrame(
        {
            "participant": "01A",
            "session": 1,
            "kind": "a",
            "status": "complete",
            "flags": None,
            "trial_id": [f"T{i:02d}" for i in range(1, n + 1)],
            "reason": None,
            "is_analysed": True,
            "left_out_because": "",
            "dwell_ms": values,
        }
    ).astype({"flags": object, "reason": object})
    for name, changed in columns.items():
        for trial, value in changed.items():
            rows.loc[trial - 1, name] = value
    measure = SimpleNamespace(column="dwell_ms", words="Dwell time", unit="ms", digits=0)
    unusual: Any = SimpleNamespace(
        selection=_Selection(rows), cells=("kind",), findings=[SimpleNamespace(measure=measure)]
    )
    return cast(StudyAnalysis, unusual)


def plain(n: int = 9) -> Any:
    return 500.0 + 10.0 * np.arange(n)


def test_trials_like_the_others_are_not_listed() -> None:
    assert () == unusual_trials(analysis_of(plain()))


def test_a_value_far_from_the_same_person_s_others_of_its_kind_is_listed() -> None:
    values = plain()
    values[3] = 1500.0
    (unusual,) = unusual_trials(analysis_of(values))
    # median 550, median absolute deviation 30: 0.6745 * 950 / 30
    assert ("T04", "1500 ms, far above their others of this kind (modified z 21.4)") == (
        unusual.trial_id,
        unusual.why.removeprefix("Dwell time "),
    )


@pytest.mark.parametrize("n", [2, 4])
def test_of_few_trials_none_lies_apart(n: int) -> None:
    values = plain(n)
    values[0] = 9000.0
    assert () == unusual_trials(analysis_of(values))


def test_flagged_broken_off_and_left_out_trials_are_listed_with_why_but_no_practice() -> None:
    analysis = analysis_of(
        plain(),
        flags={1: "operator_flag;unwell", 9: "unwell"},
        status={2: "skipped"},
        reason={2: "disturbance: door"},
        is_analysed=dict.fromkeys((2, 3, 4, 5, 9), False),
        left_out_because={
            2: "not finished",
            3: "60 % lost",
            4: f"{PERSON_OUT}few trials",
            5: PERFORMED_AGAIN,
            9: PRACTICE,
        },
    )
    assert (
        TrialToSee("01A", "ses-001", "T01", "operator_flag, unwell"),
        TrialToSee("01A", "ses-001", "T02", "skipped: disturbance: door"),
        TrialToSee("01A", "ses-001", "T03", "left out: 60 % lost"),
    ) == unusual_trials(analysis)


def test_a_trial_leads_to_its_page_where_that_stands_and_else_gives_the_command(
    tmp_path: Path,
) -> None:
    (tmp_path / "01A_ses-001.html").touch()
    looks = [TrialToSee(who, "ses-001", "T07", "flag") for who in ("01A", "02C")]
    table = looks_table(tuple(looks), "data/real/duel", tmp_path)
    assert table is not None
    shown: list[Any] = [row[1] for row in table.rows]
    assert ("views/01A_ses-001.html#trial=T07", "") == (shown[0].link, shown[0].command)
    assert ("", "visavis view data/real/duel/sub-02C/ses-001 --trial T07 --show") == (
        shown[1].link,
        shown[1].command,
    )
