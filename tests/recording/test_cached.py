"""A recording that is kept says what one that is read again and again says."""

from pathlib import Path

import numpy as np

from tests.sessions import perform
from visavis.recording.cached import CachedRecording


def test_a_kept_recording_says_what_the_recording_says_and_reads_each_file_once(
    tmp_path: Path,
) -> None:
    plain = perform("duel", tmp_path, repetitions=1, practice=0)
    kept = CachedRecording(plain.path)
    middle = int(plain.stream_arrays("head")["t_host_ns"][500])
    for span in ({}, {"part": 1}, {"part": 1, "t_end_ns": middle}, {"t_start_ns": middle}):
        wanted, rows = plain.stream_arrays("head", **span), kept.stream_arrays("head", **span)
        assert wanted.keys() == rows.keys()
        assert all(np.array_equal(wanted[name], rows[name]) for name in wanted)
    assert kept.stream_arrays("head", part=1) is kept.stream_arrays("head", part=1)
    assert plain.events().equals(kept.events())
    assert plain.events_named("answered", 1).equals(kept.events_named("answered", 1))
    assert plain.trials().equals(kept.trials())
    lists: list[list[int]] = [kept.once("a", list) for _ in range(2)]
    assert lists[0] is lists[1]
