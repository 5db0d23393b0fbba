"""The documentation: what is written from the code is as the code, the site builds, a page runs."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tools.docs_site import site_text
from tools.reference_pages import FOLDER, pages
from visavis.cli.app import app

ROOT = Path(__file__).parents[2]
FENCED = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PEOPLE = "2"
"""So many are simulated instead of those the page asks for."""


def test_pages_of_columns_and_settings_are_those_of_the_code() -> None:
    there = {p.relative_to(FOLDER).as_posix(): p.read_text("utf-8") for p in FOLDER.rglob("*.md")}
    wanted = pages()
    assert sorted(wanted) == sorted(there)
    old = [name for name, text in wanted.items() if text != there[name]]
    assert [] == old, "run: python -m tools.reference_pages"


def test_links_out_of_the_docs_lead_to_pages_of_the_site_or_nowhere() -> None:
    text = "[a](../experiments/stare/README.md#x) [b](decisions/) `[c](../lab)` [d](gaze.md)"
    assert "[a](studies/stare.md#x) b `[c](../lab)` [d](gaze.md)" == site_text(text, "power.md")
    assert "[`s`](studies/stare.md) `c`" == site_text(
        "[`s`](../experiments/stare/README.md) `c`", "a.md"
    )
    assert "[p](../pages.md)" == site_text("[p](../../docs/pages.md)", "studies/stare.md")


def test_the_index_of_decisions_leads_to_every_record() -> None:
    folder = ROOT / "docs" / "decisions"
    index = (folder / "README.md").read_text("utf-8")
    records = sorted(path.name for path in folder.glob("[0-9]*.md"))
    assert records == re.findall(r"^\| \[\d{4}\]\(([^)]+)\) \|", index, re.MULTILINE)


@pytest.mark.timeout(300)
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(tmp_path / "site")],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert 0 == built.returncode, built.stderr
    assert "WARNING" not in built.stderr
    front = (tmp_path / "site" / "index.html").read_text("utf-8")
    assert not re.search(r'(?:src|href)="https?://(?!www\.w3)[^"]+\.(?:js|css|woff2?)"', front)


@pytest.mark.timeout(600)
def test_the_first_report_is_reached_by_its_page_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "first-report.md").read_text("utf-8")
    typed = [line for block in FENCED.findall(page) for line in block.splitlines()]
    told = "the folder's name, as the page has it"
    for line in typed:
        words = shlex.split(line, comments=True)
        if words[0] != "visavis":
            continue
        if "--participants" in words:
            asked = words.index("--participants") + 1
            told, words[asked] = f"_n{words[asked]}_", PEOPLE
            words += ["--processes", "1"]
        words = [word.replace(told, f"_n{PEOPLE}_") for word in words]
        done = CliRunner().invoke(app, words[1:])
        may_end = (0, 4) if words[1] == "doctor" else (0,)  # which looks at this computer
        assert done.exit_code in may_end, f"{line}\n{done.output}\n{done.exception!r}"
    (report,) = tmp_path.rglob("report.html")
    assert "data-who=" in report.read_text("utf-8")
