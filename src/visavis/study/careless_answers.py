"""Signs of careless answers: recorded for each person, used by rules of exclusion.

Nothing here excludes anybody. A study uses `facts` as facts about people, and those `rules` that
its plan states.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.study.exclusions import Exclusion

NOT_HEARD: Final = "sound not heard"
"""Flag on every trial of a participant who failed the sound check of a page."""
MAX_PATTERN: Final = 3
"""Length of the longest pattern that is checked."""
SIGNS: Final = {
    "same_answers": ("1", "how often the person gave the answer they gave most"),
    "patterned_01": ("1", "share of answers that repeat those two or three before"),
    "hasty_01": ("1", "share of answers that came too soon to be a judgement"),
    "retest_off": ("1", "mean difference of two answers to the same thing"),
    "checks_failed": ("1", "attention checks answered wrong or not at all"),
    "sound_failed": ("1", "1 where the digits that the page said were not heard, else 0"),
}


@dataclass(frozen=True)
@of_kinds()
class Careless:
    """The signs checked in the numeric answers to one question.

    Every sign has a limit: None where it is not checked, `infinity` to record it only.
    `max_same` counts answers that are the same, `max_patterned_01` is a share of answers that
    repeat a pattern of at most three; `max_hasty_01` is a share of answers given before
    `min_answer_ms`; `max_retest_off` is in steps of the answer, over trials alike in the factors
    `alike`; `max_checks_failed` counts wrong answers to the `checks`, questions with a right
    answer. `max_sound_failed` is 0 to exclude participants who failed the sound check.
    """

    response: str
    max_same: float | None = None
    max_patterned_01: float | None = None
    max_hasty_01: float | None = None
    min_answer_ms: float = 300.0
    max_retest_off: float | None = None
    alike: tuple[str, ...] = ()
    max_checks_failed: float | None = None
    checks: tuple[str, ...] = ()
    max_sound_failed: float | None = None

    def __post_init__(self) -> None:
        if self.max_retest_off is not None and not self.alike:
            raise DesignError("retest_off needs alike=: the factors that make two trials the same")
        if self.max_checks_failed is not None and not self.checks:
            raise DesignError("checks_failed needs checks=: questions with a right answer")

    @property
    def _limits(self) -> dict[str, float]:
        limits = {
            "same_answers": self.max_same,
            "patterned_01": self.max_patterned_01,
            "hasty_01": self.max_hasty_01,
            "retest_off": self.max_retest_off,
            "checks_failed": self.max_checks_failed,
            "sound_failed": self.max_sound_failed,
        }
        return {name: limit for name, limit in limits.items() if limit is not None}

    @property
    def columns(self) -> tuple[Column, ...]:
        """Column names of the signs in the table of people."""
        return tuple(Column(name, *SIGNS[name]) for name in self._limits)

    @property
    def rules(self) -> tuple[Exclusion, ...]:
        """The rules for the limits set: `max_same_answers`, `max_patterned_01`, and so on."""
        words = {
            "same_answers": "{value:.0f} answers the same (limit {limit:.0f})",
            "patterned_01": "{value:.0%} of the answers repeat a pattern of at most "
            f"{('one', 'two', 'three')[MAX_PATTERN - 1]} (limit {{limit:.0%}})",
            "hasty_01": "{value:.0%} of the answers came within "
            f"{self.min_answer_ms:g} ms (limit {{limit:.0%}})",
            "retest_off": "answers to the same thing {value:.2f} apart (limit {limit:.2f})",
            "checks_failed": "{value:.0f} attention checks failed (limit {limit:.0f})",
            "sound_failed": "what the page said was not heard",
        }
        what = {
            "same_answers": "a number of answers alike",
            "patterned_01": "a share of answers that repeat those two or three before",
            "hasty_01": f"a share of answers within {self.min_answer_ms:g} ms",
            "retest_off": "a mean difference of two answers to the same thing",
            "checks_failed": "a number of failed attention checks",
            "sound_failed": "a number of failed sound checks",
        }
        return tuple(
            Exclusion(f"max_{name}", "participant", name, limit, words[name], what=what[name])
            for name, limit in self._limits.items()
            if np.isfinite(limit)
        )

    def facts(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Return the signs, one row per participant; missing where there are too few answers.

        `rows` are all trials; finished ones that are not practice count, in order of their start.
        """
        main_trials = rows[(rows["status"] == "complete") & ~rows["is_practice"].astype(bool)]
        names = list(self._limits)
        signs = [
            {"participant": participant, **{name: self._sign(name, own) for name in names}}
            for participant, own in main_trials.sort_values("t_start_ns").groupby("participant")
        ]
        return pd.DataFrame(signs, columns=["participant", *names])

    def _sign(self, name: str, own: pd.DataFrame) -> float:
        if name == "sound_failed":
            return float(own["flags"].fillna("").str.contains(NOT_HEARD, regex=False).any())
        if name == "checks_failed":
            check_results = [own[f"{c}_is_right"][own[c].notna()] for c in self.checks if c in own]
            right = pd.concat(check_results) if check_results else pd.Series(dtype=object)
            return float((right.astype(str).str.lower() != "true").sum()) if len(right) else np.nan
        answers = pd.to_numeric(own[self.response], errors="coerce").to_numpy(np.float64)
        if name == "same_answers":
            counts = np.unique(answers[np.isfinite(answers)], return_counts=True)[1]
            return float(counts.max()) if counts.size else np.nan
        if name == "patterned_01":
            return patterned_01(answers)
        if name == "hasty_01":
            took = pd.to_numeric(own[f"{self.response}_ms"], errors="coerce").dropna()
            return float((took < self.min_answer_ms).mean()) if len(took) else np.nan
        return self._retest_off(own.assign(**{self.response: answers}))

    def _retest_off(self, own: pd.DataFrame) -> float:
        """Return the mean difference of successive answers to trials that are `alike`."""
        answer_rows = own[own[self.response].notna()]
        apart: Any = answer_rows.groupby(list(self.alike), sort=False)[self.response].diff().abs()
        return float(apart.mean())


def patterned_01(answers: npt.NDArray[np.float64]) -> float:
    """Return the share of answers equal to the one two or three before, whichever is larger.

    Missing for fewer than twice as many answers as the longest pattern.
    """
    if answers.size < 2 * MAX_PATTERN:
        return float("nan")
    return max(float(np.mean(answers[k:] == answers[:-k])) for k in range(2, MAX_PATTERN + 1))
