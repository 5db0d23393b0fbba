"""Maps of gaze that `visavis gaze-map` wrote, for a report to show."""

import re
from html import unescape
from pathlib import Path
from typing import Final

from visavis.analysis.plots.figure_files import svg_of_page
from visavis.analysis.report import Picture

MAP_NAME: Final = "gaze_map_by"
"""How the names of their files begin."""
_OF_ANOTHER: Final = re.compile(r"<script|<foreignObject|\son\w+\s*=|javascript:", re.IGNORECASE)
"""What no figure of Visavis holds, and no report takes from a file."""


def gaze_map_pictures(folder: Path) -> list[Picture]:
    """Return the maps of gaze in a folder of figures, in the order of their names; files that are
    no figures of Visavis are left out.
    """
    pictures = []
    for path in sorted(folder.glob(f"{MAP_NAME}_*.svg")):
        text = path.read_text("utf-8", errors="replace")
        title, caption = (_of_file(text, name) for name in ("title", "description"))
        if title and "<svg" in text and "</svg>" in text and not _OF_ANOTHER.search(text):
            alternative = f"{title}: the scene with the time of gaze laid over it."
            pictures.append(Picture(svg_of_page(text, path.stem), title, caption, alternative))
    return pictures


def _of_file(text: str, name: str) -> str:
    """Return what the metadata of a figure's file say."""
    found = re.search(rf"<dc:{name}>(.*?)</dc:{name}>", text, re.DOTALL)
    return "" if found is None else unescape(found[1]).strip()
