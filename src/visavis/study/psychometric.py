"""Psychometric functions of a study: which answers they are fitted to, and their measures."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from visavis.analysis.psychometric import (
    NoFitError,
    PsychometricFit,
    PsychometricFunction,
    fit_psychometric,
)
from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds, takes_kinds
from visavis.study.measures import Measure

if TYPE_CHECKING:
    import pandas as pd

Value = Literal["threshold", "slope", "lapse_01"]


@dataclass(frozen=True)
@of_kinds()
class Psychometric:
    """A psychometric function, fitted to the answers of every person at each level.

    `level` and `right` are the columns of a trial that hold the level and whether the answer was
    right; left out, they are those of the staircase, or QUEST+, called `name`. `guess` is the share
    of right answers by guessing (one divided by the number of options), `lapse` that of wrong ones
    whatever the level; None estimates them. In a task of yes and no "right" is a yes. See
    `visavis.analysis.psychometric` for the functions and how they are fitted.

    Raises:
        DesignError: a name or a number is not possible.
    """

    name: str
    level: str = ""
    right: str = ""
    guess: float | None = field(default=0.5, kw_only=True)
    lapse: float | None = field(default=None, kw_only=True)
    function: PsychometricFunction = field(default="weibull", kw_only=True)

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise DesignError(
                f"a psychometric function is called {self.name!r}; give letters, digits and _"
            )
        rates = [rate for rate in (self.guess, self.lapse) if rate is not None]
        if any(not 0 <= rate < 1 for rate in rates) or sum(rates) >= 1:
            raise DesignError(
                f"function {self.name}: guess and lapse are 0 or more and below 1 together"
            )

    @property
    def level_column(self) -> str:
        """The column of the level."""
        return self.level or f"{self.name}_level"

    @property
    def right_column(self) -> str:
        """The column that says whether the answer was right."""
        return self.right or f"{self.name}_is_right"

    def fit(self, trials: "pd.DataFrame") -> PsychometricFit:
        """Return the function fitted to all trials with an answer.

        Raises:
            NoFitError: they lead to none; the message says why.
        """
        missing = [c for c in (self.level_column, self.right_column) if c not in trials]
        if missing:
            raise NoFitError(f"no trial has {' and '.join(missing)}")
        rows = trials[[self.level_column, self.right_column]].dropna()
        answers = zip(
            rows[self.level_column].astype(float),
            rows[self.right_column].astype(bool),
            strict=True,
        )
        return _fit(self, tuple(sorted(answers)))


@lru_cache(maxsize=4096)
def _fit(of: Psychometric, answers: tuple[tuple[float, bool], ...]) -> PsychometricFit:
    """Return a fit; figures, tables and tests ask for the same ones."""
    levels, right = np.array(answers, np.float64).reshape(-1, 2).T
    return fit_psychometric(levels, right, guess=of.guess, lapse=of.lapse, function=of.function)


@dataclass(frozen=True)
class FittedValue:
    """A number of the function fitted to the trials of a cell; None where nothing can be fitted."""

    of: Psychometric
    value: Value

    @property
    def reads(self) -> tuple[str, ...]:
        """The columns to which it is fitted."""
        return (self.of.level_column, self.of.right_column)

    def __call__(self, trials: "pd.DataFrame") -> float | None:
        """Return the number for some trials."""
        try:
            return float(getattr(self.of.fit(trials), self.value))
        except NoFitError:
            return None


@takes_kinds()
def psychometric_measures(of: Psychometric) -> tuple[Measure, ...]:
    """Return threshold, slope and lapses of a psychometric function, fitted in every cell.

    Columns: `NAME_fit_threshold`, `NAME_fit_slope`, `NAME_fit_lapse_01`. A study with them gets a
    section on its functions in the report, and the table `psychometric.csv`.
    """
    words = of.name.replace("_", " ")
    values: tuple[tuple[Value, str], ...] = (
        ("threshold", f"Threshold of {words}, fitted"),
        ("slope", f"Slope of {words}, fitted"),
        ("lapse_01", f"Lapses of {words}, fitted"),
    )
    return tuple(
        Measure(f"{of.name}_fit_{value}", "1", text, None, "fit", of_cell=FittedValue(of, value))
        for value, text in values
        if value != "lapse_01" or of.lapse is None
    )
