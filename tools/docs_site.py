"""What mkdocs is told beside `mkdocs.yml`: pages that lie elsewhere, and links out of the docs.

The documentation is read as plain files first, so its links lead to files of the repository. On the
site the studies' method sections and the contributor's page are pages, and other files are named
without a link.
"""

import posixpath
import re
from pathlib import Path
from typing import Any, Final

from mkdocs.structure.files import File, Files

ROOT: Final = Path(__file__).parents[1]
STUDIES: Final = (
    "stare",
    "crowd",
    "waving",
    "interpolation",
    "hybrid",
    "cameras",
    "adjectives",
    "gestures",
    "matching",
)
TAKEN_IN: Final = {
    **{f"../experiments/{name}/README.md": f"studies/{name}.md" for name in STUDIES},
    "../CONTRIBUTING.md": "CONTRIBUTING.md",
}
"""Files outside of docs that are pages of the site, and where."""
_CODE_OR_LINK = re.compile(
    r"(?P<code>^```.*?^```$|`[^`]*`)"
    r"|(?P<mark>!?)\[(?P<words>[^\]]*)\]\((?P<target>[^)#\s]+)(?P<anchor>#[^)]*)?\)",
    re.MULTILINE | re.DOTALL,
)
"""Code, which stays as it is, a link or a picture; whichever begins first."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie elsewhere."""
    for path, page in TAKEN_IN.items():
        text = (ROOT / "docs" / path).read_text("utf-8")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links lead to pages of the site; name what is none."""
    return site_text(markdown, page.file.src_uri)


def site_text(markdown: str, page: str) -> str:
    """Return a page's text with links as they are on the site; `page` is its path below docs."""
    from_file = {target: source for source, target in TAKEN_IN.items()}.get(page, page)
    here = posixpath.dirname(from_file)

    def moved(target: str) -> str | None:
        """Return a link's target on the site; None where it has none."""
        path = posixpath.normpath(posixpath.join(here, target))
        path = TAKEN_IN.get(path, path).removeprefix("../docs/")
        if path.startswith(".."):
            return None
        if (ROOT / "docs" / path).is_dir():
            return None
        return posixpath.relpath(path, posixpath.dirname(page) or ".")

    def link(found: re.Match[str]) -> str:
        target = found["target"]
        if found["code"] is not None or re.match(r"[a-z]+:", target):
            return found[0]
        there = moved(target)
        if there is None:
            return found["words"]
        return f"{found['mark']}[{found['words']}]({there}{found['anchor'] or ''})"

    return _CODE_OR_LINK.sub(link, markdown)
