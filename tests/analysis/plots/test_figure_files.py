import locale
import re
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from visavis.analysis.plots import draw, new_figure, png_bytes, svg_for_page, write_figure
from visavis.analysis.plots.figure_files import svg_text
from visavis.analysis.plots.panels import (
    left_out_lines,
    mean_interval,
    paired_lines,
    spread_out,
)


def figure_of(name: str = "plot", *, is_simulated: bool = True):
    def make():
        figure = new_figure(4, 3)
        axes = figure.add_subplot()
        axes.plot([0, 1, 2], [1.5, 2.5, -1.0], "o-")
        axes.set_xlabel("time (ms)")
        return figure

    return draw(name, make, title="T", caption="C", alternative="A", is_simulated=is_simulated)


def test_same_data_give_the_same_bytes():
    assert svg_text(figure_of()) == svg_text(figure_of())
    assert png_bytes(figure_of()) == png_bytes(figure_of())


def test_a_figure_is_the_same_file_before_and_after_it_was_written_in_another_form():
    figure = figure_of()
    first = svg_text(figure)
    png_bytes(figure)
    assert first == svg_text(figure)


def test_writing_twice_gives_the_same_bytes():
    drawing = figure_of()

    assert svg_for_page(drawing) == svg_for_page(drawing)


def lines_of(*left_out: str):
    def make():
        figure = new_figure(4, 3)
        axes = figure.add_subplot()
        paired_lines(axes, np.ones((1, 2)), ["a", "b"], ["#0b5d8f"] * 2, people=["07K"])
        left_out_lines(axes, np.ones((len(left_out), 2)), left_out)
        return figure

    return draw("lines", make, title="T", caption="C", alternative="A", is_simulated=True)


@pytest.mark.parametrize(("left_out", "times"), [((), 2), (("09X",), 3)])
def test_a_figure_that_hides_nothing_is_drawn_once_for_its_file_and_its_page(
    left_out, times, tmp_path, monkeypatch
):
    expected = svg_for_page(lines_of(*left_out))
    forms = []
    savefig = Figure.savefig
    monkeypatch.setattr(
        Figure,
        "savefig",
        lambda *a, format, **k: (forms.append(format), savefig(*a, format=format, **k)),
    )
    drawing = lines_of(*left_out)
    write_figure(drawing, tmp_path)
    assert expected == svg_for_page(drawing)
    assert times == len(forms)
    assert "07K" not in (tmp_path / "lines.svg").read_text("utf-8")


def test_what_was_changed_after_a_page_was_made_is_on_the_next_page():
    drawing = figure_of()
    svg_text(drawing)
    svg_for_page(drawing)
    drawing.figure.axes[0].set_xlabel("time (s)")
    assert svg_for_page(figure_of()) != svg_for_page(drawing)


def test_simulated_figure_carries_the_watermark_and_a_real_one_does_not():
    assert "SIMULATED" in svg_for_page(figure_of())
    assert "SIMULATED" not in svg_for_page(figure_of(is_simulated=False))
    assert png_bytes(figure_of()) != png_bytes(figure_of(is_simulated=False))


@pytest.mark.parametrize(("width", "height"), [(4, 3), (9.6, 3.3), (3, 9)])
def test_watermark_lies_within_the_figure(width, height):
    drawing = draw(
        "w",
        lambda: new_figure(width, height),
        title="",
        caption="",
        alternative="",
        is_simulated=True,
    )
    renderer = FigureCanvasAgg(drawing.figure).get_renderer()
    box = drawing.figure.texts[0].get_window_extent(renderer)
    size = drawing.figure.bbox

    assert box.x0 >= 0
    assert box.y0 >= 0
    assert box.x1 <= size.width
    assert box.y1 <= size.height
    assert max(box.width / size.width, box.height / size.height) > 0.6


def test_inlined_figures_share_no_identifier():
    first, second = (set(re.findall(r'\bid="([^"]+)"', svg_for_page(figure_of(n)))) for n in "ab")

    assert first
    assert not first & second


def test_every_reference_within_an_inlined_figure_resolves():
    text = svg_for_page(figure_of())
    known = set(re.findall(r'\bid="([^"]+)"', text))
    used = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text))

    assert used
    assert used <= known
    ElementTree.fromstring(text)  # noqa: S314 - our own output


def test_svg_holds_no_date_and_no_foreign_address():
    text = svg_for_page(figure_of())

    assert "<dc:date>" not in text
    assert "matplotlib.org" not in text


def test_users_own_style_does_not_change_a_figure():
    plain = svg_text(figure_of())
    with mpl.rc_context({"font.size": 30, "axes.spines.top": True, "lines.linewidth": 9}):
        assert plain == svg_text(figure_of())


def test_figures_are_written_as_svg_and_png(tmp_path):
    paths = write_figure(figure_of("my"), tmp_path / "figures")

    assert [p.name for p in paths] == ["my.svg", "my.png"]
    assert paths[1].read_bytes()[:4] == b"\x89PNG"


def test_decimal_comma_locale_changes_nothing():
    plain = svg_text(figure_of())
    before = locale.setlocale(locale.LC_NUMERIC)
    comma = next((n for n in ("de_DE.UTF-8", "fr_FR.UTF-8") if _has_locale(n)), "C")
    try:
        locale.setlocale(locale.LC_NUMERIC, comma)
        assert plain == svg_text(figure_of())
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def _has_locale(name: str) -> bool:
    before = locale.setlocale(locale.LC_NUMERIC)
    try:
        locale.setlocale(locale.LC_NUMERIC, name)
    except locale.Error:
        return False
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)
    return True


def test_mean_interval_of_known_values():
    mean, low, high = mean_interval(np.array([1.0, 2.0, 3.0, np.nan]))

    assert mean == 2.0
    assert (low, high) == pytest.approx(
        (2 - 4.302652729911275 / 3**0.5, 2 + 4.302652729911275 / 3**0.5)
    )


def test_mean_interval_of_one_value_has_no_bounds():
    mean, low, high = mean_interval(np.array([5.0]))

    assert mean == 5.0
    assert np.isnan([low, high]).all()


def test_spread_stays_within_its_width_and_separates_equal_values():
    offsets = spread_out(np.full(30, 2.0), 0.2)

    assert np.abs(offsets).max() <= 0.2
    assert len(np.unique(offsets)) == 30
