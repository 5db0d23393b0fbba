"""docs/scripts.md does what it says: every block is executed, and prints what stands below it."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.sessions import STUDIES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "scripts.md"
BLOCK = re.compile(r"```(python|r)\n(.*?)```\n\n```text\n(.*?)```", re.DOTALL)


def blocks(language: str) -> Iterator[tuple[str, str]]:
    """Yield each block of a language with what it prints."""
    for kind, code, printed in BLOCK.findall(PAGE.read_text("utf-8")):
        if kind == language:
            yield code, printed


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.mark.timeout(900)  # a whole page, on a busy machine
def test_page_runs_as_it_stands(tmp_path: Path) -> None:
    shutil.copy(STUDIES / "duel.py", tmp_path)
    shutil.copytree(STUDIES / "texts", tmp_path / "texts")
    code = "".join(f"{code}\nprint('=====')\n" for code, _ in blocks("python"))
    script = tmp_path / "page.py"
    script.write_text(code, encoding="utf-8")  # as its readers write it
    said = run([sys.executable, str(script)], tmp_path).split("=====\n")
    for (_, printed), mine in zip(blocks("python"), said, strict=False):
        assert printed == mine
    if shutil.which("Rscript") is None:
        return  # the tables are there; only R itself is missing
    for code, printed in blocks("r"):
        (tmp_path / "page.R").write_text(code, encoding="utf-8")
        assert printed.split() == run(["Rscript", "page.R"], tmp_path).split()
