"""A report in a real browser: every width, tables to take along, and the mark they bear."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.running.page.test_browser import faults_for_people
from visavis.analysis.plots import draw, new_figure, svg_for_page
from visavis.analysis.plots.figure_files import svg_text
from visavis.analysis.plots.panels import ALL, left_out_lines, paired_lines
from visavis.analysis.report.blocks import (
    Cell,
    Code,
    Column,
    Facts,
    Fold,
    Opening,
    Page,
    Picture,
    Section,
    Table,
    Verdict,
    Verdicts,
)
from visavis.analysis.report.page import write_page

SVG = '<svg viewBox="0 0 {0} 200" width="{0}pt" xmlns="http://www.w3.org/2000/svg"></svg>'

pytestmark = [
    pytest.mark.slow,  # a browser
]


def report(folder: Path, *, is_simulated: bool) -> str:
    columns = (Column("What"), Column("M", "right", "Here"), Column("p", "right", "Here"))
    rows: tuple[tuple[Cell | str, ...], ...] = (
        ("Dwell, in ms", "1,250", Cell("< .001", "strong")),
        ('Say "no" & <go>', "–", ".12"),
    )
    blocks = (
        Verdicts((Verdict("found", "More with A", "Means differ, t(19) = 4.2, p = .03."),)),
        Table(columns, rows, "Means by condition", "SD in brackets."),
        Picture(SVG.format(900), "Wide", "goes on", "a wide figure"),
        Picture(SVG.format(300), "Narrow", "fits", "a narrow figure"),
        Code(
            ("visavis simulate study.py --participants 20 --seed 1 --output data/dry_runs/study",)
        ),
    )
    made = Page("A study", "?", Facts(()), is_simulated, (Section("one", "One", blocks),))
    return write_page(made, folder / "report.html").as_uri()


@pytest.mark.parametrize("width", [2560, 1366, 820, 390, 320])
def test_nothing_of_a_report_is_cut_off(width: int, browser: Any, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800})
    page.goto(report(tmp_path, is_simulated=True))
    assert width == page.evaluate("() => document.documentElement.scrollWidth")
    narrow = page.locator(".plot:not(.wide) svg").bounding_box()
    assert narrow["x"] + narrow["width"] <= width
    wide = page.locator(".plot.wide")
    moves = wide.evaluate("place => place.scrollWidth > place.clientWidth")
    assert (width < 400) == moves
    assert wide.get_attribute("tabindex") == "0"  # which the keyboard can move, too


@pytest.mark.parametrize("width_px", [320, 2560])
def test_firefox_shows_a_report_whole_and_unfolds_what_is_folded(
    width_px: int, other_browser: Any, tmp_path: Path
) -> None:
    window = other_browser
    window.size(width_px, 900)
    window.goto(report(tmp_path, is_simulated=True))
    assert width_px >= window.evaluate("document.documentElement.scrollWidth")
    narrow = "document.querySelector('.plot:not(.wide) svg').getBoundingClientRect()"
    assert 0 < window.evaluate(f"{narrow}.width")
    assert width_px >= window.evaluate(f"{narrow}.right")
    table = "document.querySelector('table').getBoundingClientRect().height"
    is_folded = window.evaluate("document.querySelector('details') !== null")
    if is_folded:
        assert 0 == window.evaluate(table)
        window.click("summary")
    window.wait_for(f"{table} > 0", 10.0)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_report_shuts_people_out(scheme: Any, browser: Any, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 800}, color_scheme=scheme)
    page.goto(report(tmp_path, is_simulated=True))
    assert [] == faults_for_people(page)


def test_a_list_of_words_is_read_on_a_phone_without_moving_it(browser: Any, tmp_path: Path) -> None:
    rows = (
        ("Calibration: procedure, points, acceptance", "own procedure, then validation " * 4),
        ("Recordings: SHA-256 of all together", "f" * 64),
    )
    table = Table((Column("Item"), Column("This study")), rows, "Reporting list")
    made = Page("A study", "?", Facts(()), False, (Section("one", "One", (table,)),))
    page = browser.new_page(viewport={"width": 390, "height": 800})
    page.goto(write_page(made, tmp_path / "list.html").as_uri())
    place = page.locator(".scroll")
    assert place.evaluate("place => place.scrollWidth <= place.clientWidth")
    assert 120 <= page.locator("tbody th").first.bounding_box()["width"]


@pytest.mark.parametrize("is_simulated", [True, False])
def test_a_table_is_downloaded_as_it_stands_with_its_mark(
    is_simulated: bool, browser: Any, tmp_path: Path
) -> None:
    page = browser.new_page()
    page.goto(report(tmp_path, is_simulated=is_simulated))
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Download CSV").click()
    got = waiting.value
    mark = "true" if is_simulated else "false"
    prefix = "simulated_" if is_simulated else ""
    assert f"{prefix}table_1_means_by_condition.csv" == got.suggested_filename
    got.save_as(tmp_path / "got.csv")
    with (tmp_path / "got.csv").open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.reader(file))
    assert [
        ["What", "Here, M", "Here, p", "is_simulated"],
        ["Dwell, in ms", "1,250", "< .001", mark],
        ['Say "no" & <go>', "–", ".12", mark],
    ] == rows


@pytest.mark.parametrize("is_simulated", [True, False])
def test_a_table_is_copied_as_apa_wants_it(
    is_simulated: bool, browser: Any, tmp_path: Path
) -> None:
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(report(tmp_path, is_simulated=is_simulated))
    page.get_by_role("button", name="Copy as APA").click()
    plain, html = page.evaluate(
        """async () => {
            const [item] = await navigator.clipboard.read();
            const of = async (kind) => (await item.getType(kind)).text();
            return [await of("text/plain"), await of("text/html")];
        }"""
    )
    mark = "Simulated data: no human took part. " if is_simulated else ""
    assert plain.startswith("Table 1\nMeans by condition\n")
    assert plain.endswith(f"Note. {mark}SD in brackets.\n")
    assert f"<i>Note.</i> {mark}SD in brackets." in html
    assert 'Say "no" &amp; &lt;go' in html
    page.get_by_role("button", name="Copy", exact=True).click()
    said = page.evaluate("() => navigator.clipboard.readText()")
    assert f"Means differ, t(19) = 4.2, p = .03. {mark}".strip() == said


def figure(name: str, values: list[float]) -> Picture:
    """Return a figure of three people: one lost trials to a rule, the last does not count."""

    def make() -> Figure:
        made = new_figure(4, 3)
        axes = made.add_subplot()
        table = np.array([values, values[::-1]])
        paired_lines(axes, table, ["a", "b"], ["#0b5d8f", "#d55e00"], people=["07K", "08M"])
        left_out_lines(axes, np.array([[0.0, 1.0]]), ["09X"])
        left_out_lines(axes, table[:1], ["08M"], kind=ALL)
        return made

    drawn = draw(name, make, title=name, caption="C", alternative="A", is_simulated=False)
    return Picture(svg_for_page(drawn), name, "C", "A")


def people_report(folder: Path) -> str:
    columns = (Column("Participant"), Column("M", "right"))
    table = Table(columns, (("07K", "1"), ("08M", "2")), "Everybody")
    blocks = (figure("one", [1.0, 2.0]), figure("two", [3.0, 1.0]), table)
    made = Page("A study", "?", Facts(()), False, (Section("one", "One", blocks),))
    return write_page(made, folder / "people.html").as_uri()


def lit(page: Any) -> list[str]:
    """Return what is lit: participants' groups in figures, and rows."""
    found: list[str] = page.evaluate(
        "() => [...document.querySelectorAll('.lit')].map(e => e.dataset.who || 'row ' + "
        "e.cells[0].textContent).sort()"
    )
    return found


def test_a_participant_is_shown_through_all_panels(browser: Any, tmp_path: Path) -> None:
    page = browser.new_page()
    page.goto(people_report(tmp_path))
    assert [] == lit(page)
    everywhere = ["07K", "07K", "07K", "07K", "row 07K"]  # a line and its dots in each figure
    page.locator("svg .who[data-who='07K'] use").first.hover(force=True)
    assert everywhere == lit(page)
    page.mouse.move(0, 0)
    assert [] == lit(page)
    page.get_by_label("Highlight a participant").get_by_role("combobox").select_option("07K")
    assert everywhere == lit(page)
    page.keyboard.press("Escape")
    assert [] == lit(page)


def test_who_was_left_out_is_shown_when_asked_and_not_before(browser: Any, tmp_path: Path) -> None:
    page = browser.new_page()
    page.goto(people_report(tmp_path))
    out = page.locator("svg .out[data-who='09X']").first
    assert not out.is_visible()
    box = page.get_by_label("Show who was left out (1)")
    box.check()
    assert out.is_visible()
    box.uncheck()
    assert not out.is_visible()


def test_what_trials_left_out_would_change_is_shown_when_asked(
    browser: Any, tmp_path: Path
) -> None:
    page = browser.new_page()
    page.goto(people_report(tmp_path))
    with_all = page.locator("svg .all[data-who='08M']").first
    assert not with_all.is_visible()
    box = page.get_by_label("Show with trials left out, dotted (1)")
    box.check()
    assert with_all.is_visible()
    box.uncheck()
    assert not with_all.is_visible()


def test_a_trial_opens_its_page_or_copies_the_command_that_shows_it(
    browser: Any, tmp_path: Path
) -> None:
    (tmp_path / "views").mkdir()
    (tmp_path / "views" / "07K.html").write_text("<p>T03 again</p>", encoding="utf-8")
    rows = (
        ("07K", Cell("T03", link="views/07K.html#trial=T03")),
        ("08M", Cell("T05", command="visavis view data --trial T05 --show")),
    )
    table = Table((Column("Participant"), Column("Trial")), rows, "Trials to look at")
    blocks = (figure("one", [1.0, 2.0]), Fold("Trials to look at: 2", (table,)))
    made = Page("A study", "?", Facts(()), False, (Section("one", "One", blocks),))
    path = write_page(made, tmp_path / "trials.html")
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(path.as_uri())
    page.get_by_label("Highlight a participant").get_by_role("combobox").select_option("08M")
    page.get_by_role("button", name="1 trial to look at").click()
    page.get_by_role("button", name="T05", exact=True).click()
    copied = page.evaluate("() => navigator.clipboard.readText()")
    assert "visavis view data --trial T05 --show" == copied
    page.get_by_role("link", name="T03").click()
    page.wait_for_url("**/views/07K.html#trial=T03")
    assert "T03 again" == page.inner_text("p")


def test_a_figures_own_file_names_nobody_and_hides_who_was_left_out() -> None:
    def make() -> Figure:
        made = new_figure(4, 3)
        axes = made.add_subplot()
        paired_lines(axes, np.ones((1, 2)), ["a", "b"], ["#0b5d8f"] * 2, people=["07K"])
        left_out_lines(axes, np.ones((1, 2)), ["09X"])
        return made

    drawn = draw("f", make, title="", caption="", alternative="", is_simulated=False)
    assert {"07K", "09X"} == set(re.findall(r'data-who="(\w+)"', svg_for_page(drawn)))
    for name in ("07K", "09X"):
        assert name not in svg_text(drawn)


def opened_report(folder: Path) -> Path:
    drawn = figure("one", [1.0, 2.0])
    answer = Verdict("found", "People look longer at who looks at them", "t(19) = 4.2. " * 30)
    opening = Opening(answer, Picture(drawn.svg, "One", "C", "A", "who,a\n07K,1\n"))
    tables = tuple(Table((Column("N"),), (("1",),) * 40, f"Table of {i}") for i in range(9))
    sections = (Section("one", "One", (opening,)), Section("two", "Two", tables))
    return write_page(Page("A study", "?", Facts(()), True, sections), folder / "opened.html")


@pytest.mark.parametrize(("width", "height"), [(1366, 768), (390, 844)])
def test_the_answer_and_its_figure_stand_on_the_first_screen(
    width: int, height: int, browser: Any, tmp_path: Path
) -> None:
    page = browser.new_page(viewport={"width": width, "height": height})
    page.goto(opened_report(tmp_path).as_uri())
    for part in ("h3", ".opening svg"):
        box = page.locator(part).first.bounding_box()
        assert box["y"] + box["height"] <= height


def test_a_dark_screen_gets_dark_paper_and_figures_stay_readable(
    browser: Any, tmp_path: Path
) -> None:
    page = browser.new_page(color_scheme="dark")
    page.goto(opened_report(tmp_path).as_uri())
    colour = "part => getComputedStyle(document.querySelector(part)).backgroundColor"
    assert "rgb(20, 24, 30)" == page.evaluate(colour, "body")
    assert "rgb(247, 247, 245)" == page.evaluate(colour, ".plot svg")


def test_tables_are_opened_together_and_closed_ones_are_not_printed(
    browser: Any, tmp_path: Path
) -> None:
    page = browser.new_page()
    page.goto(opened_report(tmp_path).as_uri())
    page.emulate_media(media="print")
    assert 0 == page.locator("details.table:visible").count()
    assert page.locator(".paper").is_visible()
    page.emulate_media(media="screen")
    page.get_by_role("button", name="Open all tables").click()
    assert 9 == page.locator("details.table[open]").count()
    page.emulate_media(media="print")
    assert 9 == page.locator("details.table:visible").count()


def test_a_figure_is_downloaded_without_names_and_with_its_data(
    browser: Any, tmp_path: Path
) -> None:
    page = browser.new_page()
    page.goto(opened_report(tmp_path).as_uri())
    texts = []
    for name in ("Download SVG", "Its data"):
        with page.expect_download() as waited:
            page.get_by_role("button", name=name).click()
        assert waited.value.suggested_filename.startswith("simulated_figure_1_one")
        texts.append(Path(waited.value.path()).read_text(encoding="utf-8-sig"))
    assert texts[0].startswith("<svg")
    assert "07K" not in texts[0]
    assert "09X" not in texts[0]
    assert "who,a\n07K,1\n" == texts[1]
