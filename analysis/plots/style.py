"""One look for every figure; colours of Okabe and Ito (2008) stay apart in every colour vision."""

import math
from collections.abc import Mapping
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

BLACK: Final = "#1d2430"
GREY: Final = "#8b94a1"
BLUE: Final = "#0072b2"
VERMILION: Final = "#d55e00"
GREEN: Final = "#009e73"
PURPLE: Final = "#a8478a"
ORANGE: Final = "#e69f00"

COLUMN_WIDTH_IN: Final = 4.7
"""Width of a figure whose letters of 10 points are 7 points large in a column of 85 mm."""

_WORD_LENGTH = 7.0  # of the watermark's word, in units of its font size
_POINTS_PER_INCH = 72.0

RC: Final[Mapping[str, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.fontsize": 9.5,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": BLACK,
    "axes.labelcolor": BLACK,
    "text.color": BLACK,
    "xtick.color": BLACK,
    "ytick.color": BLACK,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.formatter.use_locale": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "visavis",
    "path.sketch": None,
}
"""Everything that changes how a figure looks; the user's own matplotlibrc is ignored."""


def figure_style() -> Any:
    """Return a context in which figures are made and saved in the house style."""
    defaults: dict[Any, Any] = {
        k: v for k, v in mpl.rcParamsDefault.items() if not k.startswith("backend")
    }
    defaults.update(RC)
    return mpl.rc_context(defaults)


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure; no window and no global state."""
    engine = ConstrainedLayoutEngine(wspace=0.04, hspace=0.04)
    return Figure(figsize=(width_in, height_in), layout=engine)


def mark_simulated(figure: Figure) -> None:
    """Write SIMULATED from corner to corner, over everything that is drawn."""
    width, height = (float(v) for v in figure.get_size_inches())
    angle = 0.8 * math.atan2(height, width)
    across = _WORD_LENGTH * math.cos(angle) + math.sin(angle)
    upward = _WORD_LENGTH * math.sin(angle) + math.cos(angle)
    size_pt = 0.88 * _POINTS_PER_INCH * min(width / across, height / upward)
    figure.text(
        0.5,
        0.5,
        "SIMULATED",
        fontsize=size_pt,
        fontweight="bold",
        color="#8a1c1c",
        alpha=0.10,
        ha="center",
        va="center",
        rotation=math.degrees(angle),
        zorder=1000,
        gid="simulated-watermark",
    )
