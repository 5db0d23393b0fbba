"""The page itself: one HTML file with everything in it, that works without a network."""

import html
from pathlib import Path
from typing import Any

from visavis.cli.viewer.bundle import Bundle

_HERE = Path(__file__).parent


def page_of(header: dict[str, Any], bundle: Bundle) -> str:
    """Return the file's text."""
    title = f"{header['study']} {header['participant']} session {header['session']}"
    mark = " (simulated)" if header["simulated"] else ""
    page = (_HERE / "page.html").read_text(encoding="utf-8")
    return (
        page.replace("<!--title-->", html.escape(title + mark))
        .replace("/*style*/", (_HERE / "viewer.css").read_text(encoding="utf-8"))
        .replace(
            "/*code*/", "".join((_HERE / f"{name}.js").read_text(encoding="utf-8") for name in CODE)
        )
        .replace("<!--data-->", bundle.text(header))
    )


CODE = ("data", "drawing", "quick", "scene", "pages", "timeline", "viewer")
"""Files of the page's code, in the order in which they stand in it."""
