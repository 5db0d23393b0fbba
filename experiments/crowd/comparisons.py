"""Compare the three blocks in every measure: one decision path per measure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from analysis.statistics import Contrasts, Equivalence, compare_conditions, tost_paired
from analysis.statistics.conditions import ConditionsComparison
from analysis.statistics.errors import StatisticsError
from experiments.crowd import published
from experiments.crowd.analysis_parameters import AnalysisParameters
from experiments.crowd.design import CONDITIONS
from experiments.crowd.terms import PAIRS, Measure
from lab.geometry import Vector


@dataclass(frozen=True)
class PairTest:
    """A post-hoc comparison, first minus second; `p` adjusted (Bonferroni)."""

    pair: tuple[str, str]
    difference: float
    p: float
    differs: bool
    sentence: str


@dataclass(frozen=True)
class MeasureComparison:
    """One measure over the three blocks.

    `table` (people, 3) holds each person's mean over the walks of a block, of people who have
    all three; `test` None with `problem` where it could not be tested.
    """

    measure: Measure
    people: tuple[str, ...]
    table: Vector
    test: ConditionsComparison | None
    pairs: tuple[PairTest, ...]
    problem: str = ""

    @property
    def means(self) -> Vector:
        """Mean of each block, NaN without data."""
        return self.table.mean(axis=0) if len(self.table) else np.full(3, np.nan)

    @property
    def sds(self) -> Vector:
        """Standard deviation over people of each block."""
        return self.table.std(axis=0, ddof=1) if len(self.table) > 1 else np.full(3, np.nan)

    def differs(self, pair: tuple[str, str]) -> bool | None:
        """Tell whether two blocks differ significantly; None when it was not tested."""
        if self.test is None:
            return None
        if not self.test.significant:
            return False
        return any(t.pair == pair and t.differs for t in self.pairs)

    def agrees(self, pair: tuple[str, str]) -> bool | None:
        """Tell whether the published verdict on two blocks comes back, direction included."""
        source = published.TESTS.get(self.measure.column)
        ours = self.differs(pair)
        if source is None or ours is None:
            return None
        theirs = pair in source.pairs
        if not (ours and theirs):
            return ours == theirs
        printed = published.MEANS[self.measure.column]
        a, b = (CONDITIONS.index(c) for c in pair)
        here = self.means[a] - self.means[b]
        return bool(np.sign(here) == np.sign(printed[pair[0]].mean - printed[pair[1]].mean))

    def rows(self) -> list[dict[str, Any]]:
        """Return flat rows: the test over blocks, then every post-hoc."""
        base: dict[str, Any] = {"measure": self.measure.column, "n": len(self.people)}
        for condition, mean, sd in zip(CONDITIONS, self.means, self.sds, strict=True):
            base |= {f"mean_{condition}": mean, f"sd_{condition}": sd}
        if self.test is None:
            return [{**base, "comparison": "blocks", "problem": self.problem}]
        rows = [
            {
                **base,
                "comparison": "blocks",
                "test": "rm_anova" if self.test.is_parametric else "friedman",
                "p": self.test.p,
                "significant": self.test.significant,
                "sentence": self.test.sentence(),
            }
        ]
        rows += [
            {
                **base,
                "comparison": f"{t.pair[0]} - {t.pair[1]}",
                "p": t.p,
                "significant": t.differs,
                "difference": t.difference,
                "agrees_with_published": self.agrees(t.pair),
                "sentence": t.sentence,
            }
            for t in self.pairs
        ]
        return rows


def compare_measure(
    means: pd.DataFrame, measure: Measure, parameters: AnalysisParameters
) -> MeasureComparison:
    """Compare a measure over blocks; `means` has participant, condition and the measure."""
    if measure.column not in means:
        return _untested(measure, "not measured")
    wide = means.pivot(index="participant", columns="condition", values=measure.column)
    wide = wide.reindex(columns=list(CONDITIONS)).astype(float).dropna()
    people = tuple(map(str, wide.index))
    table = wide.to_numpy(float)
    if len(people) < 3:
        return _untested(measure, f"{len(people)} people with all three blocks", people, table)
    tidy = pd.DataFrame(
        {
            "participant": np.repeat(people, 3),
            "block": np.tile(CONDITIONS, len(people)),
            measure.column: table.ravel(),
        }
    )
    try:
        test = compare_conditions(
            tidy,
            measure.column,
            subject="participant",
            within="block",
            levels=CONDITIONS,
            alpha=parameters.alpha,
            normality_alpha=parameters.normality_alpha,
            always_posthoc=True,
        )
    except StatisticsError as error:
        return _untested(measure, str(error), people, table)
    return MeasureComparison(measure, people, table, test, _pairs(test, table))


def _pairs(test: ConditionsComparison, table: Vector) -> tuple[PairTest, ...]:
    found: dict[frozenset[str], tuple[float, str]] = {}
    if isinstance(test.pairs, Contrasts):
        for contrast in test.pairs.contrasts:
            found[frozenset(contrast.pairs[0])] = (contrast.p_adjusted, contrast.sentence())
    else:
        for one in test.pairs:
            found[frozenset((one.level_1, one.level_2))] = (one.p_adjusted, one.sentence())
    means = table.mean(axis=0)
    rows = []
    for pair in PAIRS:
        p, sentence = found[frozenset(pair)]
        a, b = (CONDITIONS.index(c) for c in pair)
        differs = bool(test.significant and p < test.alpha)
        rows.append(PairTest(pair, float(means[a] - means[b]), p, differs, sentence))
    return tuple(rows)


def _untested(
    measure: Measure, problem: str, people: Sequence[str] = (), table: Vector | None = None
) -> MeasureComparison:
    values = np.empty((0, 3)) if table is None else table
    return MeasureComparison(measure, tuple(people), values, None, (), problem)


def path_length_equivalence(
    comparison: MeasureComparison, pair: tuple[str, str], parameters: AnalysisParameters
) -> Equivalence | str:
    """Test whether people walk as far in two blocks, within a share of the mean; or say why not."""
    a, b = (comparison.table[:, CONDITIONS.index(c)] for c in pair)
    bound = parameters.path_bound_01 * float(comparison.table.mean()) if len(a) else 0.0
    try:
        return tost_paired(a, b, low=-bound, high=bound, alpha=parameters.alpha, names=pair)
    except StatisticsError as error:
        return str(error)
