"""What came of a planned comparison: its effects, and the contrasts between two levels."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from visavis.analysis.statistics.results import MINUS
from visavis.analysis.statistics_report import Outcome
from visavis.results.family_tests import Agreement
from visavis.study.comparisons import AGREEMENT, Compare
from visavis.study.measures import Measure
from visavis.study.pairs import Printed


@dataclass(frozen=True)
class Term:
    """One effect of a comparison: its p, and its p corrected over the family.

    Both are one-sided where the comparison was planned so; the `row` has the two-sided p.
    """

    name: str
    p: float
    p_corrected: float
    alpha: float
    row: Mapping[str, Any] = field(repr=False)
    is_one_sided: bool = False

    @property
    def is_significant(self) -> bool:
        """The decision after correction; headlines use no other."""
        return self.p_corrected < self.alpha


@dataclass(frozen=True)
class Contrast:
    """Two levels of a factor compared after the overall test: first minus second.

    `difference` is the difference of means; in a Bradley–Terry model, the log odds of being
    preferred. `p` is corrected over the contrasts. A contrast is significant only where the
    overall test was.
    """

    first: str
    second: str
    p: float
    is_significant: bool
    difference: float
    sentence: str
    row: Mapping[str, Any] = field(repr=False)
    published_result: Printed | None = None

    @property
    def name(self) -> str:
        """The contrast in short: 'A – B'."""
        return f"{self.first} – {self.second}"

    @property
    def agreement(self) -> Agreement | None:
        """Our verdict and the source's; None where the source prints none.

        The source's direction is that of second minus first.
        """
        if self.published_result is None:
            return None
        same = self.published_result.direction in (0, -int(np.sign(self.difference)))
        return Agreement(self.published_result.is_significant, self.is_significant, same)


@dataclass(frozen=True)
class Finding:
    """What came of one planned comparison; `outcome` is None where nothing was tested."""

    compare: Compare
    measure: Measure
    outcome: Outcome | None
    terms: tuple[Term, ...]
    why_not: str = ""

    @property
    def contrasts(self) -> tuple[Contrast, ...]:
        """Contrasts between the levels of its one factor, or the items of a Bradley–Terry model."""
        compare, outcome = self.compare, self.outcome
        factors = (*compare.within, *compare.between)
        if compare.model == "bradleyterry":
            return self._items_compared()
        if compare.test in AGREEMENT:
            return ()
        if outcome is None or outcome.data is None or len(factors) != 1 or not self.terms:
            return ()
        values = outcome.data[compare.dv].astype(float)
        means = values.groupby(outcome.data[factors[0]].astype(str)).mean()
        levels = list(map(str, outcome.data[factors[0]].cat.categories))
        lines = contrast_lines(outcome)
        rows = [(*levels_of(row), float(row["p_adjusted"]), text, row) for row, text in lines]
        if not rows and len(levels) == 2:
            rows = [
                (
                    levels[0],
                    levels[1],
                    self.terms[0].p_corrected,
                    " ".join(outcome.sentences),
                    self.terms[0].row,
                )
            ]
        return tuple(
            Contrast(
                a,
                b,
                p,
                self.terms[0].is_significant and p < compare.alpha,
                float(means[a] - means[b]),
                text,
                row,
                compare.pairs.get((a, b)),
            )
            for a, b, p, text, row in rows
        )

    def _items_compared(self) -> tuple[Contrast, ...]:
        outcome, compare = self.outcome, self.compare
        if outcome is None or not self.terms:
            return ()
        lines = contrast_lines(outcome)
        return tuple(
            Contrast(
                *(pair := levels_of(row)),
                float(p := row["p_adjusted"]),
                self.terms[0].is_significant and float(p) < compare.alpha,
                float(row["estimate"]),
                text,
                row,
                compare.pairs.get(pair),
            )
            for row, text in lines
            if row["family"] == "items"
        )

    def contrast(self, pair: tuple[str, str]) -> Contrast | None:
        """Return the contrast of two levels; None where it was not tested."""
        return next((c for c in self.contrasts if (c.first, c.second) == pair), None)


def contrast_lines(outcome: Outcome) -> list[tuple[Mapping[str, Any], str]]:
    """Return every contrast's row with the sentence about it.

    Tests write a sentence per contrast, or one text per family: a heading, then a line for each.
    """
    rows, texts = outcome.contrasts, outcome.contrast_sentences
    if len(rows) == len(texts):
        return list(zip(rows, texts, strict=True))
    families = list(dict.fromkeys(row["family"] for row in rows))
    lines = {f: iter(text.split("\n")[1:]) for f, text in zip(families, texts, strict=True)}
    return [(row, next(lines[row["family"]])) for row in rows]


def levels_of(row: Mapping[str, Any]) -> tuple[str, str]:
    """Return the two levels of a contrast's row."""
    if "level_1" in row:
        return str(row["level_1"]), str(row["level_2"])
    first, _, second = str(row["contrast"]).partition(f" {MINUS} ")
    return first, second
