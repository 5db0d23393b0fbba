import re
from html.parser import HTMLParser

import pytest

from visavis.analysis.report import (
    Bullets,
    Cell,
    Code,
    Column,
    Facts,
    Fold,
    Opening,
    Page,
    Paragraph,
    Photo,
    Picture,
    Section,
    Table,
    Verdict,
    Verdicts,
    render_page,
    write_page,
)
from visavis.lab.errors import UsageError

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Balance(HTMLParser):
    """Fails on a tag that is closed without having been opened, or left open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


EVERY_BLOCK = (
    Paragraph("p = .03 & more"),
    Bullets(("one", "two")),
    Facts((("n", "30"),)),
    Opening(
        Verdict("found", "Yes", "because"),
        Picture('<svg viewBox="0 0 1 1"></svg>', "Title", "Caption", "Alternative", "a,b\n1,2\n"),
        Photo(b"\xff\xd8\xff", "The place", "A room"),
    ),
    Verdicts((Verdict("found", "Found", "detail"),)),
    Table(
        (Column("Measure"), Column("p", "right", "Here"), Column("p", "right", "There")),
        (("dwell", Cell(".01", "strong", "why"), Cell("–", "weak")),),
        "Caption",
        "A note",
    ),
    Picture('<svg viewBox="0 0 1 1"></svg>', "Title", "Caption", "Alternative"),
    Code(("visavis report",)),
    Fold("More", (Paragraph("inner"),)),
)


def page(*, is_simulated: bool = False, blocks=EVERY_BLOCK) -> Page:
    return Page(
        title="A study",
        subtitle="A question",
        facts=Facts((("Data", "real"),)),
        is_simulated=is_simulated,
        sections=(Section("one", "One", blocks),),
    )


def test_every_block_renders_to_balanced_html():
    parser = Balance()
    parser.feed(render_page(page(blocks=EVERY_BLOCK)))

    assert parser.open == []
    assert {"table", "figure", "details", "pre", "ul", "dl"} <= set(parser.seen)


def test_text_is_escaped_everywhere():
    evil = "<script>alert(1)</script>"
    blocks = (
        Paragraph(evil),
        Bullets((evil,)),
        Facts(((evil, evil),)),
        Verdicts((Verdict("found", evil, evil),)),
        Table((Column(evil),), ((Cell(evil, hint=evil),),), evil, evil),
        Picture("<svg></svg>", evil, evil, evil, evil),
        Opening(Verdict("found", evil, evil), place=Photo(b"", evil, evil)),
        Code((evil,)),
        Fold(evil, ()),
    )

    own = render_page(page(blocks=()))
    assert own.count("<script") == render_page(page(blocks=blocks)).count("<script") == 1
    assert evil not in render_page(page(blocks=blocks))


def test_simulated_page_has_banner_and_printed_watermark_and_real_has_none():
    simulated, real = (render_page(page(is_simulated=s)) for s in (True, False))

    assert 'class="banner"' in simulated
    assert 'class="watermark"' in simulated
    assert "[simulated]" in simulated
    assert 'class="banner"' not in real
    assert 'class="watermark"' not in real


def test_page_asks_nothing_of_the_network():
    text = render_page(page(blocks=EVERY_BLOCK)).replace('src="data:', "")

    for word in (
        "http://",
        "https://",
        "<link",
        "<script ",
        "<iframe",
        "fetch(",
        "@import",
        "src=",
    ):
        assert word not in text


def test_group_headings_span_their_columns():
    text = render_page(page(blocks=EVERY_BLOCK))

    assert '<th colspan="1" class="group">Here</th>' in text


def test_row_of_the_wrong_length_is_refused():
    with pytest.raises(ValueError, match="row 1 of table 'T' has 1 cells for 2 columns"):
        Table((Column("a"), Column("b")), (("x",),), "T")


def test_numbers_stay_with_their_sign_on_one_line():
    assert "p\u00a0=\u00a0.03 &amp; more" in render_page(page(blocks=EVERY_BLOCK))


def test_writing_replaces_an_older_file_and_leaves_no_part(tmp_path):
    path = tmp_path / "sous-dossier é" / "report.html"
    write_page(page(), path)
    write_page(page(is_simulated=True), path)

    assert "SIMULATED" in path.read_text(encoding="utf-8")
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]


def test_folder_that_is_a_file_gives_a_clear_error(tmp_path):
    (tmp_path / "taken").write_text("x")

    with pytest.raises(UsageError, match="choose a folder"):
        write_page(page(), tmp_path / "taken" / "report.html")


def table(rows: int) -> Table:
    return Table((Column("What"),), (("x",),) * rows, f"{rows} rows")


def test_tables_are_closed_but_for_short_ones_of_the_first_section():
    first, later = Section("a", "A", (table(12), table(13))), Section("b", "B", (table(1),))
    made = Page("A study", "?", Facts(()), False, (first, later))

    html = render_page(made)

    assert [
        '<div class="table">',
        '<details class="table">',
        '<details class="table">',
    ] == re.findall(r'<(?:div|details) class="table">', html)
    assert "open them" in html or "opens them" in html  # on paper it says what is not there


def test_first_screen_has_the_answer_its_figure_and_the_place():
    html = render_page(page())

    opening = html[html.index("opening") : html.index("because")]
    assert ["Yes", "data-csv=", "<svg", "data:image/jpeg;base64,/9j/", "The place"] == [
        part
        for part in ("Yes", "data-csv=", "<svg", "data:image/jpeg;base64,/9j/", "The place")
        if part in opening
    ]
