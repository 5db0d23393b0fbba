"""A figure of a test's assumptions: residuals that are normal and spread alike."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import special

from visavis.analysis.plots import BLUE, ReportFigure, draw, new_figure
from visavis.analysis.plots.style import BLACK, GREY
from visavis.analysis.statistics.normality import skewness
from visavis.analysis.statistics.results import Array, number
from visavis.analysis.statistics_report.outcome import Outcome

NORMAL_TESTS = ("rm", "mixed", "lmm", "anova", "welch", "t", "tost", "paired", "conditions")
"""Tests that assume normal residuals (`paired` and `conditions` on their way to a rank test)."""
MIN_RESIDUALS = 5
MAX_CELLS_NAMED = 12


def residuals(outcome: Outcome) -> pd.DataFrame | None:
    """Return `residual` and `cell` of every row tested, or None for tests that need none.

    Residuals stand around the means of the cells; where people have several rows, their own level
    is taken away too.
    """
    data, q = outcome.data, outcome.question
    if data is None or q.test not in NORMAL_TESTS or len(data) < MIN_RESIDUALS:
        return None
    factors = [*q.between, *q.within]
    y = data[q.dv].astype(float)
    cell = pd.Series("all", index=data.index)
    if factors:
        cell = data[factors].astype(str).agg("\n".join, axis="columns")
    left = y - y.groupby(cell).transform("mean")
    if q.within and q.subject in data:
        left = left - left.groupby(data[q.subject]).transform("mean")
    if np.ptp(left) <= 1e-12 * (np.ptp(y) or 1.0):
        return None
    return pd.DataFrame({"residual": left, "cell": cell})


def draw_assumptions(outcome: Outcome) -> ReportFigure | None:
    """Draw residuals against normal quantiles and by cell; None for tests that need neither."""
    table = residuals(outcome)
    if table is None:
        return None
    values = table["residual"].to_numpy(float)
    around = "cell means and people's own levels" if outcome.question.within else "their means"
    spreads = table.groupby("cell", sort=False)["residual"].std(ddof=1)
    skew = skewness(values)
    summary = (
        f"skewness {number(skew)}; SD by cell from {number(float(spreads.min()), 3)} to "
        f"{number(float(spreads.max()), 3)}"
    )
    return draw(
        "assumptions",
        lambda: _figure(table, outcome.question.dv),
        title=f"What {outcome.title} takes for granted",
        caption=f"Residuals around {around} ({summary}). Left: against normal quantiles, with the "
        "pointwise 95 % range of normal samples; right: by cell, which should spread alike.",
        alternative=f"Residuals of {outcome.question.dv}: {summary}",
        is_simulated=outcome.is_simulated,
    )


def _figure(table: pd.DataFrame, dv: str) -> Figure:
    figure = new_figure(8.0, 4.0)
    left, right = figure.subplots(1, 2)
    _quantiles(left, np.sort(table["residual"].to_numpy(float)))
    left.set_ylabel(f"residual of {dv}")
    groups = list(table.groupby("cell", sort=False)["residual"])
    right.axhline(0, color=BLACK, linewidth=0.8)
    for i, (_, values) in enumerate(groups):
        at = np.full(len(values), float(i))
        right.scatter(at, values, s=14, color=BLUE, alpha=0.5, linewidths=0)
        sd = float(values.std(ddof=1)) if len(values) > 1 else 0.0
        right.plot([i + 0.18] * 2, [-sd, sd], color=BLACK, linewidth=2.2)
    has_names = len(groups) <= MAX_CELLS_NAMED
    right.set_xticks(range(len(groups)), [str(n) if has_names else "" for n, _ in groups])
    right.set_xlabel("cell (bars ± SD)")
    return figure


def _quantiles(axes: Axes, rising: Array) -> None:
    n = rising.size
    rank = np.arange(1, n + 1)
    normal_quantiles = special.ndtri((rank - 0.375) / (n + 0.25))
    sd, mean = float(rising.std(ddof=1)), float(rising.mean())
    low, high = (special.ndtri(special.betaincinv(rank, n + 1 - rank, q)) for q in (0.025, 0.975))
    axes.fill_between(
        normal_quantiles, mean + sd * low, mean + sd * high, color=GREY, alpha=0.25, lw=0
    )
    axes.plot(normal_quantiles, mean + sd * normal_quantiles, color=BLACK, linewidth=1)
    axes.scatter(normal_quantiles, rising, s=14, color=BLUE, linewidths=0, zorder=3)
    axes.set_xlabel("normal quantile")
