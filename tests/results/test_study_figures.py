"""Figures of any study: they can be read across two columns of a page."""

import pytest
from matplotlib.figure import Figure

from visavis.analysis.plots.style import RC
from visavis.results.figures.family_figures import pairs_of_panels
from visavis.results.figures.study_figures import panels_in_rows

READABLE_PT, TWO_COLUMNS_MM, MM_PER_IN = 5.8, 180, 25.4


def smallest_pt(figure: Figure) -> float:
    """Size of the house's smallest letters once a figure is as wide as a page's two columns."""
    shrunk = min(1.0, TWO_COLUMNS_MM / MM_PER_IN / figure.get_size_inches()[0])
    sizes = [RC[name] for name in ("xtick.labelsize", "ytick.labelsize", "axes.titlesize")]
    return float(min(sizes)) * shrunk


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 12])
def test_panels_of_many_levels_are_readable_across_two_columns(count: int) -> None:
    figure, panels = panels_in_rows(count)
    assert smallest_pt(figure) >= READABLE_PT
    assert count == len(panels) == sum(axes.get_visible() for axes in figure.axes)


@pytest.mark.parametrize("count", [1, 4, 5, 9])
def test_scatter_plots_of_many_levels_are_readable_and_share_their_scales(count: int) -> None:
    figure, tops, bottoms = pairs_of_panels(count)
    assert smallest_pt(figure) >= READABLE_PT
    assert 2 * count == sum(axes.get_visible() for axes in figure.axes)
    for panels in (tops, bottoms):
        panels[-1].set(xlim=(0, 7), ylim=(0, 9))
        assert {(0.0, 7.0, 0.0, 9.0)} == {(*p.get_xlim(), *p.get_ylim()) for p in panels}
    assert bottoms[0].get_xlim() == tops[0].get_xlim()
    tops[0].set_xlim(1, 2)
    assert (0.0, 7.0) == bottoms[0].get_xlim()
