"""A report in a real browser: every width, tables to take along, and the mark they bear."""

import csv
from pathlib import Path
from typing import Any

import pytest

from analysis.report.blocks import (
    Cell,
    Column,
    Facts,
    Page,
    Picture,
    Section,
    Table,
    Verdict,
    Verdicts,
)
from analysis.report.page import write_page

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
    )
    made = Page("A study", "?", Facts(()), is_simulated, (Section("one", "One", blocks),))
    return write_page(made, folder / "report.html").as_uri()


@pytest.mark.parametrize("width", [1366, 820, 390])
def test_nothing_of_a_report_is_cut_off(width: int, browser: Any, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800})
    page.goto(report(tmp_path, is_simulated=True))
    assert width == page.evaluate("() => document.documentElement.scrollWidth")
    narrow = page.locator(".plot:not(.wide) svg").bounding_box()
    assert narrow["x"] + narrow["width"] <= width
    wide = page.locator(".plot.wide")
    moves = wide.evaluate("place => place.scrollWidth > place.clientWidth")
    assert (width == 390) == moves
    assert wide.get_attribute("tabindex") == "0"  # which the keyboard can move, too


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
