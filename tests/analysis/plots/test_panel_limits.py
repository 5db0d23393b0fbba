"""What a panel shows: everything that counts and is published, whoever is hidden."""

import numpy as np

from visavis.analysis.plots import new_figure
from visavis.analysis.plots.panels import left_out_lines, paired_lines, published_mark


def test_published_means_lie_within_the_axes_and_hidden_people_do_not_widen_them() -> None:
    figure = new_figure(4, 3)
    axes = figure.subplots()
    paired_lines(axes, np.array([[45.0, 54.0], [67.0, 60.0]]), ["first", "second"], ["b", "r"])
    left_out_lines(axes, np.array([[500.0, -300.0]]), ["P9"])
    published_mark(axes, 0.2, 71.0, 29.2)
    low, high = axes.get_ylim()
    assert 71.0 + 29.2 < high < 110.0
    assert 30.0 < low < 71.0 - 29.2
