"""Which recorded trials somebody should look at again, and where their pages are."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.analysis.report import Cell, Column, Table
from visavis.analysis.report.notation import count_of, decimal
from visavis.results.analysis import StudyAnalysis
from visavis.results.selection import IS_ANALYSED, PERFORMED_AGAIN, PERSON_OUT, PRACTICE, REASON
from visavis.results.several_sessions import SESSION_NUMBER
from visavis.study.measures import Measure
from visavis.study.sections import TrialToSee

VIEWS: Final = "views"
"""Folder beside a report with the pages of its trials."""
MAX_MODIFIED_Z: Final = 3.5
"""Modified z above which a value counts as an outlier (Iglewicz & Hoaglin, 1993)."""
NORMAL_MAD: Final = 0.6745
"""Median absolute deviation of a normal distribution, in standard deviations."""
MIN_TRIALS_PER_CONDITION: Final = 5
"""With fewer trials than this, no value is called an outlier."""
MAX_LISTED: Final = 60


def unusual_trials(analysis: StudyAnalysis) -> tuple[TrialToSee, ...]:
    """Return trials that were broken off, skipped, flagged or left out, or that have an outlier.

    A value is an outlier when it is farther than `MAX_MODIFIED_Z` from the median of the same
    person's trials with the same levels of all factors compared. The unit is the spread of the
    whole study about those medians. Practice is not listed. A trial is not listed merely because
    it was performed again later or its participant was left out.
    """
    rows = analysis.selection.rows
    whys: dict[tuple[str, str, str], list[str]] = {}
    for record in rows[rows[REASON] != PRACTICE].to_dict("records"):
        row = {str(name): value for name, value in record.items()}
        key = key_of_row(row)
        flags, reasons = row.get("flags"), []
        if row["status"] != "complete":
            reason = row.get("reason")
            reasons.append(
                f"{row['status']}: {reason}" if isinstance(reason, str) else row["status"]
            )
        elif not row[IS_ANALYSED] and not str(row[REASON]).startswith(
            (PERFORMED_AGAIN, PERSON_OUT)
        ):
            reasons.append(f"left out: {row[REASON]}")
        reasons += [flags.replace(";", ", ")] if isinstance(flags, str) and flags else []
        if reasons:
            whys.setdefault(key, []).extend(reasons)
    for key, why in _apart(analysis):
        whys.setdefault(key, []).append(why)
    return tuple(TrialToSee(*key, "; ".join(dict.fromkeys(why))) for key, why in whys.items())


def _apart(analysis: StudyAnalysis) -> Iterator[tuple[tuple[str, str, str], str]]:
    rows = analysis.selection.counted
    measures = {f.measure.column: f.measure for f in analysis.findings}
    keys = ["participant", *(c for c in analysis.cells if c in rows)]
    for measure in measures.values():
        if measure.column not in rows:
            continue
        values = pd.to_numeric(rows[measure.column], errors="coerce").astype(float)
        cell = values.groupby([rows[k] for k in keys], observed=True)
        off = values - cell.transform("median")
        enough = cell.transform("count") >= MIN_TRIALS_PER_CONDITION
        deviations = off[enough & off.notna()]
        spread = float(np.median(np.abs(deviations))) / NORMAL_MAD if len(deviations) else 0.0
        if spread <= 0:
            continue
        score = deviations / spread
        for index in score.index[score.abs() > MAX_MODIFIED_Z]:
            yield (
                key_of_row(rows.loc[index]),
                _far(measure, float(values[index]), float(score[index])),
            )


def key_of_row(row: Mapping[str, Any] | pd.Series) -> tuple[str, str, str]:
    """Return participant, folder of the session and trial of a row of the selection."""
    number = int(row.get(SESSION_NUMBER.name, row["session"]))
    return str(row["participant"]), f"ses-{number:03d}", str(row["trial_id"])


def _far(measure: Measure, value: float, score: float) -> str:
    unit = "" if measure.unit in ("", "1") else f" {measure.unit}"
    side = "above" if score > 0 else "below"
    return (
        f"{measure.words} {decimal(value, measure.digits)}{unit}, far {side} their others of this "
        f"kind (modified z {decimal(score, 1)})"
    )


def view_name(participant: str, session: str) -> str:
    """Return what a session's page beside a report is called."""
    return f"{participant}_{session}.html"


def trial_cell(one: TrialToSee, folder: str, views: Path) -> Cell:
    """Return a trial's name that opens its page in `views`, or copies the command that shows it."""
    name = view_name(one.participant, one.session)
    session = f"{folder}/sub-{one.participant}/{one.session}"
    is_there = (views / name).is_file()
    return Cell(
        one.trial_id,
        link=f"{VIEWS}/{name}#trial={one.trial_id}" if is_there else "",
        command="" if is_there else f"visavis view {session} --trial {one.trial_id} --show",
    )


def looks_table(trials: tuple[TrialToSee, ...], folder: str, views: Path) -> Table | None:
    """Return the trials to look at, each with its page in `views`, or the command that makes it."""
    if not trials:
        return None
    rows = [
        (one.participant, trial_cell(one, folder, views), one.why) for one in trials[:MAX_LISTED]
    ]
    more = len(trials) - len(rows)
    beyond = f" {count_of(more, 'further trial')} in trials.csv." if more else ""
    return Table(
        (Column("Participant"), Column("Trial"), Column("Why")),
        tuple(rows),
        "Trials to look at",
        "A trial opens its page in the viewer where that stands beside this report, else it copies "
        f"the command that shows it; visavis report {folder} --views makes all pages. Values that "
        f"lie apart count: modified z beyond {MAX_MODIFIED_Z} (Iglewicz & Hoaglin, 1993)." + beyond,
    )


def shown_table(
    trials: Sequence[TrialToSee], why: str, folder: str, views: Path, title: str
) -> Table:
    """Return the trials that a figure shows, as `looks_table`; `why` heads what is said of each."""
    rows = [(one.participant, trial_cell(one, folder, views), one.why) for one in trials]
    return Table((Column("Participant"), Column("Trial"), Column(why)), tuple(rows), title)
