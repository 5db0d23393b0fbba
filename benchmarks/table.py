"""Figures as rows of a table, each beside its limit; benchmarks of single figures print theirs so.

"Ratio" is how much better than the limit a figure is: limit / value where less is better, value /
limit where more is. 1 or more is within the limit.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One printed figure; `limit` is None where there is none, `at_least` where more is better."""

    name: str
    value: float
    unit: str
    limit: float | None = None
    at_least: bool = False

    @property
    def ratio(self) -> float | None:
        """How many times better than the limit; None where there is none."""
        if self.limit is None:
            return None
        better, worse = (self.value, self.limit) if self.at_least else (self.limit, self.value)
        if worse > 0:
            return better / worse
        return 1.0 if worse == better else float("inf")

    @property
    def is_missed(self) -> bool:
        """Whether there is a limit and the figure is not within it."""
        return self.ratio is not None and self.ratio < 1


def show(rows: Sequence[Row], *, as_json: bool = False) -> int:
    """Print a table, or JSON; return the exit status: 1 where a limit is missed."""
    if as_json:
        keys = ("name", "value", "unit", "limit", "ratio")
        print(json.dumps([{k: getattr(row, k) for k in keys} for row in rows], indent=1))
    else:
        names, units = max(len(r.name) for r in rows), max(len(r.unit) for r in rows)
        for row in rows:
            value = f"{row.value:d}" if isinstance(row.value, int) else _short(row.value)
            limit = "" if row.limit is None else f"limit {row.limit:>6g}  ratio {row.ratio:.2f}"
            print(f"{row.name:<{names}} {value:>12} {row.unit:<{units}}  {limit}".rstrip())
    return int(any(row.is_missed for row in rows))


def _short(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"
