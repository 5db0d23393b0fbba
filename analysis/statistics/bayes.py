"""Bayes factors of t tests and one-factor ANOVAs with Cauchy priors on effects (JZS)."""

import numpy as np

from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.errors import StatisticsError, TooFewSubjects, UnknownMethod
from visavis.analysis.statistics.results import Array
from visavis.analysis.statistics.strata import helmert

MEDIUM_SCALE = float(np.sqrt(0.5))
"""Scale of the Cauchy prior on the effect in standard deviations, as R's BayesFactor has it."""
FIXED_SCALE, PERSON_SCALE = 0.5, 1.0
"""Scales of the priors on effects of a factor and on people's levels in an ANOVA, as there."""
_LOG_G = np.linspace(-8.0, 60.0, 6801)
_COARSE_LOG_G = np.linspace(-9.0, 30.0, 781)
"""For two priors at once, which vary with both."""


def jzs_bayes_factor(
    t: float, n_1: int, n_2: int | None = None, *, scale: float = MEDIUM_SCALE
) -> float:
    """Return how much likelier a t is if there is an effect than if there is none, BF₁₀.

    `n_1` alone for one sample or pairs, both sizes for two groups (Student's t). Rouder, Speckman,
    Sun, Morey and Iverson (2009): the effect over SD is Cauchy with this scale under the
    alternative, 0 under the null.
    """
    if min(n_1, n_1 if n_2 is None else n_2) < 2:
        raise TooFewSubjects("a Bayes factor of a t test needs two values in each sample")
    if not scale > 0 or not np.isfinite(t):
        raise StatisticsError(f"no Bayes factor belongs to t = {t} and a prior of scale {scale}")
    df = n_1 - 1 if n_2 is None else n_1 + n_2 - 2
    n = n_1 if n_2 is None else n_1 * n_2 / (n_1 + n_2)
    variance_ratio = 1 + n * scale**2 * np.exp(
        _LOG_G
    )  # variance of the effect's estimate, over σ²/n
    log_density = (
        -0.5 * np.log(variance_ratio)
        - (df + 1) / 2 * np.log1p(t**2 / (variance_ratio * df))
        - 0.5 * np.log(2 * np.pi)
        - 0.5 * _LOG_G  # g^(−3/2) and dg = g d(log g)
        - 0.5 * np.exp(-_LOG_G)
    )
    log_null = -(df + 1) / 2 * np.log1p(t**2 / df)
    top = float(log_density.max())
    integral = float(np.trapezoid(np.exp(log_density - top), _LOG_G))
    return _from_log(top - log_null + float(np.log(integral)))


LARGEST_LOG = 300 * float(np.log(10))
"""The largest logarithm of a Bayes factor that is a number."""


def jzs_anova_bayes_factor(design: Design) -> float:
    """Return BF₁₀ of the only factor of an ANOVA: with it against without it.

    Rouder, Morey, Speckman and Province (2012): the effects of a factor, over the residual SD and
    under any orthonormal coding, are multivariate Cauchy of scale .5; people's levels in a
    repeated-measures ANOVA of scale 1, in both models.

    Raises:
        UnknownMethod: there are several factors, covariates, or missing cells.
    """
    if len(design.factors) != 1 or design.covariates or not design.is_complete:
        raise UnknownMethod(
            "the Bayes factor of an ANOVA is that of one factor with complete cells and without "
            "covariates; of two conditions at a time it is that of the test t"
        )
    (factor,) = design.factors
    y = design.y - design.y.mean()
    X = helmert(factor.k)[factor.codes]
    X = X - X.mean(axis=0)
    total = float((y**2).sum())
    values, vectors = np.linalg.eigh(X.T @ X)
    shares = (vectors.T @ X.T @ y) ** 2 / values / total
    if not factor.is_within:
        g = np.exp(_LOG_G)[:, None] * values
        explained_01 = (shares * g / (1 + g)).sum(axis=1)
        log_m = -0.5 * np.log1p(g).sum(axis=1) - (y.size - 1) / 2 * np.log1p(-explained_01)
        log_ratio = log_m + _log_prior(_LOG_G, FIXED_SCALE)
        top = float(log_ratio.max())
        integral = float(np.trapezoid(np.exp(log_ratio - top), _LOG_G))
        return _from_log(top + float(np.log(integral)))
    # People's levels are integrated out on a second axis, in both models.
    k, n = factor.k, design.n
    means = np.bincount(design.subject, y) / k
    of_people = k * float((means**2).sum()) / total
    people = np.exp(_COARSE_LOG_G) * k
    by_people = of_people * people / (1 + people)
    log_people = -0.5 * (n - 1) * np.log1p(people) + _log_prior(_COARSE_LOG_G, PERSON_SCALE)
    g = np.exp(_COARSE_LOG_G)[:, None] * values
    by_factor = (shares * g / (1 + g)).sum(axis=1)
    log_factor = -0.5 * np.log1p(g).sum(axis=1) + _log_prior(_COARSE_LOG_G, FIXED_SCALE)
    half = (y.size - 1) / 2
    null = log_people - half * np.log1p(-by_people)
    left = np.log1p(-(by_factor[:, None] + by_people[None, :]))
    both = log_factor[:, None] + log_people[None, :] - half * left
    top, top_null = float(both.max()), float(null.max())
    one = np.trapezoid(np.exp(both - top), _COARSE_LOG_G, axis=1)
    over = np.trapezoid(one, _COARSE_LOG_G)
    under = np.trapezoid(np.exp(null - top_null), _COARSE_LOG_G)
    return _from_log(top - top_null + float(np.log(over / under)))


def _from_log(log_factor: float) -> float:
    """Return a Bayes factor of a logarithm; infinite beyond what a number holds."""
    return float(np.exp(log_factor)) if log_factor < LARGEST_LOG else float("inf")


def _log_prior(log_g: Array, scale: float) -> Array:
    """Return the log density, over log g, of the variance g of effects that are Cauchy."""
    density: Array = (
        np.log(scale) - 0.5 * np.log(2 * np.pi) - 0.5 * log_g - scale**2 / 2 * np.exp(-log_g)
    )
    return density


def bayes_text(factor: float) -> str:
    """Format a Bayes factor: plain between .01 and 100, with an exponent beyond."""
    if factor > 1e300:
        return "BF₁₀ > 1e300"
    digits = f"{factor:.2f}" if 0.01 <= factor < 100 else f"{factor:.1e}".replace("-", "−")
    return f"BF₁₀ = {digits}"
