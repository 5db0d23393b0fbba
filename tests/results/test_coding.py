"""Spans that people coded: read, placed beside the sessions, and how far two coders agree."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from statsmodels.stats.inter_rater import cohens_kappa, to_table

from visavis.lab.errors import DataError
from visavis.recording.annotations import (
    Annotation,
    annotations_of,
    place_annotations,
    read_annotations,
    table_of_annotations,
)
from visavis.results.coding import ANY_LABEL, agreement_of_coders, span_rows

S = 1_000_000_000
SPAN = Annotation("S01B", 1, 1, "T01", "AM", "smile", 2 * S, 3 * S, "wide")


def trials(**columns: Any) -> pd.DataFrame:
    """Return rows of two trials of 2 s."""
    return pd.DataFrame(
        {
            "participant": "S01B",
            "session": 1,
            "recording_part": 1,
            "trial_id": ["T01", "T02"],
            "status": "complete",
            "is_practice": False,
            "t_start_ns": [1 * S, 5 * S],
            "t_end_ns": [3 * S, 7 * S],
            **columns,
        }
    )


def test_spans_come_back_as_they_were_placed_formulas_included(tmp_path: Path) -> None:
    spans = (SPAN, replace(SPAN, begin_ns=4 * S, end_ns=5 * S, comment='=1+1, "so"', trial_id=""))
    place_annotations(tmp_path, spans)
    assert spans == annotations_of(tmp_path)
    assert "'=1+1" in (tmp_path / "annotations.csv").read_text("utf-8")


def test_a_coder_replaces_their_own_spans_of_a_session_and_nobody_elses(tmp_path: Path) -> None:
    other = replace(SPAN, coder="BK", label="frown")
    second = replace(SPAN, session=2)
    place_annotations(tmp_path, [SPAN, other, second])
    anew = replace(SPAN, begin_ns=1 * S)
    place_annotations(tmp_path, [anew])
    assert {anew, other, second} == set(annotations_of(tmp_path))


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("begin_ns", "start", "no column begin_ns"),
        ("3000000000", "soon", "line 2: .*whole numbers"),
        ("3000000000", "1", "line 2: the span ends before it begins"),
        ("smile", "", "line 2: label is empty"),
        ("AM", "", "line 2: coder is empty"),
    ],
)
def test_a_file_that_is_no_coding_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, problem: str
) -> None:
    place_annotations(tmp_path, [SPAN])
    path = tmp_path / "annotations.csv"
    path.write_text(path.read_text("utf-8").replace(old, new), "utf-8")
    with pytest.raises(DataError, match=problem):
        read_annotations(path)


def test_spans_are_rows_with_times_in_their_trial_and_none_between_trials() -> None:
    between = replace(SPAN, begin_ns=4 * S, end_ns=round(4.5 * S), trial_id="")
    rows = span_rows([SPAN, between], trials())
    assert [1000.0, pd.NA] == list(rows["begin_ms"])
    assert [1000.0, 500.0] == list(rows["duration_ms"])
    assert not len(span_rows([], trials()).columns)


def test_two_coders_agree_as_statsmodels_says() -> None:
    """Steps of 100 ms of random spans, against an independent kappa."""
    rng = np.random.default_rng(7)
    spans = []
    for coder in ("AM", "BK"):
        for label in ("smile", "talk"):
            for begin in rng.integers(10, 60, 4):
                begin_ns = int(begin) * S // 10
                length_ns = int(rng.integers(2, 9)) * S // 10
                spans.append(
                    Annotation("S01B", 1, 1, "", coder, label, begin_ns, begin_ns + length_ns, "")
                )
    table = agreement_of_coders(table_of_annotations(spans), trials())
    middles = [t0 * 10 + k for t0 in (1, 5) for k in range(20)]  # in tenths of a second
    for row in table.to_dict("records"):
        codes = []
        for coder in ("AM", "BK"):
            mine = [one for one in spans if one.coder == coder]
            on = [
                "+".join(
                    sorted(
                        {
                            one.label
                            for one in mine
                            if one.begin_ns <= (m * S + S // 2) // 10 < one.end_ns
                            and row["label"] in (ANY_LABEL, one.label)
                        }
                    )
                )
                for m in middles
            ]
            codes.append(on)
        names = sorted({*codes[0], *codes[1]})
        numbers = np.array([[names.index(c) for c in one] for one in codes]).T
        wanted = cohens_kappa(to_table(numbers, len(names))[0]).kappa
        assert pytest.approx(wanted) == row["kappa"], row["label"]
        assert 40 == row["steps"]
    assert ["smile", "talk", ANY_LABEL] == list(table["label"])


def test_only_complete_trials_of_sessions_that_both_coded_are_compared() -> None:
    other = replace(SPAN, coder="BK")
    rows = trials(status=["complete", "interrupted"])
    (smile, _) = agreement_of_coders(table_of_annotations([SPAN, other]), rows).to_dict("records")
    assert pytest.approx((1, 20, 1.0, 1.0)) == tuple(
        smile[name] for name in ("trials", "steps", "agreement_01", "kappa")
    )
    elsewhere = replace(other, session=2)
    row = agreement_of_coders(table_of_annotations([SPAN, elsewhere]), rows).iloc[0]
    assert (0, 0, None, None) == tuple(
        row[name] for name in ("trials", "steps", "agreement_01", "kappa")
    )
