"""What docs/stimuli.md shows is what the examples hold, and its commands work."""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import visavis
from tests.study.test_write_a_study_page import commands_of, typed_in
from visavis.public_names import HOMES
from visavis.running.new_study import READY
from visavis.stimuli.flat import KINDS

PAGE = Path(__file__).parents[2] / "docs" / "stimuli.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SIGNATURE = re.compile(r"^\| `(\w+)\((.*)\)` \|", re.MULTILINE)
BY_HAND = "run "
"""A command that waits for somebody at a page; `tests/running/page` performs it."""


def blocks(kind: str) -> Iterator[str]:
    """Return the blocks of a kind on the page."""
    return (text for k, text in BLOCK.findall(PAGE.read_text("utf-8")) if k == kind)


@pytest.mark.parametrize("block", list(blocks("python")))
def test_code_on_the_page_stands_in_an_example_or_runs_by_itself(block: str) -> None:
    lines = [line for line in block.splitlines() if line.strip() not in ("", "…")]
    for example in sorted(READY.glob("*.py.txt")):
        rest = iter(example.read_text("utf-8").splitlines())
        if all(line in rest for line in lines):  # in this order
            return
    exec(block, {"np": np, **{name: getattr(visavis, name) for name in HOMES}})  # noqa: S102  # ours


def test_stimuli_are_called_as_the_page_says() -> None:
    shown = dict(SIGNATURE.findall(PAGE.read_text("utf-8")))
    assert set(KINDS) <= set(shown)
    for name, arguments in shown.items():
        parameters = inspect.signature(getattr(visavis, name)).parameters
        named = re.findall(r"(\w+)=", arguments)
        assert set(named) <= set(parameters), name
        for argument, value in re.findall(r'(\w+)=("\w+"|\d+|\(0, 0\))(?=,|$)', arguments):
            assert ast.literal_eval(value) == parameters[argument].default, (name, argument)


@pytest.mark.timeout(600)
def test_commands_on_the_page_work_in_their_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    commands = [c for text in blocks("console") for c, _ in commands_of(text)]
    assert 5 == len(commands)
    for command in commands:
        if not command.startswith(BY_HAND):
            typed_in(command)
