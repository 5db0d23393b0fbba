"""The latest event up to a frame is found in arrays made once, and is the one a filter finds."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.protocol.plan.shown_scene import RecordedScene
from visavis.recording.cached import CachedRecording


@dataclass
class Log:
    """Events of one name, and how often they were read."""

    t_ns: list[int]
    times_read: int = field(default=0)

    def events_named(self, recording: CachedRecording, name: str, part: int) -> pd.DataFrame:
        self.times_read += 1
        return pd.DataFrame(
            {"t_ns": self.t_ns, "payload": [{"row": row} for row in range(len(self.t_ns))]}
        )


def latest(recording: CachedRecording, t_ns: int) -> tuple[int, dict[str, Any]] | None:
    zero = np.zeros(3)
    return RecordedScene(recording, 1, t_ns, t_ns, zero, 0, {}, zero, zero).latest("board_on")


@pytest.mark.parametrize("t_ns", [[10, 20, 30], [10, 30, 20, 20], [30, 10], []])
def test_the_latest_event_is_the_last_written_of_those_that_lie_before_and_is_read_once(
    t_ns: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Log(t_ns)
    monkeypatch.setattr(CachedRecording, "__init__", lambda self: setattr(self, "_products", {}))
    monkeypatch.setattr(CachedRecording, "events_named", lambda *words: log.events_named(*words))
    recording = CachedRecording()  # type: ignore[call-arg]
    for now_ns in range(5, 40, 5):
        rows = [row for row, then_ns in enumerate(t_ns) if then_ns <= now_ns]
        wanted = (t_ns[rows[-1]], {"row": rows[-1]}) if rows else None
        assert wanted == latest(recording, now_ns)
    assert 1 == log.times_read
