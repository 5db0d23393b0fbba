"""Numbers as a paper prints them: the value, and the interval that rounding hides."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from itertools import product
from typing import TypeAlias

import numpy as np

from visavis.analysis.statistics.errors import NotNumeric
from visavis.analysis.statistics.results import Result, Row

Printed: TypeAlias = str | float | int
"""A number as printed. Text keeps trailing zeros ('2.50'); '<.001' is a bound."""


@dataclass(frozen=True)
class Figure:
    """A printed number: `half_unit` is half a unit of its last digit; `is_bound` means '<'."""

    text: str
    value: float
    half_unit: float
    is_bound: bool = False


@dataclass(frozen=True)
class Verdict:
    """Verdict on whether one printed number follows from the others; `remark` says how it fails."""

    printed: str
    computed: float | None
    interval: tuple[float, float] | None
    is_consistent: bool
    remark: str = ""


@dataclass(frozen=True)
class PublishedCheck(Result):
    """Values that follow from printed numbers, with verdicts on the other printed numbers.

    `values` are computed from the inputs as printed; `verdicts` has one entry per number checked.
    """

    what: str
    inputs: Mapping[str, object]
    values: Mapping[str, float]
    verdicts: Mapping[str, Verdict] = field(default_factory=dict)

    @property
    def is_consistent(self) -> bool:
        """Tell whether every printed number agrees with the others."""
        return all(v.is_consistent for v in self.verdicts.values())

    def sentence(self) -> str:
        """Return the verdict as a sentence."""
        inputs = ", ".join(f"{k} = {v}" for k, v in self.inputs.items())
        parts = []
        for name, verdict in self.verdicts.items():
            value = "" if verdict.computed is None else f" (computed {verdict.computed:.4g})"
            agree = "fits" if verdict.is_consistent else verdict.remark or "does not fit"
            parts.append(f"{name} printed {verdict.printed!r}{value}: {agree}")
        return f"{self.what}, {inputs}: " + ("; ".join(parts) or "nothing to compare")

    def row(self) -> Row:
        """Return the check as one flat table row."""
        row: dict[str, str | float | int | bool | None] = {
            "what": self.what,
            "is_consistent": self.is_consistent,
        }
        row.update(self.values)
        for name, verdict in self.verdicts.items():
            row[f"{name}_printed"] = verdict.printed
            row[f"{name}_fits"] = verdict.is_consistent
            row[f"{name}_remark"] = verdict.remark
        return row


def read_printed(printed: Printed) -> Figure:
    """Read a printed number; text may hold '<', '%', 'approximately' and a missing zero."""
    text = str(printed).strip().replace("−", "-").replace(",", ".")
    match = re.search(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", text, re.IGNORECASE)
    if match is None:
        raise NotNumeric(f"no number in the printed value {printed!r}")
    try:
        number = Decimal(match.group())
    except InvalidOperation as error:
        raise NotNumeric(f"no number in the printed value {printed!r}") from error
    exponent = number.as_tuple().exponent
    unit = Decimal(1).scaleb(exponent if isinstance(exponent, int) else 0)
    scale = 0.01 if "%" in text else 1.0
    return Figure(text, float(number) * scale, float(unit) / 2 * scale, "<" in text)


def rounding_interval(
    function: Callable[..., float], *figures: Figure, exact: tuple[float, ...] = ()
) -> tuple[float, float]:
    """Return the range of a function over the rounding of its printed arguments, by corners.

    `exact` arguments follow the rounded ones. The function must be monotone in each argument.
    """
    corners = product(*((f.value - f.half_unit, f.value + f.half_unit) for f in figures))
    values = [function(*corner, *exact) for corner in corners]
    return float(min(values)), float(max(values))


def judge(
    printed: Printed,
    computed: float,
    interval: tuple[float, float] | None = None,
    *,
    allow_truncation: bool = False,
) -> Verdict:
    """Judge a printed number against what was computed, or the interval rounding leaves it.

    It fits when it lies within the interval widened by half a unit of its last digit; a bound
    ('<.001') fits when some value of the interval lies below it.
    """
    figure = read_printed(printed)
    low, high = interval or (computed, computed)
    if figure.is_bound:
        fits = low < figure.value
        remark = "" if fits else "the bound does not hold"
        return Verdict(str(printed), computed, interval, fits, remark)
    slack = figure.half_unit * (1 + 1e-9) + 1e-15
    fits = low - slack <= figure.value <= high + slack
    unit = 2 * figure.half_unit
    cut = {np.trunc(v / unit + np.sign(v) * 1e-9) * unit for v in (low, computed, high)}
    is_cut_off = any(abs(c - figure.value) < unit * 1e-6 for c in cut)
    if not fits and is_cut_off:
        return Verdict(
            str(printed), computed, interval, allow_truncation, "cut off instead of rounded"
        )
    remark = "" if fits else "does not follow from the printed statistic"
    return Verdict(str(printed), computed, interval, fits, remark)
