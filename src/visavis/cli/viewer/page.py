"""The page itself: one HTML file with everything in it, that works without a network."""

import html
import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

from visavis.cli.viewer.bundle import Bundle
from visavis.recording.durable import make_folder
from visavis.running import page as pages_of_people

_HERE = Path(__file__).parent
_SITE = Path(pages_of_people.__path__[0]) / "site"


def page_of(header: dict[str, Any], bundle: Bundle) -> str:
    """Return the file's text."""
    title = header.get("title") or (
        f"{header['study']} {header['participant']} session {header['session']}"
    )
    mark = " (simulated)" if header["simulated"] else ""
    page = (_HERE / "page.html").read_text(encoding="utf-8")
    return (
        page.replace("<!--title-->", html.escape(title + mark))
        .replace("/*style*/", (_HERE / "viewer.css").read_text(encoding="utf-8"))
        .replace("/*code*/", "".join(map(_script, CODE)))
        .replace("<!--data-->", bundle.text(header))
    )


class TrialsBeside:
    """Files of the trials and films that do not fit into a page, in a folder beside it."""

    def __init__(self, page: Path) -> None:
        self.folder = page.with_name(f"{page.stem}_trials")
        self.files: list[Path] = []

    def write(self, whose: str, text: str) -> str:
        """Write the file of a trial or of films; return the place that the page loads it from.

        Pages opened as files may read scripts, and nothing else.
        """
        make_folder(self.folder, exist_ok=True)
        name = re.sub(r"[^A-Za-z0-9_-]", "-", whose)
        file = self.folder / f"{len(self.files):03}_{name}.js"
        place = f"{quote(self.folder.name)}/{file.name}"
        file.write_text(f"visavisTrial({json.dumps(place)},{json.dumps(text)})", encoding="utf-8")
        self.files.append(file)
        return place


def _script(file: Path) -> str:
    """Return a file of code; what pages load as modules stands in the same text as the others."""
    return re.sub(r"^export ", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE)


CODE = (
    _HERE / "data.js",
    *(_SITE / name for name in ("painting.js", "headset_space.js")),
    *(
        _HERE / f"{name}.js"
        for name in "drawing quick cutting flat scene looks coding pages".split()
    ),
    *(_HERE / f"{name}.js" for name in ("timeline", "saving", "headset", "viewer")),
)
"""Files of the page's code, in the order in which they stand in it."""
