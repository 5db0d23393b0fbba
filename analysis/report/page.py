"""Render a page into one HTML file that asks nothing of the network."""

import math
import re
from base64 import b64encode
from html import escape
from itertools import groupby
from pathlib import Path

from visavis.analysis.report.blocks import (
    Block,
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
)
from visavis.analysis.report.notation import count_of
from visavis.lab.errors import UsageError

SIMULATED_BANNER = "SIMULATED DATA – no human took part; do not report as results"

_ANSWER = {
    "found": "✔",
    "partly": "◐",
    "reversed": "✘",
    "not_found": "○",
    "undecided": "?",
}
_STYLE = Path(__file__).with_name("page.css")
_SCRIPT = Path(__file__).with_name("page.js")
_PAPER = (
    '<p class="paper">Tables that were closed on the screen are not printed; "Open all tables" '
    "opens them.</p>\n"
)
WIDE_PT = 480.0
"""Figures wider than this keep their size on a phone and scroll sideways."""
SHORT_ROWS = 12
"""Tables of up to so many rows stand open in the first section; all others are closed."""


_VIEW_BOX = re.compile(r'<svg[^>]*\bviewBox="\S+ \S+ ([\d.]+) ')


def render_page(page: Page) -> str:
    """Return the page as HTML; the same page gives the same text."""
    banner = ""
    if page.is_simulated:
        banner = (
            f'<aside class="banner">{escape(SIMULATED_BANNER)}</aside>\n'
            '<div class="watermark" aria-hidden="true">SIMULATED</div>\n'
        )
    links = "".join(
        f'<a href="#{escape(s.anchor, quote=True)}">{escape(s.title)}</a>' for s in page.sections
    )
    sections = "\n".join(_section(s, 0 if i else SHORT_ROWS) for i, s in enumerate(page.sections))
    kind = "simulated" if page.is_simulated else "real"
    return (
        f'<!DOCTYPE html>\n<html lang="{escape(page.language)}">\n<head>\n'
        '<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{'[simulated] ' if page.is_simulated else ''}{escape(page.title)}</title>\n"
        f"<style>\n{_STYLE.read_text(encoding='utf-8')}</style>\n</head>\n"
        f'<body class="{kind}">\n{banner}<header>\n<h1>{escape(page.title)}</h1>\n'
        f'<p class="subtitle">{escape(page.subtitle)}</p>\n{_facts(page.facts)}</header>\n'
        f'<div class="columns">\n<nav aria-label="Sections">{links}</nav>\n'
        f"<main>\n{sections}\n{_PAPER}</main>\n</div>\n"
        f"<footer>{escape(page.footer)}</footer>\n"
        f"<script>\n{_SCRIPT.read_text(encoding='utf-8')}</script>\n</body>\n</html>\n"
    )


def write_page(page: Page, path: Path) -> Path:
    """Write the page, replacing an older one in one step; returns the path."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(path.name + ".part")
        part.write_text(render_page(page), encoding="utf-8", newline="\n")
        part.replace(path)
    except OSError as error:
        raise UsageError(
            f"the report cannot be written to {path}: {error.strerror or error}; choose a folder "
            "you may write to"
        ) from error
    return path


def _section(section: Section, open_rows: int) -> str:
    blocks = "\n".join(_block(b, open_rows) for b in section.blocks)
    anchor = escape(section.anchor, quote=True)
    return f'<section id="{anchor}">\n<h2>{escape(section.title)}</h2>\n{blocks}\n</section>'


def _block(block: Block, open_rows: float = math.inf) -> str:
    """Return a block; tables of more rows than `open_rows` are closed."""
    match block:
        case Paragraph(text):
            return f"<p>{_running(text)}</p>"
        case Bullets(items):
            return "<ul>" + "".join(f"<li>{_running(i)}</li>" for i in items) + "</ul>"
        case Facts():
            return _facts(block)
        case Opening():
            return _opening(block)
        case Verdicts(items):
            return '<div class="verdicts">' + "".join(map(_verdict, items)) + "</div>"
        case Table():
            return _table(block, is_open=len(block.rows) <= open_rows)
        case Picture():
            return _picture(block)
        case Photo():
            return _photo(block)
        case Code(lines):
            return '<pre tabindex="0"><code>' + escape("\n".join(lines)) + "</code></pre>"
        case Fold(summary, blocks):
            inner = "\n".join(_block(b) for b in blocks)
            return f"<details><summary>{escape(summary)}</summary>\n{inner}\n</details>"


def _running(text: str) -> str:
    """Escape running text and keep 'p = .03' and '504 ms' on one line."""
    unbroken = re.sub(r" ([=<>]) ", "\u00a0\\1\u00a0", text)
    return escape(re.sub(r"(?<=\d) (?=(ms|%)\b|%)", "\u00a0", unbroken))


def _facts(facts: Facts) -> str:
    pairs = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in facts.pairs
    )
    return f'<dl class="facts">{pairs}</dl>\n'


def _verdict(verdict: Verdict, pictures: str = "") -> str:
    opens = " opening" if pictures else ""
    rank = '<span class="rank">Secondary: </span>' if verdict.is_secondary else ""
    return (
        f'<div class="verdict {verdict.status}{opens}"><h3><span class="answer" aria-hidden="true">'
        f"{_ANSWER[verdict.status]}</span>{rank}{escape(verdict.headline)}</h3>"
        f"{pictures}<p>{_running(verdict.detail)}</p></div>"
    )


def _opening(opening: Opening) -> str:
    pictures = "" if opening.picture is None else _picture(opening.picture)
    pictures += "" if opening.place is None else _photo(opening.place)
    return _verdict(opening.answer, f'<div class="pictures">{pictures}</div>' if pictures else "")


def _photo(photo: Photo) -> str:
    return (
        f'<figure class="photo"><img src="data:image/jpeg;base64,{b64encode(photo.jpeg).decode()}" '
        f'alt="{escape(photo.alternative, quote=True)}"><figcaption>{escape(photo.caption)}'
        "</figcaption></figure>"
    )


def _picture(picture: Picture) -> str:
    label = escape(picture.alternative, quote=True)
    box = _VIEW_BOX.search(picture.svg)
    wide = box is not None and float(box[1]) > WIDE_PT
    shape = 'class="plot wide" tabindex="0"' if wide else 'class="plot"'
    data = f' data-csv="{escape(picture.data, quote=True)}"' if picture.data else ""
    return (
        f'<figure{data}><div {shape} role="img" aria-label="{label}">{picture.svg}</div>'
        f"<figcaption><strong>{escape(picture.title)}.</strong> "
        f"{escape(picture.caption)}</figcaption></figure>"
    )


def _table(table: Table, *, is_open: bool) -> str:
    body = "\n".join(_row(row, table.columns) for row in table.rows)
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    caption = f'<span class="caption">{escape(table.caption)}</span>'
    head, end = f'<div class="table"><p>{caption}</p>', "</div>"
    if not is_open:
        count = f'<span class="count">{count_of(len(table.rows), "row")}</span>'
        head, end = f'<details class="table"><summary>{caption} {count}</summary>', "</details>"
    return (
        f'{head}<div class="scroll" tabindex="0" role="region" '
        f'aria-label="{escape(table.caption, quote=True)}">'
        f"<table>\n<thead>\n{_head(table.columns)}</thead>\n<tbody>\n{body}\n</tbody>\n</table>"
        f"</div>{note}{end}"
    )


def _head(columns: tuple[Column, ...]) -> str:
    names = "".join(
        f'<th scope="col" class="{c.align}">{escape(c.header)}</th>' if c.header else "<td></td>"
        for c in columns
    )
    if not any(c.group for c in columns):
        return f"<tr>{names}</tr>\n"
    groups = ""
    for group, members in groupby(columns, key=lambda c: c.group):
        span = len(tuple(members))
        head = f'<th colspan="{span}" class="group">{escape(group)}</th>'
        groups += head if group else f'<td colspan="{span}"></td>'
    return f"<tr>{groups}</tr>\n<tr>{names}</tr>\n"


def _cell_html(cell: Cell) -> str:
    text = escape(cell.text)
    if cell.link:
        return f'<a href="{escape(cell.link, quote=True)}">{text}</a>'
    if cell.command:
        command = escape(cell.command, quote=True)
        return f'<button type="button" data-command="{command}" title="{command}">{text}</button>'
    return text


def _row(row: tuple[Cell | str, ...], columns: tuple[Column, ...]) -> str:
    cells = []
    for i, (content, column) in enumerate(zip(row, columns, strict=True)):
        cell = Cell(content) if isinstance(content, str) else content
        hint = f' title="{escape(cell.hint, quote=True)}"' if cell.hint else ""
        look = f"{column.align} {cell.mark}".strip()
        tag, scope = ("th", ' scope="row"') if i == 0 else ("td", "")
        cells.append(f'<{tag}{scope} class="{look}"{hint}>{_cell_html(cell)}</{tag}>')
    return "<tr>" + "".join(cells) + "</tr>"
