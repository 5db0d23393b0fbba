"""Bayes factors of t tests with a Cauchy prior on the standardised effect (JZS)."""

import numpy as np

from visavis.analysis.statistics.errors import StatisticsError, TooFewSubjects

MEDIUM_SCALE = float(np.sqrt(0.5))
"""Scale of the Cauchy prior on the effect in standard deviations, as R's BayesFactor has it."""
_LOG_G = np.linspace(-8.0, 60.0, 6801)


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
    ratio = np.exp(log_density - log_null)
    return float(np.trapezoid(ratio, _LOG_G))


def bayes_text(factor: float) -> str:
    """Format a Bayes factor: plain between .01 and 100, with an exponent beyond."""
    digits = f"{factor:.2f}" if 0.01 <= factor < 100 else f"{factor:.1e}".replace("-", "−")
    return f"BF₁₀ = {digits}"
