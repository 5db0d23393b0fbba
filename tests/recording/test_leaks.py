"""No mark that was planted in a session comes out of an export that may not tell it."""

from pathlib import Path

import pytest

from benchmarks.leaks import Case, cases, measure

WAYS = ("shipped", "file", "registered", "lost")


def case_known_by(way: str, root: Path) -> Case:
    return next(case for case in cases(root) if case.known_by == way)


@pytest.mark.parametrize("way", WAYS)
def test_nothing_private_leaves_in_any_tier_and_format(way: str, tmp_path: Path) -> None:
    outcome = measure(case_known_by(way, tmp_path), tmp_path / "out")
    assert [] == outcome.leaks
    assert outcome.marks > 500
    assert outcome.leave > 100


def test_the_same_search_finds_what_the_raw_tier_tells(tmp_path: Path) -> None:
    leaks = " ".join(measure(case_known_by("file", tmp_path), tmp_path / "out", ("raw",)).leaks)
    for place in (
        "bids: column who",
        "parquet: column undeclared",
        "xdf: answered who",
        "sheet: operator: text",
        "bids: age",
        "xdf: page_event: about",
    ):
        assert place in leaks
    for never in ("key file", "remark:", "label", "configuration", "part: reason", " day"):
        assert never not in leaks
