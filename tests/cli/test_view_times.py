"""Where parts of a session lie on a page's line of seconds."""

from types import SimpleNamespace
from typing import Any, cast

from visavis.cli.viewer.content import GAP_S, times_of
from visavis.recording.cached import CachedRecording

HOUR_NS = 3_600_000_000_000
SECOND_NS = 1_000_000_000


def test_a_page_begins_with_the_session_however_long_the_computer_has_run() -> None:
    """A real clock counts from the computer's start, in every part anew."""
    begun_ns = (5 * HOUR_NS, 0)
    parts = [SimpleNamespace(number=k + 1, started_ns=t_ns) for k, t_ns in enumerate(begun_ns)]
    recorded: Any = SimpleNamespace(
        manifest=SimpleNamespace(parts=parts),
        journal=lambda number: SimpleNamespace(
            events=[{"t_ns": parts[number - 1].started_ns + 20 * SECOND_NS}]
        ),
        stream_names=(),
    )
    times = times_of(cast(CachedRecording, recorded))
    assert (0.0, 3.0) == (times.s(1, 5 * HOUR_NS), times.s(1, 5 * HOUR_NS + 3 * SECOND_NS))
    assert 20.0 + GAP_S + 1.0 == times.s(2, SECOND_NS)
