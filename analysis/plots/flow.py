"""A flow chart of participants and trials, top to bottom, with what left on the right."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from visavis.analysis.plots.style import BLACK, new_figure


@dataclass(frozen=True)
class Stage:
    """A box of the flow; `left` lists what leaves after it, "" for nothing."""

    text: str
    left: str = ""


def flow_chart(stages: Sequence[Stage]) -> Figure:
    """Draw the stages as boxes joined by arrows."""
    height = 1.15 * len(stages)
    figure = new_figure(8.2, height)
    axes = figure.add_subplot()
    axes.set_xlim(0, 10)
    axes.set_ylim(-len(stages), 0)
    axes.axis("off")
    for i, stage in enumerate(stages):
        y = -i - 0.5
        _box(axes, 0.2, y, 4.4, stage.text, bold=True)
        if i + 1 < len(stages):
            _arrow(axes, (2.4, y - 0.31), (2.4, y - 0.69))
        if stage.left:
            _box(axes, 5.4, y - 0.5, 4.4, stage.left, bold=False)
            _arrow(axes, (2.4, y - 0.5), (5.4, y - 0.5))
    return figure


def _box(axes: Axes, x: float, y: float, width: float, text: str, *, bold: bool) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x, y - 0.3),
            width,
            0.6,
            boxstyle="round,pad=0,rounding_size=0.06",
            facecolor="#eef2f6" if bold else "white",
            edgecolor=BLACK,
            linewidth=0.9,
        )
    )
    axes.text(x + width / 2, y, text, ha="center", va="center", fontsize=9.5, linespacing=1.35)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate(
        "", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": BLACK, "lw": 1.0}
    )
