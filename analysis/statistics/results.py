"""The base of all statistical results, and the APA notation in which they are printed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
Cell: TypeAlias = str | int | float | bool | None
Row: TypeAlias = Mapping[str, Cell]

MINUS = "\N{MINUS SIGN}"
NO_CLAIM = "do not rest a claim on it"
"""Ends a note about an effect whose p alone is not reliable; the note begins with its name."""


@dataclass(frozen=True)
class Provenance:
    """Say how a number came about.

    `n` counts what the test saw (subjects, pairs or rows, as `unit` says); `dropped` names what
    was left out before that; `notes` are conventions and warnings a reader must know.
    """

    test: str
    n: int
    unit: str = "subjects"
    error_term: str = ""
    correction: str = "none"
    dropped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def row(self) -> Row:
        """Return the provenance as columns of a table row."""
        return {
            "test": self.test,
            "n": self.n,
            "error_term": self.error_term,
            "correction": self.correction,
            "dropped": "; ".join(self.dropped),
            "notes": "; ".join(self.notes),
        }


@dataclass(frozen=True)
class Interval:
    """A confidence interval at `level` (0..1)."""

    low: float
    high: float
    level: float = 0.95

    def __str__(self) -> str:
        return f"{percent(self.level)} CI [{number(self.low)}, {number(self.high)}]"


@dataclass(frozen=True)
class Effect:
    """An effect size; `interval` is None where none can be given."""

    name: str
    value: float
    interval: Interval | None = None

    def __str__(self) -> str:
        text = f"{self.name} = {number(self.value)}"
        return text if self.interval is None else f"{text}, {self.interval}"

    def row(self) -> Row:
        """Return name, value and interval as columns of a table row."""
        return {
            "effect": self.name,
            "effect_size": self.value,
            "effect_ci_low": None if self.interval is None else self.interval.low,
            "effect_ci_high": None if self.interval is None else self.interval.high,
        }


class Result:
    """Base of results: `sentence()` for the text, `row()` for a table."""

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        raise NotImplementedError

    def row(self) -> Row:
        """Return the result as one flat table row."""
        raise NotImplementedError

    def __str__(self) -> str:
        return self.sentence()


def number(value: float, digits: int = 2) -> str:
    """Format a number with a true minus sign.

    Two digits suit statistics and effect sizes; with three or more, for quantities in units of
    the data, a value too small for them is written with an exponent instead of as zero.
    """
    if np.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    if np.isnan(value):
        return "undefined"
    is_lost = digits > 2 and value != 0 and abs(value) < 0.5 * 10**-digits
    text = f"{value:.1e}" if is_lost else f"{value + 0.0:.{digits}f}"
    if not is_lost and float(text) == 0:
        text = text.removeprefix("-")
    return text.replace("-", MINUS)


def quantities(*values: float) -> tuple[str, ...]:
    """Format numbers in the unit of the data, all with as many decimals as the largest deserves.

    The largest keeps three significant digits, and none has more than three decimals.
    """
    largest = max((abs(v) for v in values if np.isfinite(v)), default=0.0)
    digits = 3 if largest == 0 else int(np.clip(2 - np.floor(np.log10(largest)), 0, 3))
    return tuple(number(value, digits) for value in values)


def degrees(df: float) -> str:
    """Format degrees of freedom: whole numbers plain, fractions with two digits."""
    return f"{round(df)}" if abs(df - round(df)) < 1e-6 else f"{df:.2f}"


def p_text(p: float, name: str = "p") -> str:
    """Format a probability the APA way: no leading zero, three digits, < .001 below that."""
    if np.isnan(p):
        return f"{name} undefined"
    if p < 0.001:
        return f"{name} < .001"
    text = f"{min(p, 1.0):.3f}"
    return f"{name} = {text.lstrip('0') if text.startswith('0') else text}"


def threshold_text(value: float) -> str:
    """Format a significance threshold with three significant digits and no leading zero."""
    text = f"{value:.3g}"
    return text.removeprefix("0") if "e" not in text else text


def percent(level: float) -> str:
    """Format a confidence level as a percentage."""
    return f"{100 * level:.4g}%"


def f_text(statistic: float, df1: float, df2: float) -> str:
    """Format an F statistic."""
    return f"F({degrees(df1)}, {degrees(df2)}) = {number(statistic)}"
