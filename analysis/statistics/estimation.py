"""Draw estimation plots: rainclouds of participants, and mean differences with intervals."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy import special

from visavis.analysis.statistics.errors import (
    ConstantResponse,
    TooFewLevels,
    UnequalLength,
    UnknownMethod,
)
from visavis.analysis.statistics.inputs import sample
from visavis.analysis.statistics.results import MINUS, Array, Interval, percent
from visavis.analysis.statistics.t_tests import TTest, independent_t, paired_t

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#4C72B0", "#DD8452", "#55A868", "#8172B3", "#937860", "#DA8BC3", "#8C8C8C", "#CCB974")
LINE_COLOUR = "#9AA0A6"
MIN_CLOUD = 5
"""Participants from which the shape of their distribution is drawn."""
CLOUD_WIDTH = 0.3


def estimation_plot(
    conditions: Mapping[str, npt.ArrayLike],
    *,
    dv: str = "",
    paired: bool = True,
    reference: str | None = None,
    level: float = 0.95,
    title: str = "",
    watermark: str = "",
) -> "Figure":
    """Draw a raincloud of each of two or more conditions above the differences to a reference.

    A raincloud shows every participant, mean ± SD, and the distribution's smoothed shape.

    `conditions` name → one value per participant, in the same order when `paired`. The lower
    panel shows each mean difference (condition − reference, by default the first) with its
    t interval at `level` (Welch's between groups) and the sampling distribution behind it.
    Returns a matplotlib figure that no window shows; save it with `savefig`. `watermark` is
    written across it, for simulated data.
    """
    from matplotlib.figure import Figure  # late: a second that tables need not pay

    names = list(conditions)
    if len(names) < 2:
        raise TooFewLevels(f"an estimation plot compares two conditions, got {len(names)}")
    columns = [sample(v, name=k, vary=False) for k, v in conditions.items()]
    if paired and len({c.size for c in columns}) > 1:
        sizes = ", ".join(f"{k}: {c.size}" for k, c in zip(names, columns, strict=True))
        raise UnequalLength(f"paired conditions need the same participants ({sizes})")
    base = names[0] if reference is None else reference
    if base not in names:
        raise UnknownMethod(f"no condition {base!r} to compare with; there are {', '.join(names)}")
    figure = Figure(figsize=(max(4.2, 1.5 + 1.25 * len(names)), 6.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_participants(upper, columns, paired)
    upper.set_ylabel(dv)
    if title:
        upper.set_title(title, loc="left", fontsize=11)
    _draw_differences(lower, names, columns, names.index(base), paired, level)
    lower.set_xticks(range(len(names)), [_label(n, c) for n, c in zip(names, columns, strict=True)])
    lower.set_xlim(-0.5, len(names) - 0.5 + (0.25 if len(names) == 2 else 0.0))
    lower.set_ylabel(f"difference to {base}")
    for axes in (upper, lower):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(length=3)
    upper.tick_params(labelbottom=False)
    note = f"bars: mean ± SD; below: mean difference with {percent(level)} CI"
    figure.supxlabel(note, fontsize=8, color="#5F6368")
    if watermark:
        figure.text(
            0.5,
            0.5,
            watermark,
            ha="center",
            va="center",
            rotation=30,
            fontsize=34,
            color="#C0392B",
            alpha=0.16,
        )
    return figure


def _draw_participants(axes: "Axes", columns: Sequence[Array], paired: bool) -> None:
    places = [i + _spread(c, 0.0 if paired else 0.16) for i, c in enumerate(columns)]
    if paired:
        values = np.array(columns)
        axes.plot(np.arange(len(columns)), values, color=LINE_COLOUR, alpha=0.45, lw=0.8, zorder=1)
    for i, (column, place) in enumerate(zip(columns, places, strict=True)):
        colour = COLOURS[i % len(COLOURS)]
        _draw_cloud(axes, i - 0.1, column, colour)
        axes.scatter(place, column, s=20, color=colour, alpha=0.75, lw=0, zorder=2)
        mean, sd = column.mean(), column.std(ddof=1)
        axes.errorbar(
            i + 0.24, mean, yerr=sd, fmt="_", ms=13, mew=2.2, color=colour, elinewidth=1.8, zorder=3
        )
    axes.margins(y=0.08)


def _draw_cloud(axes: "Axes", place: float, column: Array, colour: str) -> None:
    """Draw the density (normal kernel, Silverman's width) to the left of a place."""
    low, high = np.percentile(column, [25, 75])
    sd = float(column.std(ddof=1)) if column.size > 1 else 0.0
    spread = min(sd, float(high - low) / 1.349) or sd
    if column.size < MIN_CLOUD or spread == 0:
        return
    width = 0.9 * spread * column.size ** (-1 / 5)
    at = np.linspace(column.min() - 2 * width, column.max() + 2 * width, 121)
    density = np.exp(-(((at[:, None] - column) / width) ** 2) / 2).sum(axis=1)
    reach = CLOUD_WIDTH * density / density.max()
    axes.fill_betweenx(at, place - reach, place, color=colour, alpha=0.3, lw=0, zorder=0)


def _draw_differences(
    axes: "Axes",
    names: Sequence[str],
    columns: Sequence[Array],
    base: int,
    paired: bool,
    level: float,
) -> None:
    axes.axhline(0.0, color="black", lw=0.8)
    axes.plot(base, 0.0, "o", ms=5, mfc="white", mec="black", zorder=3)
    for i, column in enumerate(columns):
        if i == base:
            continue
        both, colour = (names[i], names[base]), COLOURS[i % len(COLOURS)]
        estimate = float(column.mean() - columns[base].mean())
        interval = Interval(estimate, estimate, level)
        # Where everybody differs alike there is no error, and the interval is a point.
        with suppress(ConstantResponse):
            test: TTest = (
                paired_t(column, columns[base], names=both, level=level)
                if paired
                else independent_t(
                    column, columns[base], names=both, level=level, equal_variances=False
                )
            )
            estimate, interval = test.estimate, test.interval
            se = (interval.high - interval.low) / 2
            se /= float(special.stdtrit(test.df, 0.5 + level / 2))
            t = np.linspace(-4.2, 4.2, 161)
            density = (1 + t**2 / test.df) ** (-(test.df + 1) / 2)
            axes.fill_betweenx(
                estimate + t * se, i, i + 0.3 * density, color=colour, alpha=0.3, lw=0
            )
        axes.plot([i, i], [interval.low, interval.high], color=colour, lw=2.4)
        axes.plot(i, estimate, "o", ms=7, color=colour, zorder=3)
        axes.annotate(
            f"{estimate:.3g}\n[{interval.low:.3g}, {interval.high:.3g}]".replace("-", MINUS),
            (i, estimate),
            xytext=(-9, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=8,
        )
    axes.margins(y=0.12)


def _spread(column: Array, width: float) -> Any:
    """Return sideways offsets that keep equal values apart: rank within neighbours of value."""
    if width == 0:
        return np.zeros(column.size)
    span = float(np.ptp(column)) or 1.0
    bins = np.round((column - column.min()) / span * 24).astype(int)
    offsets = np.zeros(column.size)
    for one in np.unique(bins):
        inside = np.flatnonzero(bins == one)
        offsets[inside] = (np.arange(inside.size) - (inside.size - 1) / 2) * width / 5
    return np.clip(offsets, -width, width)


def _label(name: str, column: Array) -> str:
    return f"{name}\nM = {column.mean():.3g}\nn = {column.size}".replace("-", MINUS)
