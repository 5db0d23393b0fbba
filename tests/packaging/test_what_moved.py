"""The page on moved names: every new name can be imported, and its recipes do what they say."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "what-moved.md"
TEXT = PAGE.read_text("utf-8")
ROWS = re.findall(r"^\| `([\w.]+)` \| `([\w.]+)` \|$", TEXT, re.MULTILINE)
NAMES = re.findall(r"^\| `([\w.]+)` \| `([\w.]+)` \| `([\w.]+)` \|$", TEXT, re.MULTILINE)
FIRST_WORDS = (
    "analysis", "cli", "devices", "experiments", "lab", "protocol", "recording", "stage", "stimuli",
)  # fmt: skip
OLD = """\
from lab.clock import SimClock
from protocol.design import Factor as Planned
from protocol.session_setup import open_session
import devices.contracts
from visavis.measures import Measure
from visavis.observer.state import State
from visavis import Study, analysis
    from analysis import gait
from laboratory import rooms
from mine.lab import keep
# from protocol.plan one may read
"""


def block(language: str) -> str:
    """Return the one block of the page in a language."""
    (found,) = re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
    return str(found)


@pytest.mark.parametrize("now", sorted({now for _, now in ROWS}))
def test_every_new_name_can_be_imported(now: str) -> None:
    assert now == importlib.import_module(now).__name__


def has_name(module: str, name: str) -> bool:
    """Return whether a module has a name, or its class a field or a method of that name."""
    owner, _, member = name.rpartition(".")
    target = importlib.import_module(module)
    if not owner:
        return hasattr(target, member)
    kind = getattr(target, owner)
    return hasattr(kind, member) or member in kind.__annotations__


@pytest.mark.parametrize(("module", "before", "now"), NAMES)
def test_every_name_that_changed_has_its_new_name_alone(module: str, before: str, now: str) -> None:
    assert has_name(module, now)
    assert not has_name(module, before)


def new_name(old: str) -> str:
    """Return where the page sends an old name: by its own row, or by that of a package above it."""
    rows, parts = dict(ROWS), old.split(".")
    for k in range(len(parts), 0, -1):
        if ".".join(parts[:k]) in rows:
            return ".".join([rows[".".join(parts[:k])], *parts[k:]])
    return old


def test_every_module_of_the_last_version_has_a_new_name_or_is_said_to_be_gone() -> None:
    gone = re.findall(r"`([\w.]+)`", TEXT.split("## What is gone")[1].split("\n## ")[0])
    modules = (Path(__file__).parent / "modules_of_0_2_0.txt").read_text("utf-8").split()
    lost = [
        old
        for old in modules
        if not old.startswith(tuple(gone)) and importlib.util.find_spec(new_name(old)) is None
    ]
    assert [] == lost


def test_every_old_name_stands_once_and_none_of_them_is_where_it_was() -> None:
    old = [before for before, _ in ROWS]
    assert sorted(set(old)) == sorted(old)
    assert {before for before, now in ROWS if now == f"visavis.{before}"} == {*FIRST_WORDS}
    assert [] == [before for before, now in ROWS if before == now]


def test_the_script_rewrites_imports_and_nothing_else(tmp_path: Path) -> None:
    script = tmp_path / "rewrite.py"
    script.write_text(block("python"), "utf-8")
    study = tmp_path / "mine" / "study.py"
    study.parent.mkdir()
    study.write_text(OLD, "utf-8")
    subprocess.run([sys.executable, str(script), str(PAGE), str(study.parent)], check=True)

    assert """\
from visavis.lab.clock import SimClock
from visavis.protocol.plan.design import Factor as Planned
from visavis.protocol.session.session_setup import open_session
import visavis.devices.contracts
from visavis.study.measures import Measure
from visavis.people.observer.state import State
from visavis import Study, analysis
    from visavis.analysis import gait
from laboratory import rooms
from mine.lab import keep
# from protocol.plan one may read
""" == study.read_text("utf-8")


@pytest.mark.skipif(sys.platform != "linux", reason="the line is for GNU sed")
def test_the_line_of_sed_gives_the_first_word_and_nothing_else(tmp_path: Path) -> None:
    shell = shutil.which("sh")
    assert shell
    study = tmp_path / "study.py"
    study.write_text(OLD, "utf-8")
    subprocess.run([shell, "-c", block("sh")], cwd=tmp_path, check=True)

    lines = study.read_text("utf-8").splitlines()
    assert "from visavis.lab.clock import SimClock" == lines[0]
    assert "    from visavis.analysis import gait" == lines[7]
    changed = [i for i, (a, b) in enumerate(zip(lines, OLD.splitlines(), strict=True)) if a != b]
    assert [0, 1, 2, 3, 7] == changed
