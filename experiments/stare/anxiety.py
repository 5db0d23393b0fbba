"""Is looking related to social anxiety: Spearman correlations over participants."""

from dataclasses import dataclass, replace

import pandas as pd

from analysis.report.notation import counted, threshold
from analysis.statistics import Correlation, adjust_p, spearman
from analysis.statistics.errors import StatisticsError
from analysis.statistics.results import Cell, p_text
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.design import CONDITIONS
from experiments.stare.terms import CONDITION_NAMES, MEASURES, Measure
from lab.errors import DataError

SCORE_COLUMN = "anxiety_total"
"""Liebowitz total, 0 to 144, in the table of participants' answers."""


@dataclass(frozen=True)
class AnxietyCorrelation:
    """One correlation with the anxiety score, or why there is none.

    `p_adjusted` is Holm's over all correlations that could be computed.
    """

    measure: Measure
    condition: str
    n: int
    alpha: float
    outcome: Correlation | None
    problem: str = ""
    p_adjusted: float = float("nan")

    @property
    def is_significant(self) -> bool | None:
        """Tell whether p stays below alpha, uncorrected as in the source study."""
        return None if self.outcome is None else self.outcome.p < self.alpha

    def sentence(self) -> str:
        """Return the conclusion with test, n, statistic, p, interval and threshold."""
        what = f"{self.measure.label} under {CONDITION_NAMES[self.condition]} gaze"
        if self.outcome is None:
            return f"{what} and social anxiety: not tested, {self.problem}."
        verdict = "is" if self.is_significant else "is not significantly"
        return (
            f"{what} {verdict} correlated with social anxiety: Spearman, "
            f"{self.outcome.sentence()}; threshold {threshold(self.alpha)} uncorrected, "
            f"Holm-adjusted {p_text(self.p_adjusted)}."
        )

    def row(self) -> dict[str, Cell]:
        """Return the test as one row of the statistics table."""
        row: dict[str, Cell] = {
            "family": "anxiety",
            "where": "",
            "measure": self.measure.column,
            "first": self.condition,
            "second": SCORE_COLUMN,
            "n_pairs": self.n,
            "threshold": self.alpha,
            "problem": self.problem,
            "sentence": self.sentence(),
        }
        if self.outcome is not None:
            row |= {k: v for k, v in self.outcome.row().items() if k != "n"}
            row |= {"p_adjusted": self.p_adjusted, "significant": self.is_significant}
        return row


def anxiety_scores(answers: pd.DataFrame, column: str = SCORE_COLUMN) -> "pd.Series[float]":
    """Return the anxiety score by participant; nobody without one.

    Raises DataError when a participant has two scores.
    """
    if answers.empty or column not in answers:
        return pd.Series(dtype=float)
    known = answers.dropna(subset=[column])
    names = known["participant"].astype(str)
    if names.duplicated().any():
        twice = names[names.duplicated()].iloc[0]
        raise DataError(f"participant {twice} has two anxiety scores; keep the valid one")
    return pd.Series(known[column].to_numpy(float), index=names.to_numpy()).sort_index()


def correlate_anxiety(
    means: pd.DataFrame, scores: "pd.Series[float]", parameters: AnalysisParameters
) -> tuple[AnxietyCorrelation, ...]:
    """Correlate every measure in every condition with the anxiety score."""
    found = [
        _correlate(means, scores, measure, condition, parameters)
        for measure in MEASURES
        for condition in CONDITIONS
    ]
    tested = [i for i, c in enumerate(found) if c.outcome is not None]
    if not tested:
        return tuple(found)
    adjusted = adjust_p([c.outcome.p for c in found if c.outcome is not None])
    for i, p in zip(tested, adjusted.tolist(), strict=True):
        found[i] = replace(found[i], p_adjusted=p)
    return tuple(found)


def _correlate(
    means: pd.DataFrame,
    scores: "pd.Series[float]",
    measure: Measure,
    condition: str,
    parameters: AnalysisParameters,
) -> AnxietyCorrelation:
    here = means[means["condition"] == condition].set_index("participant")[measure.column].dropna()
    both = here.index.intersection(scores.index)
    n, alpha = len(both), parameters.alpha
    if n < max(4, parameters.minimum_participants):
        problem = f"{counted(n, 'participant')} with measure and score, 4 needed"
        return AnxietyCorrelation(measure, condition, n, alpha, None, problem)
    try:
        outcome = spearman(
            scores[both].to_numpy(float),
            here[both].to_numpy(float),
            level=parameters.interval_level,
            names=("the anxiety score", measure.label),
        )
    except StatisticsError as error:
        return AnxietyCorrelation(measure, condition, n, alpha, None, str(error))
    return AnxietyCorrelation(measure, condition, n, alpha, outcome)
