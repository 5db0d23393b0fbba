"""Delay of pictures, subtracted from times of gaze and answers: opt-in, by `visavis sync-test`.

A trial's times are those at which its frames began. Their light leaves at the time that the display
predicted. It reaches the eye after the delay that the test measured in the room
(`picture_delay_ms`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DataError, UsageError
from visavis.lab.plain_files import parse_json, read_plain
from visavis.protocol.plan.columns import Column
from visavis.recording.reader import Recording

SETTING: Final = "picture_delay_ms"
MAX_DELAY_MS: Final = 500.0
LATE: Final = Column(
    "picture_late_ms",
    "ms",
    "from the beginning of a frame to its light at the eye, median of the trial's frames: as the "
    "display predicted, and the room's picture_delay_ms; taken off gaze and times to answer",
)
BY_PICTURE: Final = ("ray", "gaze", "keys")
"""Ways of answering that are timed from a picture; the operator's answers are not."""


def delay_of(settings: Mapping[str, Any]) -> float | None:
    """Return the room's delay (ms) that an analysis subtracts; None where it is not set.

    Raises:
        UsageError: it is no number between 0 and 500.
    """
    value = settings.get(SETTING)
    if value is None:
        return None
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not 0 <= value <= MAX_DELAY_MS:
        raise UsageError(f"{SETTING} is a number from 0 to {MAX_DELAY_MS:g}, not {value!r}")
    return float(value)


class LatePictures:
    """Delays of the pictures in a session's trials, as seen by the eye."""

    def __init__(self, recording: Recording, delay_ms: float) -> None:
        self._recording = recording
        self._delay_ns = delay_ms * NS_PER_MS

    def late_ns(self, row: Mapping[Any, Any]) -> int | None:
        """Return the delay (ns) of a trial's pictures, median over frames; None without frames."""
        start, end = row.get("t_start_ns"), row.get("t_end_ns")
        if start is None or end is None or start != start or end != end:
            return None
        frames = self._recording.stream_arrays("frames", part=int(row["recording_part"]))
        at = frames["t_host_ns"]
        is_shown = (at >= start) & (at <= end)
        if not is_shown.any():
            return None
        ahead = frames["predicted_display_ns"][is_shown] - at[is_shown]
        return round(float(np.median(ahead)) + self._delay_ns)


def answer_times_from_light(
    row: Mapping[Any, Any], answers: Iterable[str], late_ns: int
) -> dict[str, float]:
    """Return the times to answer (ms) of a trial, from the light of the question."""
    times_ms = {}
    for name in answers:
        ms = row.get(f"{name}_ms")
        if ms is None or ms != ms or row.get(f"{name}_by") not in BY_PICTURE:
            continue
        times_ms[f"{name}_ms"] = float(ms) - late_ns / NS_PER_MS
    return times_ms


@dataclass(frozen=True)
class SyncTest:
    """A saved synchronisation test: when it was made, and the delay of pictures."""

    name: str
    made_at: str
    is_simulated: bool
    picture_delay_ms: float


def read_sync_test(path: Path) -> SyncTest:
    """Read a test that `visavis sync-test` saved.

    Raises:
        DataError: it is no such file, or too few flashes were answered to name a delay.
    """
    try:
        content = parse_json(read_plain(path))
        made_at, is_simulated = str(content["made"]), bool(content["is_simulated"])
        offset_ms = {**content["offsets_ms"]}.get(SETTING)
        late_ms = None if offset_ms is None else max(0.0, float(offset_ms))
    except (OSError, ValueError, KeyError, TypeError, OverflowError) as problem:
        raise DataError(
            f"{path} is no test that visavis sync-test saved ({problem}); give one of "
            "DATA_ROOT/sync_tests"
        ) from problem
    if late_ms is None:
        raise DataError(
            f"{path} names no delay of pictures: too few flashes were answered; measure again with "
            "the photodiode in the corner of the display"
        )
    delay = delay_of({SETTING: late_ms})
    return SyncTest(path.name, made_at, is_simulated, delay or 0.0)


def required_for(test: SyncTest, kinds: Iterable[bool]) -> float:
    """Return the test's delay for sessions; `kinds` says of each whether it is simulated.

    Raises:
        DataError: a rehearsal's test for real sessions, or a room's for simulated ones.
    """
    if any(kind != test.is_simulated for kind in kinds):
        what, sessions = ("rehearsed", "real") if test.is_simulated else ("real", "simulated")
        raise DataError(
            f"{test.name} is a {what} test and these sessions are {sessions}: their pictures were "
            "not late by what it says"
        )
    return test.picture_delay_ms
