"""Checks of printed numbers that only the reference files ask for; others stand in the product."""

import re
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from visavis.analysis.statistics.adjust import bonferroni_thresholds, stars
from visavis.analysis.statistics.correlation import spearman_p
from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics.power_estimates import oneway_power, oneway_sensitivity
from visavis.analysis.statistics.printed import (
    Figure,
    Printed,
    PublishedCheck,
    Verdict,
    judge,
    read_printed,
    rounding_interval,
)
from visavis.analysis.statistics.signed_rank import _z
from visavis.analysis.statistics.t_tests import independent_t_from_summary


def signed_rank_p_from_t(T: float, n: int, *, continuity: bool = False) -> float:
    """Return the normal-approximation p of a printed rank sum T of n untied, non-zero pairs."""
    if n < 1 or not 0 <= T <= n * (n + 1) / 2:
        raise StatisticsError(f"a rank sum of {n} pairs lies between 0 and {n * (n + 1) / 2:g}")
    z = _z(T, np.arange(1.0, n + 1), with_continuity=continuity)
    return float(min(1.0, 2 * special.ndtr(-abs(z))))


def check_paired_summary(
    mean_1: Printed, sd_1: Printed, mean_2: Printed, sd_2: Printed, t: Printed, n: int
) -> PublishedCheck:
    """Check whether means, SDs and a paired t imply a correlation between −1 and 1.

    The verdict takes the rounding of all printed numbers into account.
    """
    figures = [read_printed(v) for v in (mean_1, sd_1, mean_2, sd_2, t)]
    m1, s1, m2, s2, t_value = (f.value for f in figures)
    if t_value == 0 or min(s1, s2) <= 0:
        raise StatisticsError("a correlation follows only from a t other than 0 and positive SDs")

    def correlation(a: float, sa: float, b: float, sb: float, tt: float) -> float:
        sa, sb, tt = max(sa, 1e-12), max(sb, 1e-12), np.copysign(max(abs(tt), 1e-12), tt)
        sd = abs(a - b) * np.sqrt(n) / abs(tt)
        return float((sa**2 + sb**2 - sd**2) / (2 * sa * sb))

    sd = (m1 - m2) * np.sqrt(n) / t_value
    values = {
        "sd_of_differences": float(sd),
        "implied_correlation": correlation(m1, s1, m2, s2, t_value),
        "dz": float(t_value / np.sqrt(n)),
    }
    interval = rounding_interval(correlation, *figures)
    possible = sd > 0 and interval[0] <= 1 and interval[1] >= -1
    remark = "" if possible else "means, SDs and t imply an impossible correlation"
    if sd <= 0:
        remark = "the sign of t is not that of the difference of the means"
    verdict = Verdict("−1..1", values["implied_correlation"], interval, bool(possible), remark)
    inputs = {"mean_1": mean_1, "sd_1": sd_1, "mean_2": mean_2, "sd_2": sd_2, "t": t, "n": n}
    return PublishedCheck("paired t from summary", inputs, values, {"correlation": verdict})


def check_independent_t(
    mean_1: Printed,
    sd_1: Printed,
    n_1: int,
    mean_2: Printed,
    sd_2: Printed,
    n_2: int,
    *,
    t: Printed | None = None,
) -> PublishedCheck:
    """Check a printed t of two independent groups (pooled variance) against means and SDs."""

    def statistic(a: float, sa: float, b: float, sb: float) -> float:
        return independent_t_from_summary(a, max(sa, 0.0), n_1, b, max(sb, 1e-12), n_2).t

    figures = [read_printed(v) for v in (mean_1, sd_1, mean_2, sd_2)]
    value = statistic(*(f.value for f in figures))
    verdicts = {}
    if t is not None:
        verdicts["t"] = judge(t, value, rounding_interval(statistic, *figures))
    inputs = {"means": (mean_1, mean_2), "SDs": (sd_1, sd_2), "n": (n_1, n_2)}
    return PublishedCheck("independent t from summary", inputs, {"t": value}, verdicts)


def check_spearman(rs: Printed, n: int, *, p: Printed | None = None) -> PublishedCheck:
    """Check the two-sided p (t with n − 2 df) of a printed Spearman correlation."""
    figure = read_printed(rs)
    size = Figure(figure.text, abs(figure.value), figure.half_unit)
    value = spearman_p(size.value, n)
    verdicts = {}
    if p is not None:
        interval = rounding_interval(lambda r: spearman_p(min(r, 1.0), n), size)
        verdicts["p"] = judge(p, value, interval)
    return PublishedCheck("Spearman", {"rs": rs, "n": n}, {"p": value}, verdicts)


def check_threshold(
    alpha: float, n_tests: int, *, threshold: Printed | None = None
) -> PublishedCheck:
    """Check a printed Bonferroni threshold; one that was cut off is stricter, and accepted."""
    one, two, three = bonferroni_thresholds(alpha, n_tests)
    values = {"threshold": one, "two_stars": two, "three_stars": three}
    verdicts = {}
    if threshold is not None:
        verdicts["threshold"] = judge(threshold, one, allow_truncation=True)
    inputs = {"alpha": alpha, "tests": n_tests}
    return PublishedCheck("Bonferroni threshold", inputs, values, verdicts)


def check_stars(
    p: Printed, n_tests: int, *, printed: str | None = None, alpha: float = 0.05
) -> PublishedCheck:
    """Check printed stars against a printed p after Bonferroni; rounding of p is allowed for."""
    figure = read_printed(p)
    computed = stars(figure.value, alpha=alpha, n_tests=n_tests)
    verdicts = {}
    if printed is not None:
        possible = {
            stars(v, alpha=alpha, n_tests=n_tests)
            for v in (
                max(figure.value - figure.half_unit, 0.0),
                figure.value,
                figure.value + figure.half_unit,
            )
        }
        fits = printed in possible
        remark = "" if fits else f"p calls for {computed or 'no stars'!r}"
        verdicts["stars"] = Verdict(printed, float(len(computed)), None, fits, remark)
    values = {"stars": float(len(computed))}
    return PublishedCheck("Bonferroni stars", {"p": p, "tests": n_tests}, values, verdicts)


def check_pooled_mean(
    parts: Mapping[str, Sequence[tuple[Printed, int]]], *, mean: Printed | None = None
) -> PublishedCheck:
    """Check that every way of splitting the sample, (mean, n) per part, has the same total mean.

    `values["mean"]` is the first split's; all splits and the printed mean must agree within their
    rounding.
    """
    totals, slack = {}, {}
    for name, split in parts.items():
        figures = [(read_printed(m), n) for m, n in split]
        N = sum(n for _, n in figures)
        totals[name] = sum(f.value * n for f, n in figures) / N
        slack[name] = sum(f.half_unit * n for f, n in figures) / N
    first = next(iter(totals))
    values = {"mean": totals[first], **{f"mean_{k}": v for k, v in totals.items()}}
    low = max(totals[k] - slack[k] for k in totals)
    high = min(totals[k] + slack[k] for k in totals)
    if low > high + 1e-12:
        verdict = Verdict(str(mean), totals[first], (low, high), False, "the splits disagree")
    elif mean is None:
        verdict = Verdict("", totals[first], (low, high), True)
    else:
        verdict = judge(mean, totals[first], (low, high))
    return PublishedCheck("pooled mean", {"parts": tuple(parts)}, values, {"mean": verdict})


def check_oneway_power(
    k: int,
    n_planned: int,
    n_used: int,
    *,
    power: Printed | None = None,
    planned_power: float = 0.8,
    alpha: float = 0.05,
) -> PublishedCheck:
    """Check a printed power of `n_used` per group against the n planned for `planned_power`."""
    f = oneway_sensitivity(k=k, n_per_group=n_planned, power=planned_power, alpha=alpha).f
    value = oneway_power(k=k, n_per_group=n_used, f=f, alpha=alpha).power
    verdicts = {} if power is None else {"power": judge(power, value)}
    inputs = {"k": k, "n planned": n_planned, "n used": n_used, "alpha": alpha}
    values = {"effect_f": f, "power": value}
    return PublishedCheck("one-way power", inputs, values, verdicts)


def check_signed_rank(
    T: float, n: int, *, p: Printed | None = None, continuity: bool = False
) -> PublishedCheck:
    """Check a printed p of a signed-rank sum T of n pairs (normal approximation)."""
    value = signed_rank_p_from_t(T, n, continuity=continuity)
    verdicts = {} if p is None else {"p": judge(p, value)}
    return PublishedCheck("signed rank", {"T": T, "n": n}, {"p": value}, verdicts)


def read_verdicts(text: str, *, alpha: float = 0.05) -> dict[tuple[str, str], bool]:
    """Read 'a-b and a-c < .05, b-c > .05' as pairs and whether they are significant at alpha."""
    found = {}
    for clause in re.split(r"[,;]", text):
        match = re.search(r"([<>])\s*(\d*\.\d+)", clause)
        if match is None:
            continue
        below = match.group(1) == "<" and float(match.group(2)) <= alpha
        for a, b in re.findall(r"(\w+)\s*-\s*(\w+)", clause[: match.start()]):
            found[(a, b)] = below
    return found
