"""What made the active agent's gaze change, and whether that was a look or a passing glance."""

from dataclasses import dataclass

import pandas as pd

from analysis.report.notation import counted, percentage
from lab.clock import NS_PER_MS
from visavis.looks import FIRST_FIXATION_DURATION_MS, FIRST_FIXATION_TIME_MS

CHANGING = ("AD", "DA")
TOLERANCE_MS = 1.0
"""Far below the time between samples: the same sample, counted from the trial's start."""

_NEEDED = (
    "condition",
    "switch_cause",
    "look_ns",
    "t_start_ns",
    FIRST_FIXATION_TIME_MS,
    FIRST_FIXATION_DURATION_MS,
)


@dataclass(frozen=True)
class GazeChanges:
    """How many trials of AD and DA changed by a look and by time alone.

    `began_fixation` of the `by_look` changes fell into the first fixation on the active agent;
    the others were caused by a glance shorter than a fixation.
    """

    by_look: int
    by_time: int
    began_fixation: int

    @property
    def share_01(self) -> float:
        """Share of look-caused changes that began a fixation; NaN without any."""
        return self.began_fixation / self.by_look if self.by_look else float("nan")

    def sentence(self) -> str:
        """Return the counts in words."""
        total = self.by_look + self.by_time
        if not total:
            return "No trial with a change of the agent's gaze was analysed."
        text = (
            f"In {self.by_look} of {counted(total, 'trial')} with averted-then-directed or "
            "directed-then-averted gaze a look caused the change"
        )
        if not self.by_look:
            return f"{text}; in the others time did."
        return (
            f"{text}; {self.began_fixation} of these {self.by_look} looks "
            f"({percentage(self.share_01, 0)}) were fixations on the active agent, the others "
            "glances."
        )


def gaze_changes(rows: pd.DataFrame) -> GazeChanges | None:
    """Count the changes of finished trials; None when the table does not say what caused them."""
    if any(name not in rows for name in _NEEDED):
        return None
    changing = rows[rows["condition"].isin(CHANGING)]
    by_look = changing[changing["switch_cause"] == "look"]
    look_ms = (by_look["look_ns"].astype(float) - by_look["t_start_ns"].astype(float)) / NS_PER_MS
    onset_ms = by_look[FIRST_FIXATION_TIME_MS].astype(float)
    end_ms = onset_ms + by_look[FIRST_FIXATION_DURATION_MS].astype(float)
    began = (look_ms >= onset_ms - TOLERANCE_MS) & (look_ms <= end_ms + TOLERANCE_MS)
    return GazeChanges(
        len(by_look), int((changing["switch_cause"] == "time").sum()), int(began.sum())
    )
