"""Every endpoint answers what a page understands, whatever is posted (`benchmarks.fuzz`)."""

from pathlib import Path

from benchmarks.fuzz.__main__ import fuzz, read_whole
from benchmarks.fuzz.endpoints import endpoints


def test_every_endpoint_answers_damaged_bodies(tmp_path: Path) -> None:
    with endpoints(tmp_path) as targets:
        for target in targets:
            read_whole(target)
            outcome = fuzz(target, 60, float("inf"), 7)
            assert (0, 0, {}) == (outcome.wrong, outcome.hangs, outcome.where), target.name
        assert len(targets) == 6
