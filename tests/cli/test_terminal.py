"""What strangers and files say is shown on the operator's terminal, and never obeyed by it."""

import pytest
from rich.table import Table

from visavis.cli.app import console, errors, say, say_plainly, verbatim

HOSTILE = {
    "\x1b]52;c;cm0gLXJmIH4=\x07": r"\x1b]52;c;cm0gLXJmIH4=\x07",
    "a\x1b[2Jb": r"a\x1b[2Jb",
    "\x9b31m": r"\x9b31m",
    "abc\u202etxt.exe": r"abc\u202etxt.exe",
    "back\x08space\r": r"back\x08space\r",
    "sub-\udcff": r"sub-\udcff",
}


@pytest.mark.parametrize(("text", "shown"), HOSTILE.items(), ids=list(HOSTILE.values()))
def test_control_characters_are_shown_and_not_sent(
    text: str, shown: str, capsys: pytest.CaptureFixture[str]
) -> None:
    table = Table("name")
    table.add_row(verbatim(text))
    say(f"{verbatim(text)} came")
    say_plainly(text)
    console.print(table)
    errors.print(f"[yellow]{verbatim(text)}[/]")
    captured = capsys.readouterr()
    assert 3 == captured.out.count(shown)
    assert 1 == captured.err.count(shown)
    assert text not in captured.out + captured.err


def test_lines_and_tabs_stay(capsys: pytest.CaptureFixture[str]) -> None:
    say_plainly("one\n\ttwo")
    assert ["one", "two"] == capsys.readouterr().out.split()
