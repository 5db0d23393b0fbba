"""Figures as rows of a table, each beside its limit; benchmarks of single figures print theirs so.

"Ratio" is how much better than the limit a figure is: limit / value where less is better, value /
limit where more is. 1 or more is within the limit.

A floor is what the same computer needs, in the same run, for the part of the work that nobody can
leave out: a driver's own calls, one pass over the memory, an encoder alone. Where a floor itself
misses the limit, it says by a measurement why the limit is out of reach on that computer, and the
row's "times" how far above the floor the figure is. A floor of code of ours tells where the time
is and explains nothing: it would grow with our own mistakes.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One printed figure; `limit` is None where there is none, `at_least` where more is better.

    `floor` is the best that this computer can reach, and `floor_name` what was measured for it;
    `floor_is_ours` where that is code of Visavis.
    """

    name: str
    value: float
    unit: str
    limit: float | None = None
    at_least: bool = False
    floor: float | None = None
    floor_name: str = ""
    floor_is_ours: bool = False

    @property
    def ratio(self) -> float | None:
        """How many times better than the limit; None where there is none."""
        return None if self.limit is None else self._times_better(self.value, self.limit)

    @property
    def is_missed(self) -> bool:
        """Whether there is a limit and the figure is not within it."""
        return self.ratio is not None and self.ratio < 1

    @property
    def is_explained(self) -> bool:
        """Whether the limit is out of reach on this computer: the floor misses it, too."""
        if self.limit is None or self.floor is None or self.floor_is_ours:
            return False
        return self._times_better(self.floor, self.limit) < 1

    @property
    def floor_line(self) -> str:
        """What the floor is, and how many times as much the figure is."""
        if self.floor is None:
            return ""
        if min(self.value, self.floor) <= 0:
            return f"{self.floor_name}: {_short(self.floor)} {self.unit}".rstrip()
        times = 1 / self._times_better(self.value, self.floor)
        least = f"{_short(self.floor)} {self.unit}".rstrip()
        return f"{self.floor_name}: {least}; this is {times:.2f} times that"

    def _times_better(self, value: float, than: float) -> float:
        better, worse = (value, than) if self.at_least else (than, value)
        if worse > 0:
            return better / worse
        return 1.0 if worse == better else float("inf")


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
            if row.floor is not None:
                print(f"    {row.floor_line}")
    return int(any(row.is_missed for row in rows))


def _short(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"
