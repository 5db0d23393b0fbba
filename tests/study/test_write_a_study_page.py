"""What docs/write-a-study.md tells a newcomer to type works, and says what stands there."""

import re
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from visavis.cli.main import app
from visavis.lab.errors import LabError
from visavis.results.opened_study import find_study
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer

PAGE = Path(__file__).parents[2] / "docs" / "write-a-study.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMANDS_ON_THE_PAGE = 17
PEOPLE = re.compile(r"--participants \d+")
FEWER = "--participants 2 --processes 1"
"""So many are simulated instead of those the page asks for, without processes of their own."""
FILE = re.compile(r"# ([\w/]+\.(?:py|yaml))(, at its end)?\n")


@pytest.mark.timeout(900)  # a whole page, on a busy machine
def test_everything_on_the_page_works_in_its_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    typed = 0
    for kind, text in BLOCK.findall(PAGE.read_text("utf-8")):
        if kind == "console":
            for command, expected in commands_of(text):
                typed += 1
                if "preview" in command and not can_draw():
                    continue
                said = typed_in(command)
                for line in expected:
                    pattern = ".*".join(map(re.escape, line.strip().split("…")))
                    assert re.search(pattern, said), f"{command}\n{line}\nis not in\n{said}"
                if command.startswith("init"):
                    at_low_rates(tmp_path / "lab_config.yaml")
        elif kind in ("python", "yaml"):
            write(tmp_path, text)
    assert COMMANDS_ON_THE_PAGE == typed
    shorter = find_study(str(tmp_path / "shorter_duel.py")).experiment({}).plan(0, 1)
    assert 4 == sum(not t.is_practice for t in shorter.trials)


def commands_of(text: str) -> Iterator[tuple[str, list[str]]]:
    for part in re.split(r"^\$ visavis ", text, flags=re.MULTILINE)[1:]:
        command, *expected = part.splitlines()
        yield command, expected


def typed_in(command: str) -> str:
    command = PEOPLE.sub(FEWER, command)
    if command.startswith("analyse"):
        command += " --processes 1"
    result = CliRunner().invoke(app, re.findall(r'[^\s"]+', command))
    if isinstance(result.exception, LabError):
        return f"error  {result.exception}"
    assert result.exit_code == 0, f"{command}\n{result.output}"
    return result.output


def write(folder: Path, text: str) -> None:
    found = FILE.match(text)
    assert found is not None, f"a block names no file:\n{text}"
    path = folder / found[1]
    path.parent.mkdir(exist_ok=True)
    before = path.read_text("utf-8") if found[2] else ""
    assert bool(before) == bool(found[2])
    path.write_text(before + text.removeprefix(found[0]), encoding="utf-8")
    if path.name.startswith("check_"):
        runpy.run_path(str(path))


def at_low_rates(path: Path) -> None:
    """Let the example laboratory sample seldom: sessions of a test need no more."""
    config = yaml.safe_load(path.read_text("utf-8"))
    config["devices"]["headset"]["display_rate_hz"] = 30
    config["devices"]["eye_tracker"]["rate_hz"] = 60
    path.write_text(yaml.safe_dump(config), encoding="utf-8")


def can_draw() -> bool:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError:
        return False
    return True
