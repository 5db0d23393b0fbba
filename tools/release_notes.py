"""Gather the fragments of changelog.d into CHANGELOG.md: `python -m tools.release_notes VERSION`.

The version becomes the topmost heading, with the day given by --date; gathered fragments are
deleted. pyproject.toml and CITATION.cff get the version too, the latter the day as well. A file of
changelog.d that is not a fragment, or an empty one, ends it before anything is written.
"""

import argparse
import re
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

KINDS = ("added", "changed", "fixed", "removed")
NAME = re.compile(r"(?P<issue>\d+)(?:\.(?P<about>[a-z0-9-]+))?\.(?P<kind>[a-z]+)\.md")
KEPT = "README.md"
HEAD = """# Changelog

What changed for people who use Visavis, newest version first. Changes since the last version lie
in `changelog.d/`, one file each.
"""
WIDTH = 100
VERSION_LINES = {
    "pyproject.toml": r'(?m)^(version = ").*(")$',
    "CITATION.cff": r"(?m)^(version: ).*()$",
}
"""Files that name the version, and the line in which they do."""
DAY = re.compile(r"\d{4}-\d{2}-\d{2}")


class ReleaseError(Exception):
    """Why no notes can be made."""


@dataclass(frozen=True, order=True)
class Fragment:
    """One change; fragments sort by kind, issue and name."""

    kind: int
    issue: int
    about: str
    path: Path
    text: str


def fragments(folder: Path) -> list[Fragment]:
    """Return the fragments of a folder in the order of the changelog.

    Raises:
        ReleaseError: a file is named otherwise or empty.
    """
    found = []
    for path in folder.iterdir():
        if path.name == KEPT:
            continue
        named = NAME.fullmatch(path.name)
        if named is None or named["kind"] not in KINDS:
            raise ReleaseError(
                f"{path} is not a fragment; name it ISSUE.KIND.md or ISSUE.ABOUT.KIND.md, where "
                f"KIND is {', '.join(KINDS)}"
            )
        text = _plain_text(path.read_text("utf-8"))
        if not text:
            raise ReleaseError(f"{path} is empty; say in it what changed, or delete it")
        kind = KINDS.index(named["kind"])
        found.append(Fragment(kind, int(named["issue"]), named["about"] or "", path, text))
    return sorted(found)


def _plain_text(text: str) -> str:
    """Return a fragment's paragraphs, each in one line; the items of a list are paragraphs, too."""
    paragraphs = re.split(r"\n\s*\n|\n(?=- )", text.strip())
    return "\n\n".join(" ".join(part.split()) for part in paragraphs)


def section(version: str, day: str, changes: Sequence[Fragment]) -> str:
    """Return what the changelog says of a version."""
    parts = [f"## {version}, {day}\n"]
    for number, kind in enumerate(KINDS):
        own = [c for c in changes if c.kind == number]
        if own:
            parts.append(f"### {kind.capitalize()}\n\n" + "".join(_bullets(c.text) for c in own))
    return "\n".join(parts)


def _bullets(text: str) -> str:
    """Wrap a change's paragraphs under its bullet, which takes two columns; a list has several."""
    bullets: list[str] = []
    for part in text.split("\n\n"):
        lines = textwrap.wrap(
            part.removeprefix("- "), WIDTH - 2, break_long_words=False, break_on_hyphens=False
        )
        wrapped = "\n  ".join(lines)
        if bullets and not part.startswith("- "):
            bullets[-1] += f"\n\n  {wrapped}"
        else:
            bullets.append(f"- {wrapped}")
    return "".join(f"{bullet}\n" for bullet in bullets)


def release(root: Path, version: str, day: str) -> int:
    """Write the changelog of a repository, delete its fragments and return how many there were.

    Raises:
        ReleaseError: there is nothing to gather, the version is there already, or a name is wrong.
    """
    if not DAY.fullmatch(day):
        raise ReleaseError(f"--date takes a day such as 2026-01-31, not {day!r}")
    changes = fragments(root / "changelog.d")
    if not changes:
        raise ReleaseError("changelog.d holds no fragments; nothing has changed since")
    path = root / "CHANGELOG.md"
    before = path.read_text("utf-8") if path.exists() else HEAD
    if not before.startswith(HEAD):
        raise ReleaseError(f"{path} does not begin as written here; put its head back")
    if re.search(rf"^## {re.escape(version)}(,|$)", before, re.MULTILINE):
        raise ReleaseError(f"{path} has {version} already; a version is never written twice")
    older = before.removeprefix(HEAD)
    path.write_text(f"{HEAD}\n{section(version, day, changes)}{older}", "utf-8")
    for change in changes:
        change.path.unlink()
    return len(changes)


def stamped(root: Path, version: str, day: str) -> dict[Path, str]:
    """Return what the files that name the version say from now on.

    Raises:
        ReleaseError: one of them names none.
    """
    new: dict[Path, str] = {}
    for name, line in VERSION_LINES.items():
        path = root / name
        text, count = re.subn(line, rf"\g<1>{version}\g<2>", path.read_text("utf-8"), count=1)
        if not count:
            raise ReleaseError(f"{path} has no line with the version; put it back")
        new[path] = re.sub(r"(?m)^(date-released: ).*$", rf"\g<1>{day}", text)
    return new


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the notes of a version; say how many changes they hold."""
    parser = argparse.ArgumentParser(prog="tools.release_notes", description=__doc__)
    parser.add_argument("version")
    parser.add_argument("--date", required=True, help="day of the release, such as 2026-01-31")
    options = parser.parse_args(arguments)
    root = Path(__file__).resolve().parents[1]
    try:
        texts = stamped(root, options.version, options.date)
        count = release(root, options.version, options.date)
    except ReleaseError as problem:
        sys.stderr.write(f"{problem}\n")
        return 2
    for path, text in texts.items():
        path.write_text(text, "utf-8")
    sys.stdout.write(f"CHANGELOG.md: {options.version} with {count} changes\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
