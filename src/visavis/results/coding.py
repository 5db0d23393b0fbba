"""What people coded in sessions afterwards, as tables: every span, and how far two coders agree."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.statistics.agreement import cohen_kappa
from visavis.analysis.statistics.errors import StatisticsError
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.columns import Column
from visavis.recording.annotations import Annotation, table_of_annotations

ANNOTATIONS: Final = "annotations"
AGREEMENT: Final = "annotation_agreement"
STEP_MS: Final = 100
"""Two coders are compared step by step of this length."""
ANY_LABEL: Final = "any"

CODING_COLUMNS: Final = (
    Column("coder", "", "who coded the span"),
    Column("label", "", "what was coded"),
    Column("begin_ns", "ns", "beginning of the span in session time of its part"),
    Column("end_ns", "ns", "end of the span in session time of its part"),
    Column("begin_ms", "ms", "beginning of the span after the start of its trial"),
    Column("duration_ms", "ms", "length of the span"),
    Column("comment", "", "the coder's comment"),
    Column("coder_1", "", "one of two coders"),
    Column("coder_2", "", "the other of two coders"),
    Column("trials", "1", "complete trials of the sessions that both coded"),
    Column("steps", "1", f"steps of {STEP_MS} ms of these trials"),
    Column("agreement_01", "1", "share of steps that both coded alike"),
    Column(
        "kappa",
        "1",
        "Cohen's kappa over these steps: label or none; empty where both said one thing throughout",
    ),
)


def span_rows(spans: Sequence[Annotation], rows: pd.DataFrame) -> pd.DataFrame:
    """Return a session's spans as rows, with times after the start of their trial; without columns
    where there is none.
    """
    if not spans:
        return pd.DataFrame()
    table = table_of_annotations(spans)
    starts_ns = {
        (int(row["recording_part"]), str(row["trial_id"])): int(row["t_start_ns"])
        for row in rows.to_dict("records")
        if not pd.isna(row["t_start_ns"])
    }
    begins_ms = []
    for one in table.to_dict("records"):
        start_ns = starts_ns.get((int(one["recording_part"]), str(one["trial_id"])))
        begins_ms.append(None if start_ns is None else (one["begin_ns"] - start_ns) / NS_PER_MS)
    table["begin_ms"] = pd.array(begins_ms, dtype="Float64")
    table["duration_ms"] = (table["end_ns"] - table["begin_ns"]) / NS_PER_MS
    return table


def agreement_of_coders(spans: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each two coders and each label, and for all labels together ("any").

    They are compared over the complete trials of the sessions that both coded, step by step: at
    each step's middle a label is on or off; of all together the category is the labels that are on.
    """
    agreements = []
    for first, second in combinations(sorted(spans["coder"].unique()), 2):
        both = _sessions(spans, first) & _sessions(spans, second)
        mine = [(row, _inside(spans, row)) for row in _trials(rows, both)]
        for label in [*sorted(spans["label"].unique()), ANY_LABEL]:
            codes = [[_codes(one, row, who, label) for who in (first, second)] for row, one in mine]
            first_codes, second_codes = (
                np.concatenate([np.empty(0, object), *(one[k] for one in codes)]) for k in (0, 1)
            )
            agreements.append(
                {
                    "coder_1": first,
                    "coder_2": second,
                    "label": label,
                    "trials": len(mine),
                    "steps": len(first_codes),
                    "agreement_01": float((first_codes == second_codes).mean())
                    if len(first_codes)
                    else None,
                    "kappa": _kappa(first_codes, second_codes),
                }
            )
    return pd.DataFrame(agreements)


def _sessions(spans: pd.DataFrame, coder: str) -> set[tuple[str, int]]:
    mine = spans[spans["coder"] == coder]
    return set(zip(mine["participant"].astype(str), mine["session"].astype(int), strict=True))


def _trials(rows: pd.DataFrame, sessions: set[tuple[str, int]]) -> Iterator[dict[Any, Any]]:
    for row in rows.to_dict("records"):
        if (str(row["participant"]), int(row["session"])) not in sessions:
            continue
        if row["status"] == "complete" and not row["is_practice"]:
            yield row


def _inside(spans: pd.DataFrame, row: dict[Any, Any]) -> pd.DataFrame:
    """Return the spans that meet a trial."""
    meets: pd.DataFrame = spans[
        (spans["participant"].astype(str) == str(row["participant"]))
        & (spans["session"].astype(int) == int(row["session"]))
        & (spans["recording_part"].astype(int) == int(row["recording_part"]))
        & (spans["begin_ns"] < row["t_end_ns"])
        & (spans["end_ns"] > row["t_start_ns"])
    ]
    return meets


def _codes(
    spans: pd.DataFrame, row: dict[Any, Any], coder: str, label: str
) -> npt.NDArray[np.object_]:
    """Return which labels are on at each step's middle, joined by +; "" for none."""
    step_ns = STEP_MS * NS_PER_MS
    middles_ns = np.arange(int(row["t_start_ns"]) + step_ns // 2, int(row["t_end_ns"]), step_ns)
    codes = np.full(len(middles_ns), "", dtype=object)
    mine = spans[spans["coder"] == coder]
    for name in sorted(mine["label"].unique()) if label == ANY_LABEL else [label]:
        on = np.zeros(len(middles_ns), bool)
        for span in mine[mine["label"] == name].to_dict("records"):
            on |= (span["begin_ns"] <= middles_ns) & (middles_ns < span["end_ns"])
        codes[on] = [f"{code}+{name}" if code else name for code in codes[on]]
    return codes


def _kappa(first: npt.NDArray[np.object_], second: npt.NDArray[np.object_]) -> float | None:
    if not len(first):
        return None
    _, codes = np.unique(np.concatenate([first, second]).astype(str), return_inverse=True)
    try:
        return cohen_kappa(codes.reshape(2, -1).T.astype(float)).value
    except StatisticsError:  # nothing to agree about
        return None
