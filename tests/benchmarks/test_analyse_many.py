"""People who stand in for more of them: the same recordings, whole, under labels of their own."""

from pathlib import Path

import pytest

from benchmarks.analyse_many import repeat, time_over_linear
from tests.recording.sessions import record_session
from visavis.recording.integrity import damage_of
from visavis.recording.reader import Recording


def test_people_that_are_added_have_whole_recordings_and_labels_of_their_own(
    tmp_path: Path,
) -> None:
    session = record_session(tmp_path, 2, participant="S01B")
    study = session.parents[1]
    repeat(study, 3)
    people = sorted(study.glob("sub-*"))
    assert ["sub-S01B", "sub-S02C", "sub-S03D"] == [p.name for p in people]
    for person in people:
        recording = Recording(person / "ses-001")
        assert () == damage_of(recording).problems
        assert person.name == f"sub-{recording.manifest.participant}"
    assert 2 == len(Recording(people[2] / "ses-001").trials())


def test_time_is_held_to_the_line_of_the_first_two_sizes() -> None:
    sizes = (25, 50, 100)
    assert 1.0 == pytest.approx(time_over_linear(sizes, [10 + 0.4 * n for n in sizes]))
    assert 1.5 == pytest.approx(time_over_linear(sizes, [20, 30, 75]))
    assert time_over_linear(sizes, [10 + 0.01 * n**2 for n in sizes]) > 1.1
