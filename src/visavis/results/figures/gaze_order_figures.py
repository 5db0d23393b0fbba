"""Figures of the order of looks: scan paths with numbered fixations, moves from area to area."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Annotation

from visavis.analysis.plots import BLUE, GREY, VERMILION, ReportFigure, draw, new_figure
from visavis.analysis.plots.labels import Lettering, settle, write_apart
from visavis.analysis.plots.panels import Values, in_lines
from visavis.analysis.plots.style import BLACK, COLUMN_WIDTH_IN
from visavis.analysis.report.notation import count_of, decimal
from visavis.recording.csv_file import csv_text
from visavis.results.analysis import StudyAnalysis
from visavis.results.gaze_order import (
    FIXATIONS,
    FROM,
    MAX_LEVELS,
    MOVES,
    PER_TRIAL,
    TO,
    typical_trials,
)
from visavis.study.look_order import AGENT, DURATION_MS, ELSEWHERE, NUMBER, ON, OTHERS
from visavis.study.look_order import RIGHT_DEG as RIGHT
from visavis.study.look_order import UP_DEG as UP
from visavis.study.sections import TrialToSee
from visavis.study.texts import Texts, label_of

SCAN_PATHS: Final = "scan_paths"
MAX_SHOWN: Final = 20
"""Fixations of a scan path that are drawn: more of them hide each other."""
SAME_PLACE_DEG: Final = 2.5
LABEL_01: Final = 0.12
"""Stays nearer than this share of a panel have their numbers in one place."""
COLOURS: Final = {AGENT: VERMILION, OTHERS: BLUE, ELSEWHERE: GREY}
NAMES: Final = {AGENT: "the agent", OTHERS: "others", ELSEWHERE: "elsewhere"}
PLACES: Final = {AGENT: (0.5, 0.84), OTHERS: (0.12, 0.2), ELSEWHERE: (0.88, 0.2)}
MIN_DRAWN: Final = 0.05
"""Moves in a trial, of which fewer are not drawn."""
WIDEST_PT: Final = 7.0

NUMBER_PT: Final = 8.5
MAX_LINE: Final = 10
"""Characters in a line of numbers."""

_Typical = tuple[object, TrialToSee, pd.DataFrame]


@dataclass(frozen=True)
class Stays:
    """Fixations whose numbers stand together: first and last of those in a row, and where."""

    spans: tuple[tuple[int, int], ...]
    middle: tuple[float, float]

    def joined(self, other: "Stays") -> "Stays":
        """Return both, at the place of this one."""
        spans: list[tuple[int, int]] = []
        for first, last in sorted((*self.spans, *other.spans)):
            if spans and spans[-1][1] == first - 1:
                spans[-1] = (spans[-1][0], last)
            else:
                spans.append((first, last))
        return Stays(tuple(spans), self.middle)

    def words(self) -> str:
        """Return the numbers, in lines."""
        words = ", ".join(f"{a}–{b}" if a != b else str(a) for a, b in self.spans)
        return in_lines(words, MAX_LINE)


def gaze_order_figures(analysis: StudyAnalysis, texts: Texts) -> list[ReportFigure]:
    """Return the two figures, drawn; none where nobody's fixations were measured."""
    fixations = analysis.tables.get(FIXATIONS)
    if fixations is None or fixations.empty:
        return []
    moves = analysis.tables[MOVES]
    factor = str(moves.columns[1])
    levels = analysis.levels[factor][:MAX_LEVELS]
    typical = typical_trials(analysis)
    with_data = [level for level in levels if (moves[factor] == level).any()]
    n = count_of(int(moves["participant"].nunique()), "participant")
    by = label_of(texts, factor)
    data = pd.concat([rows for _, _, rows in typical], ignore_index=True)
    return [
        draw(
            SCAN_PATHS,
            lambda: _scan_paths(typical, texts),
            title=f"Scan paths by {by}",
            caption=f"Of each the first {MAX_SHOWN} fixations of the trial with the median number "
            "of them. Discs are fixations, numbered in their order, the larger the longer. "
            "Directions in the world, from the middle of those shown.",
            alternative=f"Numbered fixations of one trial for each {by}.",
            is_simulated=analysis.is_simulated,
            data=csv_text(data.assign(is_simulated=analysis.is_simulated)),
        ),
        draw(
            MOVES,
            lambda: _graphs(moves, with_data, texts),
            title=f"Moves of gaze by {by}",
            caption="From what a fixation is on to what the next one is on, where that is "
            f"something else: moves in a trial, mean over {n}. In “others”: from one head to "
            f"another. Fewer than {decimal(MIN_DRAWN, 2)} are not drawn.",
            alternative=f"Arrows between the agent, other heads and elsewhere for each {by}.",
            is_simulated=analysis.is_simulated,
            data=csv_text(moves.assign(is_simulated=analysis.is_simulated)),
        ),
    ]


def _panels(count: int, height_in: float) -> tuple[Figure, list[Axes]]:
    across = min(2, count)
    down = -(-count // across)
    figure = new_figure(COLUMN_WIDTH_IN, height_in * down)
    every = list(figure.subplots(down, across, squeeze=False).flat)
    for axes in every[count:]:
        axes.set_visible(False)
    return figure, every[:count]


def _scan_paths(typical: Sequence[_Typical], texts: Texts) -> Figure:
    figure, every = _panels(len(typical), 2.3)
    in_legend: set[str] = set()
    paths = []
    for axes, (level, _, fixations) in zip(every, typical, strict=True):
        in_order = fixations.sort_values(NUMBER)[:MAX_SHOWN]
        right, up = in_order[RIGHT].to_numpy(float), in_order[UP].to_numpy(float)
        # The middle of directions is where their mean vector points: degrees jump at ±180.
        turn = np.exp(1j * np.radians(right))
        right = np.degrees(np.angle(turn * np.conj(turn.mean())))
        size = 18 + 130 * in_order[DURATION_MS].to_numpy(float) / 1000
        axes.plot(right, up, color=BLACK, linewidth=0.6, alpha=0.5, zorder=2)
        for area, colour in COLOURS.items():
            on = (in_order[ON] == area).to_numpy(bool)
            if on.any():
                label = "" if area in in_legend else NAMES[area]
                axes.scatter(
                    right[on],
                    up[on],
                    size[on],
                    color=colour,
                    alpha=0.55,
                    linewidths=0,
                    label=label or None,
                    zorder=3,
                )
                in_legend.add(area)
        paths.append((axes, right, up))
        axes.set_title(in_lines(label_of(texts, str(level)), 18))
        axes.margins(0.15)
        axes.set_aspect("equal", adjustable="datalim")
    for axes in every[-2:]:
        axes.set_xlabel("to the right (°)")
    for axes in every[::2]:
        axes.set_ylabel("upwards (°)")
    figure.legend(loc="outside upper center", ncols=3, markerscale=0.8)
    settle(figure)
    for axes, right, up in paths:
        write_numbers(axes, right, up)
    return figure


def _stays(right_deg: Values, up_deg: Values) -> list[tuple[int, int]]:
    """Return first and last of fixations in a row that lie so near that they bear one number."""
    steps = np.hypot(np.diff(right_deg), np.diff(up_deg))
    ends = [*np.flatnonzero(steps > SAME_PLACE_DEG).tolist(), len(right_deg) - 1]
    return list(zip([0, *(end + 1 for end in ends[:-1])], ends, strict=True))


def stays_of_path(right_deg: Values, up_deg: Values) -> list[Stays]:
    """Return where a path's fixations stay, those of one place together."""
    near_deg = LABEL_01 * max(np.ptp(right_deg), np.ptp(up_deg))
    places: list[Stays] = []
    for first, last in _stays(right_deg, up_deg):
        x, y = float(right_deg[first : last + 1].mean()), float(up_deg[first : last + 1].mean())
        here = Stays(((first + 1, last + 1),), (x, y))
        near = (k for k, at in enumerate(places) if _apart(at.middle, (x, y)) <= near_deg)
        k = next(near, None)
        if k is None:
            places.append(here)
        else:
            places[k] = places[k].joined(here)
    return places


def _apart(one: tuple[float, float], other: tuple[float, float]) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])


def write_numbers(axes: Axes, right_deg: Values, up_deg: Values) -> list[Annotation]:
    """Write the numbers of a path's fixations beside where they stay; those for which there is no
    room stand together, as in "2–4, 7". The figure must be settled.
    """
    marks = list(zip(right_deg.tolist(), up_deg.tolist(), strict=True))
    lettering = Lettering(axes, NUMBER_PT, {"zorder": 4}, marks)
    return write_apart(
        lettering,
        stays_of_path(right_deg, up_deg),
        lambda at: at.words(),
        lambda at: at.middle,
        Stays.joined,
    )


def _graphs(moves: pd.DataFrame, levels: Sequence[object], texts: Texts) -> Figure:
    figure, every = _panels(len(levels), 2.0)
    factor = str(moves.columns[1])
    means = [_means(moves[moves[factor] == level]) for level in levels]
    most = max(MIN_DRAWN, *(max(of_level.values()) for of_level in means))
    for axes, level, of_level in zip(every, levels, means, strict=True):
        axes.set_axis_off()
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
        axes.set_title(in_lines(label_of(texts, str(level)), 18))
        for (start, end), mean in of_level.items():
            if start != end and mean >= MIN_DRAWN:
                _arrow(axes, start, end, mean, WIDEST_PT * mean / most)
        within = of_level.get((OTHERS, OTHERS), 0.0)
        for area, (x, y) in PLACES.items():
            name = NAMES[area] + (f"\n↻ {decimal(within, 1)}" if area == OTHERS else "")
            look = {"boxstyle": "round,pad=0.3", "fc": "white", "ec": COLOURS[area], "lw": 1.4}
            axes.text(x, y, name, ha="center", va="center", fontsize=9, bbox=look, zorder=5)
    return figure


def _means(moves: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return the mean over people of moves from and to each area."""
    means = moves.groupby([FROM, TO])[PER_TRIAL].mean().reset_index()
    return {(start, end): float(mean) for start, end, mean in means.itertuples(index=False)}


def _arrow(axes: Axes, start: str, end: str, mean: float, width_pt: float) -> None:
    a, b = np.array(PLACES[start]), np.array(PLACES[end])
    axes.add_patch(
        FancyArrowPatch(
            tuple(a),
            tuple(b),
            connectionstyle="arc3,rad=0.22",
            arrowstyle="-|>",
            mutation_scale=8 + width_pt,
            linewidth=max(0.5, width_pt),
            color=COLOURS[start],
            alpha=0.6,
            shrinkA=22,
            shrinkB=22,
            zorder=2,
        )
    )
    # The number stands beside the middle of its arc, which bends to the right of its way.
    along = b - a
    x, y = (a + b) / 2 + 0.17 * np.array([along[1], -along[0]])
    axes.text(x, y, decimal(mean, 1), ha="center", va="center", fontsize=9, zorder=6)
