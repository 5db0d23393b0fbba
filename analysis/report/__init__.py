"""Self-contained HTML reports: pieces any study's report is made of, and the page around them."""

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
from visavis.analysis.report.page import render_page, write_page
from visavis.analysis.report.provenance import ReportProvenance, SessionSource

__all__ = [
    "Block",
    "Bullets",
    "Cell",
    "Code",
    "Column",
    "Facts",
    "Fold",
    "Opening",
    "Page",
    "Paragraph",
    "Photo",
    "Picture",
    "ReportProvenance",
    "Section",
    "SessionSource",
    "Table",
    "Verdict",
    "Verdicts",
    "render_page",
    "write_page",
]
