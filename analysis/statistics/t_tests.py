"""Student's t in its forms: paired, independent, Welch, one sample, and from summaries."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.effects import (
    SKEWNESS_UNSEEN,
    Tails,
    d_average,
    partial_eta_squared,
    standardised_mean,
    tails_of,
)
from visavis.analysis.statistics.errors import ConstantResponse, StatisticsError, TooFewSubjects
from visavis.analysis.statistics.inputs import is_constant, paired, sample
from visavis.analysis.statistics.normality import skewness
from visavis.analysis.statistics.results import (
    Array,
    Effect,
    Interval,
    Provenance,
    Result,
    Row,
    degrees,
    number,
    p_text,
    percent,
    quantities,
)

NO_DIFFERENCE: Final = "there is nothing to test"


@dataclass(frozen=True)
class TTest(Result):
    """Outcome of a t test.

    `estimate` is the mean difference (first minus second, or mean minus mu) with its `interval`;
    `sd` the standard deviation it is judged by (of the differences, pooled, or of the sample; for
    Welch the pooled one, which only the effect size uses). `effect` is dz, d or d of the sample,
    `eta` partial eta squared. `unit` is that of the data, for sentences.
    """

    t: float
    df: float
    p: float
    estimate: float
    interval: Interval
    sd: float
    effect: Effect
    eta: Effect
    means: tuple[float, ...]
    sds: tuple[float, ...]
    provenance: Provenance
    d_av: float | None = None
    unit: str = ""

    def sentence(self) -> str:
        """Return the result as an APA sentence."""
        interval = self.interval
        estimate, low, high = quantities(self.estimate, interval.low, interval.high)
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"t({degrees(self.df)}) = {number(self.t)}, {p_text(self.p)}, {self.effect}, "
            f"mean difference {estimate}{unit}, {percent(interval.level)} CI [{low}, {high}]{unit}"
        )

    def row(self) -> Row:
        """Return the result as one flat table row."""
        return {
            "t": self.t,
            "df": self.df,
            "p": self.p,
            "estimate": self.estimate,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            **self.effect.row(),
            **self.provenance.row(),
        }


def paired_t(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    level: float = 0.95,
    names: tuple[str, str] = ("x", "y"),
    unit: str = "",
) -> TTest:
    """Test whether the mean of x − y is zero; dz is mean over SD of the differences."""
    first, second = paired(x, y, names=names)
    d = first - second
    scale = float(max(np.abs(first).max(), np.abs(second).max()))
    if is_constant(d) or float(np.ptp(d)) <= 1e-12 * scale:
        raise ConstantResponse(
            f"{names[0]} minus {names[1]} is {d[0]:g} in all {d.size} pairs, so t has no error and "
            "is not defined; " + (NO_DIFFERENCE if d[0] == 0 else "take the test wilcoxon or sign")
        )
    n = int(d.size)
    sd = float(d.std(ddof=1))
    t = float(d.mean() / (sd / np.sqrt(n)))
    dz, tails = t / np.sqrt(n), tails_of(d - d.mean(), of_differences=True, of_one_mean=True)
    return TTest(
        t=t,
        df=n - 1,
        p=two_sided_t(t, n - 1),
        estimate=float(d.mean()),
        interval=_interval(float(d.mean()), sd / np.sqrt(n), n - 1, level),
        sd=sd,
        effect=standardised_mean(
            "dz", t, n - 1, 1 / np.sqrt(n), value=dz, tails=tails, level=level
        ),
        eta=partial_eta_squared(t**2, 1, n - 1, cases=n, tails=_turned(tails, t), level=level),
        means=(float(first.mean()), float(second.mean())),
        sds=(float(first.std(ddof=1)), float(second.std(ddof=1))),
        provenance=Provenance("paired t", n, error_term="SD of the differences"),
        d_av=d_average(first, second),
        unit=unit,
    )


def one_sample_t(
    x: npt.ArrayLike,
    *,
    mu: float = 0.0,
    level: float = 0.95,
    name: str = "x",
    unit: str = "",
    for_skew: bool = True,
) -> TTest:
    """Test whether the mean is `mu`; d is (mean − mu) over SD.

    The mean of skewed values lies beyond t's interval on the side of the long tail too often, so
    the interval is lengthened there (`lengthened_for_skew`); without `for_skew` it is that of t.
    """
    column = sample(x, name=name, vary=False)
    n = int(column.size)
    if is_constant(column):
        raise ConstantResponse(
            f"{name} is {column[0]:g} in all {n} rows, so t has no error and is not defined; "
            + (NO_DIFFERENCE if column[0] == mu else "take the test sign")
        )
    sd = float(column.std(ddof=1))
    estimate = float(column.mean()) - mu
    t = estimate / (sd / np.sqrt(n))
    tails = tails_of(column - column.mean(), of_one_mean=True)
    interval = _interval(estimate, sd / np.sqrt(n), n - 1, level)
    if for_skew:
        interval = lengthened_for_skew(interval, column)
    return TTest(
        t=float(t),
        df=n - 1,
        p=two_sided_t(t, n - 1),
        estimate=estimate,
        interval=interval,
        sd=sd,
        effect=standardised_mean(
            "d", t, n - 1, 1 / np.sqrt(n), value=estimate / sd, tails=tails, level=level
        ),
        eta=partial_eta_squared(t**2, 1, n - 1, cases=n, tails=_turned(tails, t), level=level),
        means=(float(column.mean()),),
        sds=(sd,),
        provenance=Provenance(
            "one-sample t", n, error_term="SD", notes=(f"tested against {mu:g}",)
        ),
        unit=unit,
    )


def independent_t(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    equal_variances: bool = True,
    level: float = 0.95,
    names: tuple[str, str] = ("x", "y"),
    unit: str = "",
) -> TTest:
    """Test whether two independent groups differ in their mean (Student, or Welch).

    d and its interval use the pooled SD in both cases.
    """
    first, second = (sample(v, name=n, vary=False) for v, n in zip((x, y), names, strict=True))
    if is_constant(first) and is_constant(second):
        raise ConstantResponse(
            f"neither {names[0]} nor {names[1]} varies, so t has no error and is not defined; "
            + (NO_DIFFERENCE if first[0] == second[0] else "take the test mannwhitney")
        )
    return independent_t_from_summary(
        float(first.mean()),
        float(first.std(ddof=1)),
        int(first.size),
        float(second.mean()),
        float(second.std(ddof=1)),
        int(second.size),
        equal_variances=equal_variances,
        tails=tails_of(np.concatenate([first - first.mean(), second - second.mean()])),
        level=level,
        unit=unit,
    )


def independent_t_from_summary(
    mean_1: float,
    sd_1: float,
    n_1: int,
    mean_2: float,
    sd_2: float,
    n_2: int,
    *,
    equal_variances: bool = True,
    tails: Tails | None = None,
    level: float = 0.95,
    unit: str = "",
) -> TTest:
    """Test two independent groups from their means, standard deviations and sizes.

    Intervals of effect sizes take both groups for normal unless `tails` says how long theirs are.
    """
    if min(n_1, n_2) < 2:
        raise TooFewSubjects(f"groups of {n_1} and {n_2} are too small for a t test")
    if not (sd_1 >= 0 and sd_2 >= 0 and sd_1 + sd_2 > 0):
        raise StatisticsError(f"standard deviations {sd_1} and {sd_2} allow no t test")
    n_df = n_1 + n_2 - 2
    pooled_sd = float(np.sqrt(((n_1 - 1) * sd_1**2 + (n_2 - 1) * sd_2**2) / n_df))
    v1, v2 = sd_1**2 / n_1, sd_2**2 / n_2
    if equal_variances:
        se, df = pooled_sd * np.sqrt(1 / n_1 + 1 / n_2), float(n_df)
    else:
        se = np.sqrt(v1 + v2)
        df = (v1 + v2) ** 2 / (v1**2 / (n_1 - 1) + v2**2 / (n_2 - 1))
    estimate = mean_1 - mean_2
    t = float(estimate / se)
    scale = float(np.sqrt(1 / n_1 + 1 / n_2))
    t_pooled = float(estimate / (pooled_sd * scale))
    return TTest(
        t=t,
        df=float(df),
        p=two_sided_t(t, df),
        estimate=estimate,
        interval=_interval(estimate, float(se), float(df), level),
        sd=pooled_sd,
        effect=standardised_mean(
            "d",
            t_pooled,
            n_df,
            scale,
            value=float(estimate / pooled_sd),
            tails=tails,
            level=level,
        ),
        eta=partial_eta_squared(t**2, 1, df, cases=n_1 + n_2, tails=tails, level=level),
        means=(mean_1, mean_2),
        sds=(sd_1, sd_2),
        provenance=Provenance(
            "independent t (Student)" if equal_variances else "independent t (Welch)",
            n_1 + n_2,
            error_term="pooled SD" if equal_variances else "separate variances",
            notes=(f"groups of {n_1} and {n_2}",),
        ),
        unit=unit,
    )


def _turned(tails: Tails, t: float) -> Tails:
    """Return the tails for the square of t, which counts as above zero."""
    return replace(tails, skewness=tails.skewness * float(np.sign(t)))


def lengthened_for_skew(interval: Interval, values: Array) -> Interval:
    """Return the interval of a mean, longer on the side of its values' long tail.

    The length is the skewness term of Cornish and Fisher's expansion of t (Johnson 1978), γ(1 +
    2t²)s/6n, times `SKEWNESS_UNSEEN`, as few people show less skewness than their measure has.
    """
    n = values.size
    t = float(special.stdtrit(n - 1, 0.5 + interval.level / 2))
    term = SKEWNESS_UNSEEN * skewness(values) * (1 + 2 * t**2) / (6 * n)
    more = term * float(values.std(ddof=1))
    return Interval(interval.low + min(more, 0.0), interval.high + max(more, 0.0), interval.level)


def two_sided_t(t: float, df: float) -> float:
    """Return the two-sided p of a t statistic."""
    return float(2 * special.stdtr(df, -abs(t)))


def _interval(estimate: float, se: float, df: float, level: float) -> Interval:
    reach = float(special.stdtrit(df, 0.5 + level / 2)) * se
    return Interval(float(estimate - reach), float(estimate + reach), level)
