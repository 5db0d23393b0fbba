"""Rules that exclude trials and people from an analysis, with limits stored in the plan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from visavis.lab.errors import UsageError
from visavis.lab.kinds import of_kinds
from visavis.study.measures import CLOCK_JUMP, HEAD_LOST_COLUMN, LOST_COLUMN

Level = Literal["trial", "participant"]
ANSWERED_COLUMN: Final = "answered_01"
"""Column of each person's share of answered questions among the required ones."""


COLUMN_WORDS: Final[Mapping[str, str]] = {
    LOST_COLUMN: "share of the scene without usable gaze",
    "lost_01": "share of the trial without usable gaze",
    HEAD_LOST_COLUMN: "share of the trial without a tracked head",
    CLOCK_JUMP.name: "jump of the eye tracker's clock in ms",
    "bad_trials_01": "share of trials left out",
    "calibration_error_deg": "mean calibration error in degrees",
    "completed_01": "share of planned trials finished",
    "smallest_cell_trials": "trials in the emptiest cell",
    "smallest_cell_01": "share of planned trials in the emptiest cell",
    ANSWERED_COLUMN: "share of required questions answered",
}
"""The columns that the standard rules compare with their limits, in words."""


@dataclass(frozen=True)
@of_kinds()
class Exclusion:
    """A rule: a `column` above (or below) a `limit` excludes a trial or a participant.

    For participants the column is one of `participant_facts`. `words` give the reason, with
    {value} and {limit}. `name` is the parameter that sets the limit (`analyse --set NAME=…`);
    a limit of None switches the rule off. A value equal to the limit is kept. With `if_missing`
    only a missing value excludes, with `missing_is_out` a missing value excludes as well.
    """

    name: str
    level: Level
    column: str
    limit: float | None
    words: str
    above: bool = True
    if_missing: bool = False
    missing_is_out: bool = False
    what: str = ""
    """The column in words, as in "trials with WHAT above 0.5"."""

    @property
    def column_words(self) -> str:
        """The column compared with the limit, in words."""
        return self.what or COLUMN_WORDS.get(self.column, self.column.replace("_", " "))

    def breaks(self, value: Any, limit: float | None) -> bool:
        """Tell whether a value breaks the rule; missing values break only rules about them."""
        if limit is None:
            return False
        if _is_missing(value):
            return self.if_missing or self.missing_is_out
        if self.if_missing:
            return False
        return bool(value > limit) if self.above else bool(value < limit)

    def rule(self, limit: float | None) -> str:
        """Return in words what the rule excludes."""
        whom = "trials" if self.level == "trial" else "participants"
        if self.if_missing:
            return f"{whom} without {self.column} ({self.name})"
        side = "above" if self.above else "below"
        return f"{whom} with {self.column_words} ({self.name}) {side} {limit:g}"

    def reason(self, value: Any, limit: float | None) -> str:
        """Return in words why a value is excluded."""
        if _is_missing(value) and not self.if_missing:
            return f"{self.column} is not known"
        return self.words.format(value=value, limit=limit)


def _is_missing(value: Any) -> bool:
    return value is None or bool(value != value)


COMPLETENESS_RULES: Final = (
    Exclusion(
        "min_completed_01",
        "participant",
        "completed_01",
        0.75,
        "{value:.0%} of the planned trials finished (limit {limit:.0%})",
        above=False,
    ),
    Exclusion(
        "min_cell_trials",
        "participant",
        "smallest_cell_trials",
        1.0,
        "{value:.0f} trials in the emptiest cell (limit {limit:.0f})",
        above=False,
    ),
    Exclusion(
        "min_cell_01",
        "participant",
        "smallest_cell_01",
        0.5,
        "{value:.0%} of the trials planned for a cell count in the emptiest one "
        "(limit {limit:.0%})",
        above=False,
    ),
    Exclusion(
        "min_answered_01",
        "participant",
        ANSWERED_COLUMN,
        0.5,
        "{value:.0%} of the questionnaires' required questions answered (limit {limit:.0%})",
        above=False,
    ),
)
"""Exclusion rules for participants with too little data. They apply to every study."""

CLOCK_RULE: Final = Exclusion(
    "max_clock_jump_ms",
    "trial",
    CLOCK_JUMP.name,
    20.0,
    "the eye tracker's clock jumped by {value:.0f} ms (limit {limit:.0f} ms)",
)
"""For every study of gaze: after a jump, samples were turned by the head of another moment."""

STANDARD_RULES: Final = (
    CLOCK_RULE,
    Exclusion(
        "max_trial_lost_01",
        "trial",
        LOST_COLUMN,
        0.5,
        "{value:.0%} of the scene without usable gaze (limit {limit:.0%})",
    ),
    Exclusion(
        "max_head_lost_01",
        "trial",
        HEAD_LOST_COLUMN,
        0.5,
        "the head not tracked for {value:.0%} of the trial (limit {limit:.0%})",
    ),
    Exclusion(
        "max_bad_trials_01",
        "participant",
        "bad_trials_01",
        0.5,
        "{value:.0%} of the trials left out (limit {limit:.0%})",
    ),
    Exclusion(
        "max_calibration_error_deg",
        "participant",
        "calibration_error_deg",
        3.0,
        "mean calibration error {value:.2f}° (limit {limit:.2f}°)",
    ),
    *COMPLETENESS_RULES,
)
"""The rules of every study, unless the study gives its own."""

STANDARD_COLUMNS: Final = frozenset(rule.column for rule in STANDARD_RULES)
"""Columns that rules may name in every study, even where they are not measured."""


def needs_answer(response: str) -> Exclusion:
    """Return the rule that excludes trials in which a question was not answered."""
    return Exclusion(
        f"needs_{response}", "trial", response, 1.0, f"no answer to {response}", if_missing=True
    )


def limits_in_force(
    rules: Sequence[Exclusion], overrides: Mapping[str, Any]
) -> dict[str, float | None]:
    """Return the limit of every rule, with the settings in place of the study's own.

    Raises:
        UsageError: a limit is not a number, below 0, or a share above 1.
    """
    limits: dict[str, float | None] = {r.name: r.limit for r in rules}
    for name, value in overrides.items():
        if name in limits:
            limits[name] = None if value is None else _limit(name, value)
    return limits


def _limit(name: str, value: Any) -> float:
    is_share = name.endswith("_01")
    try:
        limit = float(value)
    except (TypeError, ValueError):
        limit = -1.0
    if not 0 <= limit < np.inf or (is_share and limit > 1):
        hint = "a share from 0 to 1" if is_share else "a number from 0"
        raise UsageError(f"{name} is {value}; give {hint}, or null for no such rule")
    return limit
