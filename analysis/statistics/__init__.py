"""Statistics a reviewer accepts: one function per test, results that explain themselves.

Every function takes arrays or a tidy frame (pandas, or a mapping of columns), raises a named
error for data it cannot accept, and returns a frozen dataclass with `sentence()`, `row()` and
`provenance`. Importing it brings neither pandas nor statsmodels: the latter is loaded when a mixed
model of single trials or estimating equations are fitted (decision 0020).
"""

from visavis.analysis.statistics.adjust import adjust_p, bonferroni_thresholds, stars
from visavis.analysis.statistics.anova import Anova, AnovaEffect, between_anova, rm_anova
from visavis.analysis.statistics.art import AlignmentCheck, ArtAnova, art_anova
from visavis.analysis.statistics.art_contrasts import (
    art_contrasts,
    art_interaction_contrasts,
    art_simple_effects,
)
from visavis.analysis.statistics.between import (
    DunnPair,
    KruskalWallis,
    OneWay,
    dunn,
    games_howell,
    group_means,
    kruskal_wallis,
    levene,
    oneway_anova,
    tukey_hsd,
    welch_anova,
)
from visavis.analysis.statistics.clusters import Selection, Ward, select_scales, ward
from visavis.analysis.statistics.conditions import ConditionsComparison, compare_conditions
from visavis.analysis.statistics.contrasts import Contrast, Contrasts
from visavis.analysis.statistics.correlation import Correlation, pearson, spearman, spearman_p
from visavis.analysis.statistics.decision import (
    PairedComparison,
    Step,
    compare_paired,
    correct_family,
)
from visavis.analysis.statistics.describe import Cell, cell_means, describe
from visavis.analysis.statistics.design import Design, read_design
from visavis.analysis.statistics.effects import partial_eta_squared
from visavis.analysis.statistics.equivalence import (
    Equivalence,
    tost_independent,
    tost_one_sample,
    tost_paired,
)
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.estimation import estimation_plot
from visavis.analysis.statistics.friedman import (
    Friedman,
    SignedRankPair,
    friedman,
    posthoc_signed_rank,
)
from visavis.analysis.statistics.marginal import (
    interaction_contrasts,
    linear_hypotheses,
    posthoc,
    simple_effects,
)
from visavis.analysis.statistics.mixed import mixed_anova
from visavis.analysis.statistics.normality import ShapiroWilk, shapiro_wilk, skewness
from visavis.analysis.statistics.power_estimates import (
    OneWayPower,
    PowerCurve,
    PowerPoint,
    oneway_power,
    oneway_sample_size,
    oneway_sensitivity,
    power_curve,
    proportion_interval,
)
from visavis.analysis.statistics.printed import PublishedCheck, Verdict
from visavis.analysis.statistics.rank_sum import RankSum, mann_whitney
from visavis.analysis.statistics.reliability import CronbachAlpha, cronbach_alpha
from visavis.analysis.statistics.results import Effect, Interval, Provenance, Result
from visavis.analysis.statistics.signed_rank import (
    SignedRank,
    wilcoxon_signed_rank,
)
from visavis.analysis.statistics.sphericity import Sphericity
from visavis.analysis.statistics.studentized import studentized_range_quantile, studentized_range_sf
from visavis.analysis.statistics.t_tests import (
    TTest,
    independent_t,
    independent_t_from_summary,
    one_sample_t,
    paired_t,
)

__all__ = [
    "AlignmentCheck",
    "Anova",
    "AnovaEffect",
    "ArtAnova",
    "Cell",
    "ConditionsComparison",
    "Contrast",
    "Contrasts",
    "Correlation",
    "CronbachAlpha",
    "Design",
    "DunnPair",
    "Effect",
    "Equivalence",
    "Friedman",
    "Interval",
    "KruskalWallis",
    "OneWay",
    "OneWayPower",
    "PairedComparison",
    "PowerCurve",
    "PowerPoint",
    "Provenance",
    "PublishedCheck",
    "RankSum",
    "Result",
    "Selection",
    "ShapiroWilk",
    "SignedRank",
    "SignedRankPair",
    "Sphericity",
    "StatisticsError",
    "Step",
    "TTest",
    "Verdict",
    "Ward",
    "adjust_p",
    "art_anova",
    "art_contrasts",
    "art_interaction_contrasts",
    "art_simple_effects",
    "between_anova",
    "bonferroni_thresholds",
    "cell_means",
    "compare_conditions",
    "compare_paired",
    "correct_family",
    "cronbach_alpha",
    "describe",
    "dunn",
    "estimation_plot",
    "friedman",
    "games_howell",
    "group_means",
    "independent_t",
    "independent_t_from_summary",
    "interaction_contrasts",
    "kruskal_wallis",
    "levene",
    "linear_hypotheses",
    "mann_whitney",
    "mixed_anova",
    "one_sample_t",
    "oneway_anova",
    "oneway_power",
    "oneway_sample_size",
    "oneway_sensitivity",
    "paired_t",
    "partial_eta_squared",
    "pearson",
    "posthoc",
    "posthoc_signed_rank",
    "power_curve",
    "proportion_interval",
    "read_design",
    "rm_anova",
    "select_scales",
    "shapiro_wilk",
    "simple_effects",
    "skewness",
    "spearman",
    "spearman_p",
    "stars",
    "studentized_range_quantile",
    "studentized_range_sf",
    "tost_independent",
    "tost_one_sample",
    "tost_paired",
    "tukey_hsd",
    "ward",
    "welch_anova",
    "wilcoxon_signed_rank",
]
