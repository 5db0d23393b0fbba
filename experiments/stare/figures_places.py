"""The seating plan coloured by dwell time, from above and as the participant sees it."""

from typing import TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from visavis.analysis.plots import new_figure
from visavis.analysis.plots.style import BLACK
from visavis.experiments.stare.comparisons import DWELL
from visavis.results.analysis import StudyAnalysis
from visavis.stimuli.scenes.audience import HEAD_RADIUS_M, PARTICIPANT_EYE_M, PLACES, SEATS
from visavis.study.measures import aggregate_cells

DISC_M = 0.28

Colour: TypeAlias = str | tuple[float, float, float]


def place_figure(analysis: StudyAnalysis) -> Figure:
    """Draw dwell time under A and D and their difference at every place."""
    means = aggregate_cells(analysis.selection.counted, [DWELL], ["condition", "place"])
    by_place = means.groupby(["condition", "place"])[DWELL.column].mean()
    under_averted, under_directed = (
        {p: float(by_place.get((c, p), float("nan"))) for p in PLACES} for c in ("A", "D")
    )
    difference = {p: under_directed[p] - under_averted[p] for p in PLACES}
    dwell_ms = [v for d in (under_averted, under_directed) for v in d.values() if np.isfinite(v)]
    most = max((abs(v) for v in difference.values() if np.isfinite(v)), default=1.0)
    plain = Normalize(0, max(dwell_ms, default=1.0))
    difference_norm = TwoSlopeNorm(0, -max(most, 1.0), max(most, 1.0))
    figure = new_figure(9.6, 7.0)
    grid = figure.subplots(2, 3, height_ratios=(3.6, 1.45))
    tests = analysis.pairs_of("places")
    stars = {t.where: t.stars for t in tests if t.measure == DWELL}
    columns: tuple[tuple[str, dict[str, float], Normalize, str, dict[str, str]], ...] = (
        ("Averted", under_averted, plain, "cividis", {}),
        ("Directed", under_directed, plain, "cividis", {}),
        ("Directed − averted", difference, difference_norm, "PuOr_r", stars),
    )
    for j, (title, values, norm, colours, marks) in enumerate(columns):
        scale = ScalarMappable(norm, mpl.colormaps[colours])
        _above(grid[0, j], values, scale, marks)
        _from_seat(grid[1, j], values, scale)
        grid[0, j].set_title(title)
        if j > 0:
            below = grid[:, :2] if j == 1 else grid[:, 2]
            bar = figure.colorbar(scale, ax=below, location="bottom", shrink=0.6, pad=0.03)
            bar.set_label("Dwell time (ms)" if j == 1 else "Difference (ms)")
    grid[0, 0].set_ylabel("Ahead (m)")
    grid[1, 0].set_ylabel("Elevation (°)")
    return figure


def _colours(value: float, scale: ScalarMappable) -> tuple[Colour, str]:
    """Return the fill of a place and a text colour that can be read on it."""
    if not np.isfinite(value):
        return "#d9dee5", BLACK
    fill = scale.to_rgba(np.array([value]))[0]
    red, green, blue = (float(c) for c in fill[:3])
    return (red, green, blue), BLACK if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else "white"


def _above(
    axes: Axes, values: dict[str, float], scale: ScalarMappable, marks: dict[str, str]
) -> None:
    for place, seat in SEATS.items():
        bearing = np.radians(seat.bearing_deg)
        x, ahead = seat.distance_m * np.sin(bearing), seat.distance_m * np.cos(bearing)
        fill, ink = _colours(values[place], scale)
        axes.add_patch(Circle((x, ahead), DISC_M, facecolor=fill, edgecolor=BLACK, lw=0.8))
        if np.isfinite(values[place]):
            text = f"{values[place]:.0f}".replace("-", "−")
            axes.text(x, ahead, text, ha="center", va="center", fontsize=8, color=ink)
        if marks.get(place):
            axes.text(x, ahead + DISC_M, marks[place], ha="center", va="bottom", fontsize=9)
    axes.plot([0], [0], "^", color=BLACK, markersize=10)
    axes.set_aspect("equal")
    axes.set_xlim(-2.45, 1.35)
    axes.set_ylim(-0.3, 4.5)
    axes.set_xlabel("To the right (m)")


def _from_seat(axes: Axes, values: dict[str, float], scale: ScalarMappable) -> None:
    for place, seat in sorted(SEATS.items(), key=lambda item: -item[1].distance_m):
        rise = seat.head_height_m - float(PARTICIPANT_EYE_M[1])
        away = float(np.hypot(seat.distance_m, rise))
        elevation = float(np.degrees(np.arctan2(rise, seat.distance_m)))
        radius = float(np.degrees(np.arcsin(HEAD_RADIUS_M / away)))
        fill, _ = _colours(values[place], scale)
        at = (seat.bearing_deg, elevation)
        axes.add_patch(Circle(at, radius, facecolor=fill, edgecolor=BLACK, lw=0.8))
    axes.set_aspect("equal")
    axes.set_xlim(-48, 22)
    axes.set_ylim(-12, 22)
    axes.set_xlabel("To the right (°)")
