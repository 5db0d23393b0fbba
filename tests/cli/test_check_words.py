"""What `check` prints can be read without colours."""

from pathlib import Path

import pytest

from visavis.analysis.session_verdict import Finding, Level, SessionCheck, StreamCheck
from visavis.cli.commands.checking import print_check


def test_what_is_wrong_stands_first_and_is_marked_by_more_than_a_colour(
    capsys: pytest.CaptureFixture[str],
) -> None:
    verdict = SessionCheck(
        Level.RED,
        is_simulated=False,
        participant="07H",
        findings=(
            Finding(Level.GREEN, "recording", "complete"),
            Finding(Level.AMBER, "head", "94 % of the expected samples"),
            Finding(Level.RED, "trials", "6 of 7 planned trials complete", "do T03 again"),
        ),
        trials=(),
        streams=(
            StreamCheck("head", 94, 100, 84.6, 111.0, Level.AMBER),
            StreamCheck("responses", 18, None, None, None, Level.GREEN),
        ),
    )
    print_check(verdict, Path("ses-001"))
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert "responses are presses" in printed

    marked = [line.split()[:2] for line in lines if line.strip()[:1] in ("✗", "!", "✓")]
    assert [["✗", "trials"], ["!", "head"], ["✓", "recording"], ["!", "head"]] == marked
    assert any(line.startswith("→ do T03 again") for line in lines)
