"""Which trials and participants go into the analysis, and why the others do not."""

from dataclasses import dataclass

import pandas as pd

from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.comparisons import MEASURES
from experiments.stare.design import CONDITIONS
from lab.errors import DataError
from recording.integrity import DAMAGED, LOST
from visavis.exclusions import mean_error_deg

LOSS_COLUMN = "lost_01"
ERROR_COLUMN = "calibration_accuracy_deg"
REQUIRED_COLUMNS = (
    "participant",
    "condition",
    "place",
    "zone",
    LOSS_COLUMN,
    *(m.column for m in MEASURES),
)


@dataclass(frozen=True)
class Excluded:
    """A trial, or a participant with all trials (`trial_id` None), left out."""

    participant: str
    trial_id: str | None
    reason: str


@dataclass(frozen=True)
class Flow:
    """How many went in and what became of them.

    `performed` counts experimental trials tried, `complete` those finished once each;
    `damaged` cannot be read any more; `superseded` were finished and then repeated. `lost` trials
    had too little gaze, of participants who stayed in; `with_participants` went out with a
    participant.
    """

    participants: int
    participants_out: int
    performed: int
    unfinished: int
    superseded: int
    complete: int
    lost: int
    with_participants: int
    analysed: int
    damaged: int = 0

    @property
    def participants_in(self) -> int:
        """Participants analysed."""
        return self.participants - self.participants_out


@dataclass(frozen=True)
class Selection:
    """`kept` rows are analysed; `complete` are all finished rows, for the analysis without rules.

    `uncalibrated` names participants whose calibration error is unknown; they stay in.
    """

    kept: pd.DataFrame
    complete: pd.DataFrame
    excluded: tuple[Excluded, ...]
    flow: Flow
    uncalibrated: tuple[str, ...]


def select_trials(trials: pd.DataFrame, parameters: AnalysisParameters) -> Selection:
    """Apply the exclusion rules to rows of trials, practice included.

    Rows are optional in `is_practice`, `status`, `attempt` and `calibration_*`: without them
    every row is a finished experimental trial of unknown calibration. Of a trial finished twice
    the last attempt counts. Raises DataError for missing columns or unknown conditions.
    """
    checked = _checked(trials)
    performed = len(checked)
    finished = checked[checked["status"] == "complete"]
    damaged = checked[checked["status"].isin((DAMAGED, LOST))]
    complete = finished.sort_values("attempt", kind="stable").drop_duplicates(
        ["participant", "session", "trial_id"], keep="last"
    )
    complete = complete.sort_index()
    has_gaze = complete[LOSS_COLUMN] <= parameters.max_trial_lost_01
    out = _participants_out(complete, has_gaze, parameters)
    stays = ~complete["participant"].isin([o.participant for o in out])
    lost = complete[stays & ~has_gaze]
    kept = complete[stays & has_gaze]
    excluded = [*out]
    for row in lost.itertuples(index=False):
        share = getattr(row, LOSS_COLUMN)
        reason = "share of lost gaze unknown" if pd.isna(share) else f"{100 * share:.0f} % lost"
        excluded.append(Excluded(str(row.participant), str(row.trial_id), reason))
    excluded += [
        Excluded(str(row.participant), str(row.trial_id), str(row.reason))
        for row in damaged.itertuples(index=False)
    ]
    return Selection(
        kept=kept.reset_index(drop=True),
        complete=complete.reset_index(drop=True),
        excluded=tuple(excluded),
        flow=Flow(
            participants=int(checked["participant"].nunique()),
            participants_out=len(out),
            performed=performed,
            unfinished=performed - len(finished) - len(damaged),
            superseded=len(finished) - len(complete),
            complete=len(complete),
            lost=len(lost),
            with_participants=int((~stays).sum()),
            analysed=len(kept),
            damaged=len(damaged),
        ),
        uncalibrated=tuple(
            str(name)
            for name, rows in complete.groupby("participant", sort=True)
            if rows[ERROR_COLUMN].isna().all()
        ),
    )


def _checked(trials: pd.DataFrame) -> pd.DataFrame:
    missing = [c for c in REQUIRED_COLUMNS if c not in trials.columns]
    if missing:
        raise DataError(
            f"the trial table lacks {', '.join(missing)}; it holds {', '.join(trials.columns)}. "
            "Make it again from the recordings with `visavis analyse`"
        )
    rows = trials.reset_index(drop=True)
    for column, value in (("status", "complete"), ("attempt", 1), ("session", 1)):
        if column not in rows:
            rows[column] = value
    if "trial_id" not in rows:
        rows["trial_id"] = [f"row {i + 1}" for i in range(len(rows))]
    if ERROR_COLUMN not in rows:
        rows[ERROR_COLUMN] = float("nan")
    if "is_practice" in rows:
        rows = rows[~rows["is_practice"].astype(bool)].reset_index(drop=True)
    rows["participant"] = rows["participant"].astype(str)
    numeric = [LOSS_COLUMN, ERROR_COLUMN, *(m.column for m in MEASURES)]
    rows[numeric] = rows[numeric].astype(float)
    unknown = sorted(set(rows["condition"].astype(str)) - set(CONDITIONS))
    if unknown:
        raise DataError(
            f"the trial table holds the condition {unknown[0]!r}; this study has "
            f"{', '.join(CONDITIONS)}. Check that all recordings are of one study"
        )
    return rows


def _participants_out(
    complete: pd.DataFrame, has_gaze: "pd.Series[bool]", parameters: AnalysisParameters
) -> list[Excluded]:
    out = []
    for name, rows in complete.groupby("participant", sort=True):
        reasons = []
        bad_01 = float((~has_gaze[rows.index]).mean())
        if bad_01 > parameters.max_bad_trials_01:
            reasons.append(f"{100 * bad_01:.0f} % of {len(rows)} trials without enough gaze")
        error = mean_error_deg(rows)
        if error > parameters.max_error_deg:
            reasons.append(f"mean calibration error {error:.1f}°")
        if reasons:
            out.append(Excluded(str(name), None, "; ".join(reasons)))
    return out
