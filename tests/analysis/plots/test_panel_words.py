"""Words of measures stay within their panel."""

from visavis.analysis.plots import new_figure
from visavis.analysis.plots.panels import in_lines

WORDS = "Number of fixations on the agent by velocity (I-VT)"


def test_titles_and_axes_of_long_words_do_not_run_into_each_other() -> None:
    figure = new_figure(6.4, 3.0)
    left, right = figure.subplots(1, 2)
    for axes in (left, right):
        axes.set_title(in_lines(WORDS))
        axes.set_ylabel(in_lines(WORDS, 30))
    figure.draw_without_rendering()

    first, second = left.title.get_window_extent(), right.title.get_window_extent()
    assert first.x1 < second.x0
    assert second.x1 < figure.bbox.x1
    for axes in (left, right):
        words = axes.yaxis.label.get_window_extent()
        assert 0 <= words.y0 < words.y1 <= figure.bbox.y1


def test_short_words_stay_in_one_line_and_long_ones_are_not_broken() -> None:
    assert "Dwell time (ms)" == in_lines("Dwell time (ms)")
    assert "Blickbewegungsgeschwindigkeitsmessung" == in_lines(
        "Blickbewegungsgeschwindigkeitsmessung"
    )
