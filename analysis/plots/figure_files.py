"""Make a figure and write it as SVG or PNG, byte for byte the same for the same data."""

import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from weakref import WeakKeyDictionary

from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from visavis.analysis.plots.panels import ALL, OUT, WHO
from visavis.analysis.plots.style import figure_style, mark_simulated

PNG_DPI = 160
_CLASSES = {WHO: "who", OUT: "who out", ALL: "who all"}
_OF_ONE = re.compile(rf'<g id="({"|".join(map(re.escape, _CLASSES))})([^"]*)">')
_DRAWN: Final[WeakKeyDictionary[Figure, str]] = WeakKeyDictionary()
"""Files drawn of figures that hide nothing; a page shows the same, and need not draw it again."""


@dataclass(frozen=True)
class ReportFigure:
    """A finished figure. `name` is its file stem; the texts go below it and to screen readers.

    `data` is what it shows as the text of a CSV file, where that is a table.
    """

    name: str
    title: str
    caption: str
    alternative: str
    figure: Figure
    data: str = ""


def draw(
    name: str,
    make: Callable[[], Figure],
    *,
    title: str,
    caption: str,
    alternative: str,
    is_simulated: bool,
    data: str = "",
) -> ReportFigure:
    """Make a figure in the house style; simulated data are marked, without a way around it."""
    with figure_style():
        figure = make()
        if is_simulated:
            mark_simulated(figure)
        _lay_out(figure)
    return ReportFigure(name, title, caption, alternative, figure, data)


def _lay_out(figure: Figure) -> None:
    """Give panels, labels and legends their places once: that takes longer than drawing, and a
    figure that is written three times has them in the same places each time.
    """
    engine = figure.get_layout_engine()
    if engine is not None:
        FigureCanvasSVG(figure)  # which measures texts for the file that comes first
        dpi = figure.dpi
        if figure.axes:
            engine.execute(figure)
        figure.set_layout_engine(None)
        figure.dpi = dpi


def svg_text(figure: ReportFigure) -> str:
    """Return the figure as a whole SVG file, which names no participant."""
    text = _draw_svg(figure)
    if not _hidden_on_paper(figure):
        _DRAWN[figure.figure] = text
    return _OF_ONE.sub("<g>", text)


def _draw_svg(figure: ReportFigure) -> str:
    buffer = io.StringIO()
    with figure_style():
        FigureCanvasSVG(figure.figure)
        figure.figure.savefig(
            buffer,
            format="svg",
            metadata={
                "Date": None,
                "Creator": "Visavis",
                "Title": figure.title,
                "Description": figure.caption,
            },
        )
    return buffer.getvalue()


def _hidden_on_paper(figure: ReportFigure) -> list[Artist]:
    """Return what a page shows when it is asked, and a file never."""
    return figure.figure.findobj(lambda artist: (artist.get_gid() or "").startswith((OUT, ALL)))


def _group(match: re.Match[str]) -> str:
    return f'<g class="{_CLASSES[match[1]]}" data-who="{match[2]}"><title>{match[2]}</title>'


def svg_for_page(figure: ReportFigure) -> str:
    """Return the `<svg>` element for inlining: no prolog, identifiers unique to the figure.

    What belongs to one participant is a group that says so (`data-who`); participants who do not
    count are there, too, in groups of class "out", what trials left out would change in groups of
    class "all"; the page hides both until it is asked.
    """
    text = _DRAWN.pop(figure.figure, "")  # once: it may be changed after that
    if not text:
        artists = _hidden_on_paper(figure)
        for artist in artists:
            artist.set_visible(True)
        text = _draw_svg(figure)
        for artist in artists:
            artist.set_visible(False)
    return svg_of_page(text, figure.name)


def svg_of_page(text: str, name: str) -> str:
    """Return the `<svg>` element of the file of the figure `name`, as `svg_for_page` does."""
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = _OF_ONE.sub(_group, text)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = text.replace("url(#", f"url(#{name}-")
    text = re.sub(r'xlink:href="#', f'xlink:href="#{name}-', text)
    return text.strip()


def png_bytes(figure: ReportFigure, dpi: int = PNG_DPI) -> bytes:
    """Return the figure as PNG."""
    buffer = io.BytesIO()
    with figure_style():
        FigureCanvasAgg(figure.figure)
        figure.figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": "Visavis"})
    return buffer.getvalue()


def write_figure(figure: ReportFigure, folder: Path) -> tuple[Path, Path]:
    """Write NAME.svg and NAME.png; returns both paths."""
    folder.mkdir(parents=True, exist_ok=True)
    svg, png = folder / f"{figure.name}.svg", folder / f"{figure.name}.png"
    svg.write_text(svg_text(figure), encoding="utf-8", newline="\n")
    png.write_bytes(png_bytes(figure))
    return svg, png
