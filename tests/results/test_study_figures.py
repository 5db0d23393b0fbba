"""Figures of any study's comparisons: they can be read across two columns of a page."""

import pytest

from visavis.analysis.plots.style import RC
from visavis.results.figures.study_figures import panels_in_rows

READABLE_PT, TWO_COLUMNS_MM, MM_PER_IN = 5.8, 180, 25.4


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 12])
def test_panels_of_many_levels_are_readable_across_two_columns(count: int) -> None:
    figure, panels = panels_in_rows(count)
    shrunk = min(1.0, TWO_COLUMNS_MM / MM_PER_IN / figure.get_size_inches()[0])
    smallest_pt = min(RC[name] for name in ("xtick.labelsize", "ytick.labelsize", "axes.titlesize"))
    assert smallest_pt * shrunk >= READABLE_PT
    assert count == len(panels) == sum(axes.get_visible() for axes in figure.axes)
