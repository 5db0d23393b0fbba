"""Fragments become a changelog, each exactly once."""

import re
import tomllib
from datetime import date
from pathlib import Path

import pytest
import yaml

from tools.release_notes import HEAD, ReleaseError, fragments, release, stamped

ROOT = Path(__file__).resolve().parents[2]


def changed(root: Path, **texts: str) -> Path:
    """Write fragments; in names of arguments `_` stands for a full stop, `__` for a hyphen."""
    folder = root / "changelog.d"
    folder.mkdir(exist_ok=True)
    (folder / "README.md").write_text("What lies here.")
    for name, text in texts.items():
        file = name.lstrip("_").replace("__", "-").replace("_", ".") + ".md"
        (folder / file).write_text(text, "utf-8")
    return root


def test_changes_stand_by_kind_then_by_issue(tmp_path: Path) -> None:
    changed(
        tmp_path,
        _10_fixed="Ten is\nmended.\n",
        _2_fixed="Two is mended.",
        _3_added="Three – new.",
        _2_long__name_added="Two has a name.",
    )
    assert 4 == release(tmp_path, "0.2.0", "2026-11-30")
    assert (
        f"{HEAD}\n## 0.2.0, 2026-11-30\n\n"
        "### Added\n\n- Two has a name.\n- Three – new.\n\n"
        "### Fixed\n\n- Two is mended.\n- Ten is mended.\n"
    ) == (tmp_path / "CHANGELOG.md").read_text("utf-8")
    assert ["README.md"] == [p.name for p in (tmp_path / "changelog.d").iterdir()]


def test_a_newer_version_stands_above_the_older(tmp_path: Path) -> None:
    release(changed(tmp_path, _1_added="First."), "0.1.0", "2026-11-01")
    release(changed(tmp_path, _2_added="Second."), "0.2.0", "2026-11-30")
    text = (tmp_path / "CHANGELOG.md").read_text("utf-8")
    assert (
        f"{HEAD}\n## 0.2.0, 2026-11-30\n\n### Added\n\n- Second.\n"
        "\n## 0.1.0, 2026-11-01\n\n### Added\n\n- First.\n"
    ) == text


def test_paragraphs_stay_apart(tmp_path: Path) -> None:
    release(changed(tmp_path, _1_added="One,\nthe first.\n\nTwo.\n"), "0.1.0", "2026-11-01")
    text = (tmp_path / "CHANGELOG.md").read_text("utf-8")
    assert text.endswith("- One, the first.\n\n  Two.\n")


def test_a_list_of_changes_has_a_bullet_for_each(tmp_path: Path) -> None:
    release(changed(tmp_path, _1_added="- One,\n  the first.\n- Two.\n"), "0.1.0", "2026-11-01")
    text = (tmp_path / "CHANGELOG.md").read_text("utf-8")
    assert text.endswith("### Added\n\n- One, the first.\n- Two.\n")


def test_long_changes_are_wrapped_under_themselves(tmp_path: Path) -> None:
    release(changed(tmp_path, _1_added="a-word " * 40), "0.1.0", "2026-11-01")
    lines = (tmp_path / "CHANGELOG.md").read_text("utf-8").splitlines()
    assert max(map(len, lines)) <= 100
    assert 3 == sum("a-word" in line for line in lines)
    assert all(line.startswith(("- ", "  ")) for line in lines if "a-word" in line)


WRONG = {
    "kind": ({"_1_mended": "x"}, "1.0", "2026-11-01", "is not a fragment"),
    "name": ({"Notes": "x"}, "1.0", "2026-11-01", "is not a fragment"),
    "empty": ({"_1_added": " \n"}, "1.0", "2026-11-01", "is empty"),
    "none": ({}, "1.0", "2026-11-01", "no fragments"),
    "again": ({"_1_added": "x"}, "0.9", "2026-11-01", "has 0.9 already"),
    "day": ({"_1_added": "x"}, "1.0", "tomorrow", "takes a day"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_before_anything_is_written(name: str, tmp_path: Path) -> None:
    texts, version, day, message = WRONG[name]
    release(changed(tmp_path, _1_added="Old."), "0.9", "2026-10-01")
    changed(tmp_path, **texts)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*.md")}
    with pytest.raises(ReleaseError, match=message):
        release(tmp_path, version, day)
    assert before == {p: p.read_bytes() for p in tmp_path.rglob("*.md")}


def test_every_fragment_of_the_repository_can_be_gathered() -> None:
    fragments(ROOT / "changelog.d")


def test_the_changelog_of_the_repository_begins_as_the_tool_writes_it() -> None:
    assert (ROOT / "CHANGELOG.md").read_text("utf-8").startswith(HEAD)


def test_project_and_citation_name_the_version_released() -> None:
    now = {p.name: p.read_text("utf-8") for p in (ROOT / "pyproject.toml", ROOT / "CITATION.cff")}
    new = {p.name: text for p, text in stamped(ROOT, "9.8.7", "2031-02-03").items()}
    assert (
        tomllib.loads(now["pyproject.toml"])["project"] | {"version": "9.8.7"}
        == (tomllib.loads(new["pyproject.toml"])["project"])
    )
    cited = yaml.safe_load(now["CITATION.cff"]) | {
        "version": "9.8.7",
        "date-released": date(2031, 2, 3),
    }
    assert cited == yaml.safe_load(new["CITATION.cff"])


def test_the_version_cited_is_the_newest_in_the_changelog() -> None:
    newest = re.search(r"(?m)^## (\S+), (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"))
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert newest is not None
    assert newest.groups() == (cited["version"], cited["date-released"].isoformat())


def test_a_file_without_its_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[project]\n", "utf-8")
    with pytest.raises(ReleaseError, match="no line with the version"):
        stamped(tmp_path, "0.2.0", "2026-11-30")
