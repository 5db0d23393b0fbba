"""Every command that the documentation shows exists, with the options it is shown with."""

import re
from pathlib import Path

import pytest

from cli.command_table import COMMANDS, load_command

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]
CODE = re.compile(r"```.*?```|`[^`\n]+`", re.DOTALL)
COMMAND = re.compile(r"(?:^|[\s`/])visavis ((?:[a-z][a-z-]*\b ?)+)([^\n|;&#`]*)")


def shown() -> list[tuple[str, str, str]]:
    """Return (page, words after visavis, the rest of the line) of every command in code."""
    return [
        (str(page.relative_to(REPOSITORY)), found[1], found[2])
        for page in PAGES
        for code in CODE.findall(page.read_text("utf-8"))
        for found in COMMAND.finditer(code.replace("\\\n", " "))
    ]


def test_commands_are_found_at_all() -> None:
    assert 100 < len(shown())


@pytest.mark.parametrize("page", [str(page.relative_to(REPOSITORY)) for page in PAGES])
def test_every_command_of_a_page_exists(page: str) -> None:
    wrong = []
    for name, words, rest in shown():
        if name != page:
            continue
        verb, *inner = words.split()
        if verb not in COMMANDS:
            wrong.append(f"visavis {verb}")
            continue
        command = load_command(verb)
        if inner and inner[0] in getattr(command, "commands", {}):
            command = command.commands[inner[0]]
        known = {text for p in command.params for text in (*p.opts, *p.secondary_opts)}
        wrong += [
            f"visavis {words}{option}"
            for option in re.findall(r"(?<!\S)--[a-z][a-z-]*", rest)
            if option not in known | {"--help"}
        ]
    assert [] == wrong
