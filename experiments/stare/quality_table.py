"""Data quality by participant: what the validations measured and how much gaze was lost."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import pandas as pd

from experiments.stare.exclusions import ERROR_COLUMN, LOSS_COLUMN, Selection, mean_error_deg

QUALITY_COLUMNS = ("accuracy_deg", "precision_deg", "lost_01")


@dataclass(frozen=True)
class StareQuality:
    """Quality as the report shows it.

    `participants` has one row each: participant, accuracy_deg, precision_deg, worst_point_deg,
    lost_01, calibrations, trials, trials_out; NaN where unknown. `facts` adds lines of the
    reporting list that recordings answer (tracker, rates, filters). `incidents` lists
    interruptions and deviations as participant, what, reason.
    """

    participants: pd.DataFrame
    facts: Mapping[str, str] = field(default_factory=dict)
    incidents: tuple[tuple[str, str, str], ...] = ()


def quality_of_trials(
    trials: pd.DataFrame,
    selection: Selection,
    *,
    max_trial_lost_01: float,
    facts: Mapping[str, str] | None = None,
) -> StareQuality:
    """Take the quality from the calibration and loss columns of the trial table."""
    rows = []
    for name, part in selection.complete.groupby("participant", sort=True):
        distinct = (
            part.drop_duplicates("calibration_id") if "calibration_id" in part.columns else part
        )
        rows.append(
            {
                "participant": str(name),
                "accuracy_deg": mean_error_deg(part),
                "precision_deg": _mean(distinct, "calibration_precision_deg"),
                "worst_point_deg": _largest(distinct, "calibration_worst_point_deg"),
                "lost_01": _mean(part, LOSS_COLUMN),
                "calibrations": int(distinct[ERROR_COLUMN].notna().sum())
                if "calibration_id" in part.columns
                else 0,
                "trials": len(part),
                "trials_out": int((~(part[LOSS_COLUMN] <= max_trial_lost_01)).sum()),
            }
        )
    return StareQuality(
        pd.DataFrame(
            rows,
            columns=[
                "participant",
                "accuracy_deg",
                "precision_deg",
                "worst_point_deg",
                "lost_01",
                "calibrations",
                "trials",
                "trials_out",
            ],
        ),
        dict(facts or {}),
        _incidents(trials),
    )


def _mean(rows: pd.DataFrame, column: str) -> float:
    return float(rows[column].astype(float).mean()) if column in rows else float("nan")


def _largest(rows: pd.DataFrame, column: str) -> float:
    return float(rows[column].astype(float).max()) if column in rows else float("nan")


def _incidents(trials: pd.DataFrame) -> tuple[tuple[str, str, str], ...]:
    found = []
    for row in trials.to_dict("records"):
        who, trial = str(row["participant"]), str(row.get("trial_id", ""))
        status = row.get("status", "complete")
        if status != "complete":
            reason = row.get("reason")
            why = str(reason) if isinstance(reason, str) and reason else "no reason given"
            found.append((who, f"trial {trial} {status}", why))
        flags = row.get("flags")
        if isinstance(flags, str) and flags:
            found.append((who, f"trial {trial} flagged", flags))
    return tuple(found)
