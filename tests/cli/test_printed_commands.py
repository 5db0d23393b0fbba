"""Every command that a text of ours names exists, with its options: texts that come are covered.

`test_typed_commands.py` types commands where messages print them; this reads all messages, pages
and words of the product, so that none can name a verb or option that is not there.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.test_commands_in_docs import problem_of
from tests.product_files import ROOT, product_files

NAMED = re.compile(r"(?<![\w./-])(?<!from )visavis ((?:[a-z][a-z-]*)(?: [^\n`;|]*)?)")
END = re.compile(
    r"[`;,()]|\. |: |\.$|:$| →| and | or | if | in its | where | that | to | for | is "
)
BLANK = "X"
NO_VERBS = ("is", "in", "does", "asks", "has", "command", "events", "triggers")
"""What follows the name where it is no command: "visavis events" is a stream."""


def texts_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield every text of a file, with its line; what is filled in stands as X."""
    text = path.read_text("utf-8")
    if "visavis " not in text.replace("from visavis ", ""):
        return
    if path.suffix != ".py":
        yield from enumerate(text.splitlines(), start=1)
        return
    tree = ast.parse(text)
    within = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = []
            for part in node.values:
                within.add(id(part))
                is_text = isinstance(part, ast.Constant)
                parts.append(str(part.value) if isinstance(part, ast.Constant) else BLANK)
                assert is_text or isinstance(part, ast.FormattedValue)
            yield node.lineno, "".join(parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in within:
                yield node.lineno, node.value


def commands_named(text: str) -> Iterator[list[str]]:
    for match in NAMED.finditer(text):
        words = END.split(match[1])[0].replace('"', " ").replace("'", " ").split()
        if words and words[0] not in NO_VERBS:
            yield words


FILES = [f for kind in ("py", "yaml", "js", "html") for f in product_files(f"*.{kind}")]


def test_commands_are_found_in_texts_with_what_is_filled_in() -> None:
    (words,) = commands_named("recover it: `visavis recover X` puts it back")
    assert ["recover", "X"] == words
    assert [["check", "X", "--sign"]] == list(commands_named("say so: visavis check X --sign"))


@pytest.mark.parametrize("rooms", ["cli", "running", "others"])
def test_every_command_that_a_text_names_is_there_with_its_options(rooms: str) -> None:
    wrong, n = [], 0
    for path in FILES:
        name = path.relative_to(ROOT).as_posix()
        room = next((r for r in ("cli", "running") if f"visavis/{r}/" in name), "others")
        if room != rooms:
            continue
        for line, text in texts_of(path):
            for words in commands_named(text):
                n += 1
                if problem := problem_of(words):
                    wrong.append(f"{name}:{line}: {problem} ({' '.join(words)[:60]})")
    assert n > 10
    assert [] == wrong
