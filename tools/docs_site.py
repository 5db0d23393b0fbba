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
STUDIES: Final = ("stare", "crowd", "waving", "interpolation", "hybrid", "cameras")
TAKEN_IN: Final = {
    **{f"../experiments/{name}/README.md": f"studies/{name}.md" for name in STUDIES},
    "../CONTRIBUTING.md": "CONTRIBUTING.md",
}
"""Files outside of docs that are pages of the site, and where."""
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#\s]+)(#[^)]*)?\)")
_PICTURE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")


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
        words, target, anchor = found[1], found[2], found[3] or ""
        if re.match(r"[a-z]+:", target):
            return found[0]
        there = moved(target)
        return words if there is None else f"[{words}]({there}{anchor})"

    def picture(found: re.Match[str]) -> str:
        there = None if re.match(r"[a-z]+:", found[2]) else moved(found[2])
        return found[0] if there is None else f"![{found[1]}]({there})"

    parts = re.split(r"(^```.*?^```$|`[^`]+`)", markdown, flags=re.MULTILINE | re.DOTALL)
    return "".join(
        part if part.startswith("`") else _PICTURE.sub(picture, _LINK.sub(link, part))
        for part in parts
    )
