"""From rows of trials to the conclusions of the waving study."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from analysis.statistics import StatisticsError, art_anova, art_contrasts
from analysis.statistics.art import ArtAnova
from analysis.statistics.contrasts import Contrasts
from analysis.statistics.results import Cell
from experiments.waving.design import DIRECTIONS, TECHNIQUES
from experiments.waving.measures import (
    MEASURES,
    analysed_trials,
    cell_means,
    complete_participants,
    confusion,
)
from experiments.waving.published import EFFECTS, PublishedEffect, published_effect
from lab.errors import DataError

ALPHA: Final = 0.05
TERMS: Final = ("technique", "direction", "technique:direction")
SIMULATED_COLUMN: Final = "is_simulated"
FEWEST: Final = 3


@dataclass(frozen=True)
class MeasureAnalysis:
    """One measure: its table of effects and contrasts, or why there is none."""

    measure: str
    anova: ArtAnova | None
    contrasts: tuple[Contrasts, ...]
    why_not: str = ""

    def p(self, term: str) -> float | None:
        """Return p of an effect, None where nothing could be tested."""
        if self.anova is None:
            return None
        return next(e.p_used for e in self.anova.effects if e.name == term)

    def is_significant(self, term: str) -> bool | None:
        """Tell whether an effect is significant; None where nothing could be tested."""
        p = self.p(term)
        return None if p is None else p < ALPHA


@dataclass(frozen=True)
class WavingAnalysis:
    """Everything the study's analysis found.

    `trials` are all that were performed, `analysed` those that count, `means` one row per cell
    and participant; `left_out` are participants without all cells.
    """

    is_simulated: bool
    trials: pd.DataFrame = field(repr=False)
    analysed: pd.DataFrame = field(repr=False)
    means: pd.DataFrame = field(repr=False)
    left_out: tuple[str, ...]
    measures: tuple[MeasureAnalysis, ...] = field(repr=False)

    @property
    def n_participants(self) -> int:
        """Participants compared."""
        return int(self.means["participant"].nunique())

    def of(self, measure: str) -> MeasureAnalysis:
        """Return the analysis of one measure."""
        return next(m for m in self.measures if m.measure == measure)

    def by_technique(self, measure: str) -> dict[str, tuple[float, float]]:
        """Return mean and SD over participants of each technique, directions averaged."""
        table = self.means.groupby(["technique", "participant"])[measure].mean()
        return {t: _mean_sd(table[t].to_numpy(float)) for t in TECHNIQUES if t in table}

    def by_direction(self, measure: str) -> dict[str, tuple[float, float]]:
        """Return mean and SD over participants of each direction, techniques averaged."""
        table = self.means.groupby(["direction", "participant"])[measure].mean()
        return {d: _mean_sd(table[d].to_numpy(float)) for d in DIRECTIONS if d in table}

    def cell(self, measure: str, technique: str, direction: str) -> tuple[float, float]:
        """Return mean and SD over participants of one cell."""
        chosen = self.means[
            (self.means["technique"] == technique) & (self.means["direction"] == direction)
        ]
        return _mean_sd(chosen[measure].to_numpy(float))

    def confusion(self, technique: str | None = None) -> npt.NDArray[np.int64]:
        """Return how often a place (row) was answered as a place (column), (5, 5)."""
        return confusion(self.analysed, technique)

    def statistics_rows(self) -> Iterator[dict[str, Cell]]:
        """Yield one flat row per effect and contrast, with the published verdict beside it."""
        for measure in self.measures:
            if measure.anova is None:
                continue
            for effect in measure.anova.effects:
                yield {
                    "measure": measure.measure,
                    "kind": "effect",
                    **effect.row(),
                    **_published_cells(measure, effect.name),
                }
            for family in measure.contrasts:
                for contrast in family.contrasts:
                    yield {
                        "measure": measure.measure,
                        "kind": "contrast",
                        "term": ":".join(family.term),
                        **contrast.row(),
                    }


def _published_cells(measure: MeasureAnalysis, term: str) -> dict[str, Cell]:
    if measure.measure not in {e.measure for e in EFFECTS}:
        return {}
    printed: PublishedEffect = published_effect(measure.measure, term)
    return {
        "published_F": None if printed.F is None else float(printed.F),
        "published_significant": printed.is_significant,
        "agrees_with_published": measure.is_significant(term) == printed.is_significant,
    }


def _mean_sd(values: npt.NDArray[np.float64]) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if known.size == 0:
        return float("nan"), float("nan")
    return float(known.mean()), float(known.std(ddof=1)) if known.size > 1 else float("nan")


def analyse_rows(
    trials: pd.DataFrame, *, is_simulated: bool, allow_mixture: bool = False
) -> WavingAnalysis:
    """Analyse a study from its trials, training and interrupted ones included.

    What cannot be tested says why. Raises DataError for a mixture of simulated and real data
    unless `allow_mixture`, and when no trial counts.
    """
    if SIMULATED_COLUMN in trials and not (allow_mixture and is_simulated):
        kinds = set(trials[SIMULATED_COLUMN].astype(bool))
        if kinds - {is_simulated}:
            raise DataError("the trial table mixes simulated and real sessions; analyse them apart")
    counted = analysed_trials(trials)
    if counted.empty:
        raise DataError("no finished trial with an answer; nothing of this study can be analysed")
    means = cell_means(counted)
    whole = complete_participants(means)
    everybody = sorted(set(trials["participant"].astype(str)))
    means = means[means["participant"].astype(str).isin(whole)].reset_index(drop=True)
    return WavingAnalysis(
        is_simulated=is_simulated,
        trials=trials,
        analysed=counted,
        means=means,
        left_out=tuple(p for p in everybody if p not in whole),
        measures=tuple(_tested(means, measure) for measure in MEASURES),
    )


def _tested(means: pd.DataFrame, measure: str) -> MeasureAnalysis:
    known = means.dropna(subset=[measure])
    whole = complete_participants(known)
    known = known[known["participant"].astype(str).isin(whole)]
    if len(whole) < FEWEST:
        why = f"{len(whole)} participants have every cell of {measure}; tests need {FEWEST}"
        return MeasureAnalysis(measure, None, (), why)
    try:
        table = effects_of(known, measure)
        contrasts = tuple(
            art_contrasts(table, term, adjust="tukey")
            for term in (("technique",), ("direction",), ("technique", "direction"))
        )
    except StatisticsError as error:
        return MeasureAnalysis(measure, None, (), str(error))
    return MeasureAnalysis(measure, table, contrasts)


def effects_of(means: pd.DataFrame, measure: str) -> ArtAnova:
    """Return the two-way repeated-measures ART ANOVA of a measure's cell means."""
    return art_anova(
        means,
        measure,
        subject="participant",
        within=("technique", "direction"),
        levels={"technique": TECHNIQUES, "direction": DIRECTIONS},
        correction="none",  # as the published analysis, whose F it is compared with
    )
