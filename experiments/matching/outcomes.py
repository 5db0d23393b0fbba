"""What matching came to: guesses and times as tables of people and targets, and their tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import special

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.signed_rank import wilcoxon_signed_rank
from visavis.analysis.statistics.survival import SurvivalTimes, survival_times
from visavis.experiments.matching.published import ALL, PAIRS
from visavis.lab.geometry import Vector

SAVED_LEVEL = 0.9
"""Level of the interval of the time saved, as in the source's figure 10."""


@dataclass(frozen=True)
class PairTest:
    """Wilcoxon's test of two interfaces at one target, or over `all`: p by the normal approximation
    without continuity correction, as the source's, and exactly; NaN where nothing differs.

    `better` is the interface with the smaller values in most pairs; "" where neither is.
    """

    measure: str
    first: str
    second: str
    target: str
    n: int
    p_normal: float
    p_exact: float
    better: str


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Rows of a study's trials that count, with its targets and interfaces in force."""

    rows: pd.DataFrame
    targets: tuple[str, ...]
    interfaces: tuple[str, ...]

    @cached_property
    def tables(self) -> Mapping[str, Mapping[str, pd.DataFrame]]:
        """Tables (people, targets) by measure and interface; NaN where there was no trial."""
        return {
            measure: {i: self._table(measure, phase, i) for i in self.interfaces}
            for measure, phase in (
                ("guess_m", "guess"),
                ("is_guessed", "guess"),
                ("time_s", "adjust"),
                ("is_matched", "adjust"),
                ("distance_m", "adjust"),
            )
        }

    def _table(self, measure: str, phase: str, interface: str) -> pd.DataFrame:
        own = self.rows[(self.rows["phase"] == phase) & (self.rows["interface"] == interface)]
        values = own[measure].astype(float) if measure in own else np.nan
        frame = own.assign(value=values)
        table = frame.pivot_table("value", "participant", "target", "mean", dropna=False)
        return table.reindex(columns=list(self.targets))

    def values(self, measure: str, interface: str, target: str) -> Vector:
        """Return all values at a target, or over all targets."""
        table = self.tables[measure][interface]
        own = table if target == ALL else table[[target]]
        values: Vector = own.to_numpy(dtype=np.float64).ravel()
        return values[np.isfinite(values)]

    def pairs(self, measure: str, first: str, second: str, target: str) -> Vector:
        """Return differences, second less first, of each person and target with both."""
        a, b = self.tables[measure][first], self.tables[measure][second]
        people = a.index.intersection(b.index)
        columns = list(self.targets) if target == ALL else [target]
        apart = b.loc[people, columns] - a.loc[people, columns]
        values: Vector = apart.to_numpy(dtype=np.float64).ravel()
        return values[np.isfinite(values)]

    def test(self, measure: str, first: str, second: str, target: str) -> PairTest:
        """Test a pair of interfaces as the source did."""
        d = self.pairs(measure, first, second, target)
        p = []
        for method in ("normal", "exact"):
            try:
                p.append(wilcoxon_signed_rank(d, method=method).p)
            except StatisticsError:
                p.append(float("nan"))
        smaller = int((d > 0).sum()) - int((d < 0).sum())
        better = first if smaller > 0 else second if smaller < 0 else ""
        return PairTest(measure, first, second, target, len(d), p[0], p[1], better)

    def tests(self, measure: str) -> tuple[PairTest, ...]:
        """Return the tests of all pairs of interfaces, at every target and over all."""
        there = [(a, b) for a, b in PAIRS if {a, b} <= set(self.interfaces)]
        return tuple(
            self.test(measure, a, b, target) for a, b in there for target in (*self.targets, ALL)
        )

    def saved(self, interface: str, target: str) -> tuple[float, float, float]:
        """Return the mean time that an interface saves against weights, with its 90 % interval."""
        d = self.pairs("time_s", interface, "weights", target)
        if len(d) < 2:
            return float("nan"), float("nan"), float("nan")
        half = special.stdtrit(len(d) - 1, (1 + SAVED_LEVEL) / 2) * d.std(ddof=1) / np.sqrt(len(d))
        return float(d.mean()), float(d.mean() - half), float(d.mean() + half)

    def survival(self) -> SurvivalTimes:
        """Return times of adjusting until the match, censored at the limit, with people as
        clusters and targets as strata.

        Raises:
            StatisticsError: no trial has a time, or those of one interface alone.
        """
        own = self.rows[self.rows["phase"] == "adjust"]
        if "is_matched" not in own or "time_s" not in own:
            raise StatisticsError("no trial says when it was matched")
        own = own[own["time_s"].astype(float).notna()]
        return survival_times(
            own["time_s"].astype(float),
            own["is_matched"].astype(bool),
            own["interface"],
            own["target"],
            own["participant"],
        )


def outcomes_of(rows: pd.DataFrame, levels: Mapping[str, Sequence[object]]) -> Outcomes:
    """Return the outcomes of trials that count, for the levels of factors in force."""
    return Outcomes(rows, tuple(map(str, levels["target"])), tuple(map(str, levels["interface"])))
