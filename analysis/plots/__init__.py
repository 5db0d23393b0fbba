"""Figures in one style: colour-blind-safe, deterministic, marked when the data are simulated."""

from visavis.analysis.plots.figure_files import (
    ReportFigure,
    draw,
    png_bytes,
    svg_for_page,
    write_figure,
)
from visavis.analysis.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILION,
    new_figure,
)

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "PURPLE",
    "VERMILION",
    "ReportFigure",
    "draw",
    "new_figure",
    "png_bytes",
    "svg_for_page",
    "write_figure",
]
