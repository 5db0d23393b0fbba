"""Which rows of a recording tell of a frame: its own, and the first of a later one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.protocol.plan.shown_scene import Frames


@given(st.lists(st.integers(0, 12), max_size=30), st.integers(-1, 13))
def test_a_frame_is_found_as_by_reading_every_row(numbers: list[int], frame: int) -> None:
    column = np.array(numbers, np.int64)
    here, later = np.flatnonzero(column == frame), np.flatnonzero(column > frame)
    expected = tuple(int(rows[0]) if len(rows) else None for rows in (here, later))
    assert expected == Frames.of({"frame_index": column}).rows(frame)


@pytest.mark.parametrize("frame", [0, 7])
def test_a_recording_without_frames_has_none(frame: int) -> None:
    assert (None, None) == Frames.of({"frame_index": np.zeros(0, np.int64)}).rows(frame)
