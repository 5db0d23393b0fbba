"""Where parts of a session lie on a page's line of seconds."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from visavis.cli.viewer.content import GAP_S, times_of
from visavis.recording.cached import CachedRecording

HOUR_NS = 3_600_000_000_000
SECOND_NS = 1_000_000_000


def recording_of(begun_ns: tuple[int, ...], first_row_ns: tuple[int, ...] = ()) -> CachedRecording:
    """Return a session whose parts last 20 s; streams begin in each at `first_row_ns`, if any."""
    parts = [SimpleNamespace(number=k + 1, started_ns=t_ns) for k, t_ns in enumerate(begun_ns)]
    recorded: Any = SimpleNamespace(
        manifest=SimpleNamespace(parts=parts),
        journal=lambda number: SimpleNamespace(
            events=[{"t_ns": parts[number - 1].started_ns + 20 * SECOND_NS}]
        ),
        stream_names=("head",) if first_row_ns else (),
        stream_arrays=lambda name, part: {"t_host_ns": np.array([first_row_ns[part - 1]])},
    )
    return cast(CachedRecording, recorded)


def test_a_page_begins_with_the_session_however_long_the_computer_has_run() -> None:
    """A real clock counts from the computer's start, in every part anew."""
    times = times_of(recording_of((5 * HOUR_NS, 0)))
    assert (0.0, 3.0) == (times.s(1, 5 * HOUR_NS), times.s(1, 5 * HOUR_NS + 3 * SECOND_NS))
    assert 20.0 + GAP_S + 1.0 == times.s(2, SECOND_NS)


def test_what_waited_on_a_page_before_a_part_began_lies_behind_the_part_before() -> None:
    """Rows are measured while the server begins anew: no second holds those of two parts."""
    times = times_of(recording_of((HOUR_NS, HOUR_NS), (HOUR_NS, HOUR_NS - 5 * SECOND_NS)))
    assert 20.0 + GAP_S == times.s(2, HOUR_NS - 5 * SECOND_NS)
    assert 25.0 + GAP_S == times.s(2, HOUR_NS)
