"""Data quality by participant: what the validations measured and how much gaze was lost."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import pandas as pd

from visavis.analysis.report import Column, Table
from visavis.analysis.report.notation import count_of, decimal, percentage
from visavis.protocol.plan.columns import Column as Described
from visavis.protocol.plan.questionnaires import load_questionnaire
from visavis.results.analysis import StudyAnalysis
from visavis.results.selection import mean_error_deg
from visavis.study.measures import LOST_COLUMN

ERROR_COLUMN = "calibration_accuracy_deg"
LOSS_COLUMNS = ("lost_01", LOST_COLUMN)
"""Columns with a trial's share of lost gaze: of the measures of looks, or by itself."""
END_ACCURACY, DRIFT, REJECTED = "end_accuracy_deg", "drift_deg", "rejected_validations"
SESSION_COLUMNS = (END_ACCURACY, DRIFT, REJECTED)
"""Optional columns of the participants' answers: error of the validation after the last trial, its
difference to the one before, number of validations that did not pass."""

VISION_COLUMN = "vision"
VISION_QUESTIONNAIRE = "demographics"
QUALITY_COLUMNS = ("accuracy_deg", "precision_deg", "lost_01")
QUALITY_TABLE = (
    Described("accuracy_deg", "deg", "mean error of the validations in force"),
    Described("precision_deg", "deg", "mean RMS sample to sample of those validations"),
    Described("worst_point_deg", "deg", "largest error at a point of those validations"),
    Described("lost_01", "1", "mean share of a finished trial without usable gaze"),
    Described("calibrations", "1", "validations in force during finished trials"),
    Described("trials", "1", "trials finished, practice left out"),
    Described("trials_out", "1", "of these, trials that lost more gaze than the limit"),
)
"""Columns of a participant's quality."""


@dataclass(frozen=True)
class Quality:
    """Quality as the report shows it.

    `participants` has one row each: participant, accuracy_deg, precision_deg, worst_point_deg,
    lost_01, calibrations, trials, trials_out; NaN where unknown. It also has the columns of
    `SESSION_COLUMNS` that the answers have. `facts` are the answers of recordings to the reporting
    list (tracker, rates, filters). `incidents` lists interruptions and deviations as participant,
    what, reason. The limits are those of the rules.
    """

    participants: pd.DataFrame
    facts: Mapping[str, str] = field(default_factory=dict)
    incidents: tuple[tuple[str, str, str], ...] = ()
    max_error_deg: float | None = None
    max_trial_lost_01: float | None = None


def quality_of_trials(
    trials: pd.DataFrame,
    finished: pd.DataFrame,
    *,
    max_trial_lost_01: float | None,
    facts: Mapping[str, str] | None = None,
    people: pd.DataFrame | None = None,
    max_error_deg: float | None = None,
) -> Quality:
    """Compute the quality from the calibration and loss columns of the trial table.

    `finished` are the finished trials, practice left out, `trials` all of them. `people` are the
    participants' answers: their vision and, where known, `SESSION_COLUMNS`. An error above
    `max_error_deg` at the end of a session is listed as an incident.
    """
    rows = []
    loss = next((c for c in LOSS_COLUMNS if c in finished), LOST_COLUMN)
    for name, part in finished.groupby("participant", sort=True):
        distinct = (
            part.drop_duplicates("calibration_id") if "calibration_id" in part.columns else part
        )
        rows.append(
            {
                "participant": str(name),
                "accuracy_deg": mean_error_deg(part),
                "precision_deg": _mean(distinct, "calibration_precision_deg"),
                "worst_point_deg": _largest(distinct, "calibration_worst_point_deg"),
                "lost_01": _mean(part, loss),
                "calibrations": int(distinct[ERROR_COLUMN].notna().sum())
                if "calibration_id" in part.columns and ERROR_COLUMN in part.columns
                else 0,
                "trials": len(part),
                "trials_out": 0
                if max_trial_lost_01 is None or loss not in part
                else int((~(part[loss].astype(float) <= max_trial_lost_01)).sum()),
            }
        )
    table = pd.DataFrame(
        rows,
        columns=["participant", *(c.name for c in QUALITY_TABLE)],
    )
    answers = _people(people)
    optional = [c for c in SESSION_COLUMNS if c in answers]
    if optional:
        table = table.merge(answers[["participant", *optional]], on="participant", how="left")
    vision = _vision(answers, set(table["participant"]))
    return Quality(
        table,
        ({"vision": vision} if vision else {}) | dict(facts or {}),
        (*_incidents(trials), *_calibration_incidents(table, max_error_deg)),
        max_error_deg,
        max_trial_lost_01,
    )


def _people(people: pd.DataFrame | None) -> pd.DataFrame:
    if people is None or "participant" not in people:
        return pd.DataFrame(columns=["participant"])
    return people.assign(participant=people["participant"].astype(str))


def _vision(people: pd.DataFrame, analysed_people: set[str]) -> str:
    """Return how many gave each answer about their eyesight, in words; empty when nobody did."""
    if VISION_COLUMN not in people:
        return ""
    answers = people.loc[people["participant"].isin(analysed_people), VISION_COLUMN]
    if not answers.notna().any():
        return ""
    questionnaire = load_questionnaire(VISION_QUESTIONNAIRE)
    options = next(
        q.scale.options for q in questionnaire.questions() if q.question_id == VISION_COLUMN
    )
    codes = answers.dropna().astype(int).tolist()
    parts = [
        f"{codes.count(value)} {options.get(value, f'answer {value}')}"
        for value in sorted(set(codes))
    ]
    silent = int(answers.isna().sum())
    return ", ".join([*parts, *([f"{silent} without an answer"] if silent else [])])


def _calibration_incidents(
    table: pd.DataFrame, max_error_deg: float | None
) -> list[tuple[str, str, str]]:
    incidents = []
    for row in table.to_dict("records"):
        who = str(row["participant"])
        n_rejected, end = row.get(REJECTED), row.get(END_ACCURACY)
        if n_rejected is not None and n_rejected == n_rejected and n_rejected > 0:
            what = count_of(int(n_rejected), "validation") + " rejected"
            incidents.append((who, what, "did not meet the thresholds; calibrated again"))
        if max_error_deg is not None and end is not None and end == end and end > max_error_deg:
            what = "large error at the end of the session"
            why = f"{decimal(end, 2)}°, limit {decimal(max_error_deg, 1)}°"
            incidents.append((who, what, why))
    return incidents


def _mean(rows: pd.DataFrame, column: str) -> float:
    return float(rows[column].astype(float).mean()) if column in rows else float("nan")


def _largest(rows: pd.DataFrame, column: str) -> float:
    return float(rows[column].astype(float).max()) if column in rows else float("nan")


def _incidents(trials: pd.DataFrame) -> tuple[tuple[str, str, str], ...]:
    incidents = []
    columns = [c for c in ("participant", "trial_id", "status", "reason", "flags") if c in trials]
    for row in trials[columns].to_dict("records"):
        who, trial = str(row["participant"]), str(row.get("trial_id", ""))
        status = row.get("status", "complete")
        if status != "complete":
            reason = row.get("reason")
            why = str(reason) if isinstance(reason, str) and reason else "no reason given"
            incidents.append((who, f"trial {trial} {status}", why))
        flags = row.get("flags")
        if isinstance(flags, str) and flags:
            incidents.append((who, f"trial {trial} flagged", flags))
    return tuple(incidents)


def quality_of(analysis: StudyAnalysis, facts: Mapping[str, str] | None = None) -> Quality | None:
    """Return the quality of a study's gaze; None where none was recorded."""
    rows = analysis.selection.rows
    if not any(c in rows and rows[c].notna().any() for c in (ERROR_COLUMN, *LOSS_COLUMNS)):
        return None
    limits = {
        r.column: analysis.selection.limits[r.name] for r in analysis.study.analysis.exclusions
    }
    return quality_of_trials(
        rows[~rows["is_practice"].astype(bool)],
        analysis.selection.finished,
        max_trial_lost_01=next((limits[c] for c in LOSS_COLUMNS if c in limits), None),
        facts=facts,
        people=analysis.people,
        max_error_deg=limits.get("calibration_error_deg"),
    )


_SESSION_QUALITY = {
    END_ACCURACY: ("Accuracy at the end (°)", 2),
    DRIFT: ("Drift to the end (°)", 2),
    REJECTED: ("Validations rejected", 0),
}


def quality_table(quality: Quality) -> Table:
    """Return accuracy, precision and loss by participant."""
    table = quality.participants
    optional = [(name, *_SESSION_QUALITY[name]) for name in SESSION_COLUMNS if name in table]
    columns = (
        Column("Participant"),
        Column("Accuracy (°)", "right"),
        Column("Worst point (°)", "right"),
        Column("Precision (° RMS-S2S)", "right"),
        Column("Lost gaze", "right"),
        Column("Validations in force", "right"),
        Column("Trials finished", "right"),
        Column("Trials over the limit", "right"),
        *(Column(header, "right") for _, header, _ in optional),
    )
    rows = tuple(
        (
            str(r["participant"]),
            decimal(r["accuracy_deg"], 2),
            decimal(r["worst_point_deg"], 2),
            decimal(r["precision_deg"], 2),
            percentage(r["lost_01"]),
            str(r["calibrations"]),
            str(r["trials"]),
            str(r["trials_out"]),
            *(decimal(r[name], digits) for name, _, digits in optional),
        )
        for r in table.to_dict("records")
    )
    return Table(columns, rows, "Data quality by participant")
