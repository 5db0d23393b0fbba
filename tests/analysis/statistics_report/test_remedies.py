"""Remedies in messages of statistics can be written as they stand, in Python and in a shell."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main
from typer import Context

from visavis import analysis
from visavis.analysis.statistics.errors import option_text
from visavis.cli.app import app

ROOM = Path(analysis.__file__).parent
SOURCES = [
    p for room in ("statistics", "statistics_report") for p in sorted((ROOM / room).glob("*.py"))
]


def options_of_stats() -> set[str]:
    """Return the options of `visavis stats`, without dashes."""
    group = typer.main.get_group(app)
    stats = group.get_command(Context(group), "stats")
    assert stats is not None
    return {text.removeprefix("--") for parameter in stats.params for text in parameter.opts}


def texts(source: Path) -> Iterator[tuple[int, str]]:
    """Yield line and text of every string of a file that is no docstring."""
    tree = ast.parse(source.read_text(encoding="utf-8"))
    docstrings = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in docstrings:
                yield node.lineno, node.value


def test_options_in_messages_are_named_for_python_and_the_command_line() -> None:
    """It was "use missing=listwise", which neither Python nor a shell takes."""
    assert "missing='listwise' (--missing listwise)" == option_text("missing", "listwise")
    assert "mu=0.5 (--mu 0.5)" == option_text("mu", 0.5)
    option = re.compile(rf"\b({'|'.join(sorted(options_of_stats()))})=\S")
    written = [
        f"{source.name}:{line}: {text}"
        for source in SOURCES
        for line, text in texts(source)
        if option.search(text)
    ]
    assert [] == written


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.stem)
def test_options_that_messages_name_are_options_of_the_command(source: Path) -> None:
    tree = ast.parse(source.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "option_text":
            name = node.args[0]
            assert isinstance(name, ast.Constant)
            assert name.value in options_of_stats()
