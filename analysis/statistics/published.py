"""Check whether the numbers a paper prints fit one another."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from visavis.analysis.statistics.effects import eta_squared_of_f
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.printed import (
    Figure,
    Printed,
    PublishedCheck,
    Verdict,
    judge,
    read_printed,
    rounding_interval,
)
from visavis.analysis.statistics.studentized import studentized_range_sf
from visavis.analysis.statistics.t_tests import two_sided_t

MIN_BETA = 1e-290
"""Beta quantile under which its reciprocal is no number any more."""


def check_f(
    F: Printed,
    df1: Printed,
    df2: Printed,
    *,
    p: Printed | None = None,
    eta: Printed | None = None,
) -> PublishedCheck:
    """Check p and partial eta squared of a printed F test.

    Fractional df (corrected for sphericity, Welch) are rounded as F is, and allowed for alike.
    """
    figures = (read_printed(F), *(_df(v) for v in (df1, df2)))
    if figures[0].value < 0:
        raise StatisticsError(f"F is never negative, got {F}")
    if min(f.value for f in figures[1:]) <= 0:
        raise StatisticsError(f"degrees of freedom are positive, got {df1} and {df2}")
    functions: dict[str, tuple[Printed | None, Callable[[float, float, float], float]]] = {
        "p": (p, lambda x, a, b: float(special.fdtrc(a, b, max(x, 0.0)))),
        "eta2p": (eta, lambda x, a, b: eta_squared_of_f(max(x, 0.0), a, b)),
    }
    verdicts, values = {}, {}
    for name, (printed, function) in functions.items():
        values[name] = function(*(f.value for f in figures))
        if printed is not None:
            verdicts[name] = judge(printed, values[name], rounding_interval(function, *figures))
    return PublishedCheck("F test", {"F": F, "df1": df1, "df2": df2}, values, verdicts)


def _df(printed: Printed) -> Figure:
    """Read degrees of freedom; whole ones are exact."""
    figure = read_printed(printed)
    whole = re.fullmatch(r"\d+(\.0)?", figure.text) is not None
    return replace(figure, half_unit=0.0) if whole else figure


def check_t(
    t: Printed, df: Printed, *, p: Printed | None = None, eta: Printed | None = None
) -> PublishedCheck:
    """Check two-sided p and partial eta squared of a printed t test; df as in `check_f`."""
    figure = read_printed(t)
    size = Figure(figure.text, abs(figure.value), figure.half_unit)
    figures = (size, _df(df))
    functions: dict[str, tuple[Printed | None, Callable[[float, float], float]]] = {
        "p": (p, two_sided_t),
        "eta2p": (eta, lambda x, a: eta_squared_of_f(x * x, 1, a)),
    }
    verdicts, values = {}, {}
    for name, (printed, function) in functions.items():
        values[name] = function(*(f.value for f in figures))
        if printed is not None:
            verdicts[name] = judge(printed, values[name], rounding_interval(function, *figures))
    return PublishedCheck("t test", {"t": t, "df": df}, values, verdicts)


def check_integer_mean(mean: Printed, n: int, *, decimals: int | None = None) -> PublishedCheck:
    """Check whether a printed mean can be the mean of n whole numbers (GRIM).

    `decimals` says how many were printed when `mean` is a number that has lost its zeros.
    """
    figure = read_printed(mean)
    half = figure.half_unit if decimals is None else 0.5 * 10.0**-decimals
    total = float(np.floor(figure.value * n + 0.5))
    nearest = total / n
    possible = bool(abs(nearest - figure.value) <= half * (1 + 1e-9) + 1e-12)
    remark = "" if possible else f"no {n} whole numbers have this mean (nearest {nearest:.6g})"
    values = {"nearest_total": total, "nearest_mean": nearest}
    verdict = Verdict(str(mean), nearest, None, possible, remark)
    return PublishedCheck("mean of integers", {"mean": mean, "n": n}, values, {"mean": verdict})


def check_oneway_from_means(
    p: Printed,
    means: Sequence[Printed],
    n_per_group: int,
    *,
    names: Sequence[str] | None = None,
    significant: Mapping[tuple[str, str], bool] | None = None,
    alpha: float = 0.05,
) -> PublishedCheck:
    """Recover F, pooled SD and Tukey's p from group means and the p of a one-way ANOVA.

    Keys of `values` for Tukey are 'tukey_SECOND_FIRST' with the names (or numbers) of the groups;
    `significant` are the printed verdicts to check, by pair of names in any order.
    """
    labels = list(names) if names is not None else [str(i + 1) for i in range(len(means))]
    centre = np.array([read_printed(m).value for m in means])
    k, df2 = centre.size, centre.size * (n_per_group - 1)
    F = _f_of_p(read_printed(p).value, k - 1, df2)
    between = n_per_group * float(centre.var(ddof=1))
    mse = between / F
    values = {"F": F, "pooled_sd": float(np.sqrt(mse))}
    verdicts = {}
    for b in range(k):
        for a in range(b):
            q = abs(centre[b] - centre[a]) / np.sqrt(mse / n_per_group)
            p_pair = float(studentized_range_sf(q, k, df2))
            values[f"tukey_{labels[b]}_{labels[a]}"] = p_pair
            for pair, printed in (significant or {}).items():
                if set(pair) == {labels[a], labels[b]}:
                    fits = (p_pair < alpha) == printed
                    text = "significant" if printed else "not significant"
                    remark = "" if fits else "Tukey's p from the means says otherwise"
                    verdicts["-".join(pair)] = Verdict(text, p_pair, None, fits, remark)
    inputs = {"p": p, "means": tuple(means), "n": n_per_group}
    return PublishedCheck("one-way ANOVA from means and p", inputs, values, verdicts)


def _f_of_p(p: float, df1: float, df2: float) -> float:
    """Return F with upper tail p; through the beta quantile of the smaller tail, so that p near 0
    or 1 keeps its digits (SciPy's f.isf returns infinity for p = 1e-40).
    """
    if not 0 < p < 1:
        raise StatisticsError(f"no F belongs to p = {p}")
    if p > 0.5:
        x = float(special.betaincinv(df1 / 2, df2 / 2, 1 - p))
        return df2 * x / (df1 * (1 - x))
    x = float(special.betaincinv(df2 / 2, df1 / 2, p))
    if df1 * x < MIN_BETA:
        raise StatisticsError(f"p = {p} with {df2:g} error df belongs to an F beyond all numbers")
    return df2 * (1 - x) / (df1 * x)
