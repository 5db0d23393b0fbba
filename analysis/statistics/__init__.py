"""Statistics a reviewer accepts: one function per test, results that explain themselves.

Every function takes arrays or a tidy frame (pandas, or a mapping of columns), raises a named
error for data it cannot accept, and returns a frozen dataclass with `sentence()`, `row()` and
`provenance`. NumPy and SciPy only; nothing here imports pandas or statsmodels.
"""

from analysis.statistics.adjust import adjust_p, bonferroni_thresholds, stars
from analysis.statistics.correlation import Correlation, pearson, spearman, spearman_p
from analysis.statistics.decision import PairedComparison, Step, compare_paired, correct_family
from analysis.statistics.effects import partial_eta_squared
from analysis.statistics.normality import ShapiroWilk, shapiro_wilk, skewness
from analysis.statistics.results import Effect, Interval, Provenance, Result
from analysis.statistics.signed_rank import SignedRank, signed_rank_p_from_t, wilcoxon_signed_rank
from analysis.statistics.t_tests import (
    TTest,
    independent_t,
    independent_t_from_summary,
    one_sample_t,
    paired_t,
)

__all__ = [
    "Correlation",
    "Effect",
    "Interval",
    "PairedComparison",
    "Provenance",
    "Result",
    "ShapiroWilk",
    "SignedRank",
    "Step",
    "TTest",
    "adjust_p",
    "bonferroni_thresholds",
    "compare_paired",
    "correct_family",
    "independent_t",
    "independent_t_from_summary",
    "one_sample_t",
    "paired_t",
    "partial_eta_squared",
    "pearson",
    "shapiro_wilk",
    "signed_rank_p_from_t",
    "skewness",
    "spearman",
    "spearman_p",
    "stars",
    "wilcoxon_signed_rank",
]
