"""Panels that figures of any study are made of; each draws into axes it is given."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from scipy import special

from visavis.analysis.plots.style import BLACK, GREY

Values = npt.NDArray[np.float64]
WHO: Final = "who."
"""Prefix of the identifiers of drawings that belong to one participant."""
OUT: Final = "out."
"""The same for a participant who was left out."""
ALL: Final = "all."
"""The same for the values a participant would have with the trials that were left out."""
MIN_WITH_INTERVAL: Final = 3
"""Values from which on a mean is drawn with its interval."""
EDGE_PT: Final = 1.5
"""Width of a dot's edge in its own colour, where nothing else is asked for."""
_LOOK_UNTIL_SHOWN: Final = {OUT: ("x--", 5.0), ALL: ("o:", 3.5)}
"""Line and size of what is hidden until a page shows it."""


def mean_interval(values: Values, level: float = 0.95) -> tuple[float, float, float]:
    """Return mean, lower and upper bound by t; bounds NaN below two values, all below one."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return float("nan"), float("nan"), float("nan")
    mean = float(finite.mean())
    if finite.size < 2:
        return mean, float("nan"), float("nan")
    se = float(finite.std(ddof=1)) / np.sqrt(finite.size)
    reach = float(special.stdtrit(finite.size - 1, 0.5 + level / 2)) * se
    return mean, mean - reach, mean + reach


def spread_out(values: Values, width: float) -> Values:
    """Return sideways offsets within ±width so that equal values lie apart; deterministic."""
    n = values.size
    if n == 0:
        return np.empty(0)
    order = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    golden = (order * 0.6180339887) % 1.0
    return np.asarray((golden - 0.5) * 2 * width, dtype=np.float64)


def paired_lines(
    axes: Axes,
    table: Values,
    labels: Sequence[str],
    colours: Sequence[str],
    *,
    level: float = 0.95,
    people: Sequence[str] = (),
) -> None:
    """Draw every participant across conditions, means with their interval on top.

    `table` (participants, conditions), NaN where missing; `people` say whose rows these are, so
    that a page can show one through all panels.
    """
    m = table.shape[1]
    x = np.arange(m)
    for i, row in enumerate(table):
        one = people[i] if people else ""
        line = axes.plot(x, row, color=GREY, linewidth=0.7, alpha=0.45, zorder=1)[0]
        dots = axes.scatter(x, row, s=12, c=list(colours[:m]), alpha=0.45, linewidths=0, zorder=2)
        name_after(one, line, dots)
    for j in range(m):
        draw_mean(axes, j, table[:, j], colours[j], level=level)
    axes.set_xticks(x, labels)
    axes.set_xlim(-0.5, m - 0.5)


def left_out_lines(axes: Axes, table: Values, people: Sequence[str], *, kind: str = OUT) -> None:
    """Draw participants who do not count, (participants, conditions), for pages that can show them;
    with the kind `ALL`, those who count as they would be with the trials that were left out.

    They are hidden until a page shows them, and leave the axes as they are.
    """
    look, size = _LOOK_UNTIL_SHOWN[kind]
    limits = axes.dataLim.frozen()
    x = np.arange(table.shape[1])
    for row, one in zip(table, people, strict=True):
        line = axes.plot(
            x, row, look, color=BLACK, linewidth=0.8, markersize=size, alpha=0.7, mfc="none"
        )[0]
        name_after(one, line, kind=kind)
    # Limits that are set would cut what is drawn later, such as published means.
    axes.dataLim.set(limits)


def draw_mean(
    axes: Axes,
    x: float,
    values: Values,
    colour: str,
    *,
    level: float = 0.95,
    horizontal: bool = False,
) -> None:
    """Draw a mean as a disc with its confidence interval as a bar, from three values on."""
    mean, low, high = mean_interval(values, level)
    if not np.isfinite(mean):
        return
    if np.isfinite(values).sum() >= MIN_WITH_INTERVAL:
        along, across = [low, high], [x, x]
        xs, ys = (along, across) if horizontal else (across, along)
        axes.plot(xs, ys, color=BLACK, linewidth=2.2, solid_capstyle="butt", zorder=4)
    px, py = (mean, x) if horizontal else (x, mean)
    axes.plot([px], [py], "o", color=colour, markersize=8, mec=BLACK, mew=1.0, zorder=5)


def dots(axes: Axes, x: Values, y: Values, people: Sequence[str], *, s: float, **look: Any) -> None:
    """Draw dots of an area of `s` square points, each marked with its participant where known.

    A line of one marker per participant: as a collection each would take three times as long.
    """
    style = {"marker": "o", "ls": "", "zorder": 1, "ms": s**0.5, "mew": EDGE_PT, **look}
    if not any(people):
        axes.plot(x, y, **style)
        return
    for i, one in enumerate(people):
        name_after(one, axes.plot(x[i : i + 1], y[i : i + 1], **style)[0])


def name_after(person: str, *artists: Artist, kind: str = WHO) -> None:
    """Mark drawings as one person's, for pages; all kinds but `WHO` are hidden at first."""
    for artist in artists:
        if person:
            artist.set_gid(f"{kind}{person}")
        if kind != WHO:
            artist.set_visible(False)


def published_mark(
    axes: Axes,
    x: float,
    mean: float,
    spread: float | None = None,
    *,
    horizontal: bool = False,
    label: str | None = None,
) -> None:
    """Draw a published mean as an open diamond, its standard deviation as a dashed bar."""
    if spread is not None:
        along, across = [mean - spread, mean + spread], [x, x]
        xs, ys = (along, across) if horizontal else (across, along)
        axes.plot(xs, ys, color=BLACK, linewidth=1.0, linestyle=(0, (3, 2)), zorder=4)
    px, py = (mean, x) if horizontal else (x, mean)
    axes.plot(
        [px], [py], "D", color="white", markersize=6.5, mec=BLACK, mew=1.1, zorder=5, label=label
    )


def differences(
    axes: Axes,
    columns: Sequence[Values],
    labels: Sequence[str],
    colour: str,
    level: float = 0.95,
    people: Sequence[str] = (),
) -> None:
    """Draw every participant's difference in one line per comparison, with mean and interval.

    `people` say whose each value of a column is.
    """
    axes.axvline(0, color=BLACK, linewidth=0.8)
    for i, column in enumerate(columns):
        finite = column[np.isfinite(column)]
        y = i + spread_out(finite, 0.16)
        names = [p for p, v in zip(people, column, strict=bool(people)) if np.isfinite(v)]
        dots(axes, finite, y, names, s=11, color=colour, alpha=0.4, mew=0, zorder=2)
        draw_mean(axes, i, finite, colour, level=level, horizontal=True)
    axes.set_yticks(np.arange(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.6)


def in_lines(words: str, characters: int = 26) -> str:
    """Wrap the words of a measure into lines that fit a panel of three inches."""
    return fill(words, characters, break_long_words=False)


def no_data(axes: Axes, why: str) -> None:
    """Say in the panel why it is empty."""
    axes.text(0.5, 0.5, why, ha="center", va="center", transform=axes.transAxes, color=GREY)
    axes.set_xticks([])
    axes.set_yticks([])


def dots_with_limit(
    axes: Axes,
    values: Values,
    colour: str,
    *,
    over: npt.NDArray[np.bool_],
    limit: float | None,
    name: str,
    people: Sequence[str] = (),
) -> None:
    """Draw one dot per row (top to bottom), a cross where `over`, and a limit; `people` by row."""
    y = np.arange(values.size, dtype=np.float64)
    axes.hlines(y, 0, np.nan_to_num(values), color=colour, alpha=0.25, linewidth=1.2)
    row_names = np.asarray(people if people else [""] * values.size)
    dots(axes, values[~over], y[~over], list(row_names[~over]), s=26, color=colour, zorder=3)
    dots(
        axes, values[over], y[over], list(row_names[over]), s=34, marker="X", color=BLACK, zorder=3
    )
    top = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    if limit is not None:
        axes.axvline(limit, color=BLACK, linestyle=(0, (4, 3)), linewidth=1)
        top = max(top, limit)
    axes.set_xlim(0, 1.12 * top if top > 0 else 1)
    axes.set_xlabel(name)
    axes.set_ylim(values.size - 0.4, -0.6)
