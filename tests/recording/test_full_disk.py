"""A disk that runs full at any write leaves a session that is green once it was resumed."""

from pathlib import Path

import pytest

from benchmarks.full_disk import Outcome, measure

WRITES = {"headset": (1, 3, 4, 5, 6, 8, 9, 13, 20, 25, 40), "page": (1, 4, 5, 6, 7, 8, 44, 46)}
"""Writes at which manifest, journal, headers, samples and the list of sessions stand."""


@pytest.mark.parametrize("place", WRITES)
def test_a_full_disk_leaves_nothing_red(place: str, tmp_path: Path) -> None:
    found, wrong = measure(place, WRITES[place], 0, tmp_path)
    assert [] == wrong
    assert Outcome(sessions=len(WRITES[place])) == found
