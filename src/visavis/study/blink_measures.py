"""Measure blinks of a trial in the pupil signal: how many, and how many a minute.

Blinks are those of `visavis.analysis.gaze.pupil_blinks`, found in the whole part of a session, so
that one at the edge of a trial has both its edges.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.pupil import pupil_mm_of
from visavis.analysis.gaze.pupil_blinks import PupilBlinks, pupil_blinks
from visavis.analysis.gaze.stamps import Times, order_of, typical_step_ns
from visavis.analysis.gaze.targets import gaze_delay_ns
from visavis.lab.clock import NS_PER_S
from visavis.lab.kinds import takes_kinds
from visavis.protocol.plan.steps import Scalar
from visavis.recording.reader import Recording
from visavis.study.measures import Measure, Of, SamplesUnreadable, TrialRecord

GAZE: Final = "gaze"
MIN_SEEN_01: Final = 0.5
"""Of a window of which less was seen, a count would be one of the rest alone."""
NS_PER_MIN: Final = 60 * NS_PER_S


@takes_kinds()
def blink_count(scene: str = "", *, column: str = "blink_count") -> Measure:
    """Return how many blinks began in a trial, or while a scene of it was shown.

    Missing without a pupil, and where less than half of the time shows the pupil or a blink.
    """
    of = _of(scene, lambda blinks, seen_ns: blinks)
    return Measure(column, "1", f"Blinks{_when(scene)}", of)


@takes_kinds()
def blink_rate(scene: str = "", *, column: str = "blinks_per_min") -> Measure:
    """Return blinks per minute of a trial, or of a scene of it; time without an eye left out.

    Missing as `blink_count` is.
    """
    of = _of(scene, lambda blinks, seen_ns: blinks / (seen_ns / NS_PER_MIN))
    return Measure(column, "1/min", f"Blinks per minute{_when(scene)}", of)


def _when(scene: str) -> str:
    return f" while {scene.replace('_', ' ')} was shown" if scene else ""


def _of(scene: str, value: Any) -> Of:
    def of(record: TrialRecord) -> Scalar | None:
        window = record.window(scene) if scene else _whole(record)
        recording = record.recording
        if window is None or recording is None:
            return None
        if GAZE not in recording.stream_names:
            return None
        if GAZE in record.damaged_streams:
            raise SamplesUnreadable(f"{record.name}: samples of {GAZE} cannot be read")
        signal = _signal(recording, int(record.row["recording_part"]))
        if signal is None:
            return None
        from_ns, to_ns = window
        seen_ns = signal.seen_ns(from_ns, to_ns)
        if to_ns <= from_ns or seen_ns < MIN_SEEN_01 * (to_ns - from_ns):
            return None
        onset_ns = signal.blinks.onset_ns
        blinks: Scalar = value(int(((onset_ns >= from_ns) & (onset_ns < to_ns)).sum()), seen_ns)
        return blinks

    return of


def _whole(record: TrialRecord) -> tuple[int, int] | None:
    start, end = record.number("t_start_ns"), record.number("t_end_ns")
    return None if start is None or end is None else (int(start), int(end))


@dataclass(frozen=True, eq=False)
class _Signal:
    """The pupil of a part: stamps (n,), whether it was seen, the period, and its blinks."""

    t_ns: Times
    is_seen: npt.NDArray[np.bool_]
    step_ns: int
    blinks: PupilBlinks

    def seen_ns(self, from_ns: int, to_ns: int) -> float:
        """Return for how long a window shows the pupil, or a blink."""
        inside = (self.t_ns >= from_ns) & (self.t_ns < to_ns)
        at = self.t_ns[inside & self.is_seen]
        begin, end = self.blinks.onset_ns, self.blinks.offset_ns
        hidden = np.minimum(end, to_ns) - np.maximum(begin, from_ns)
        within = np.searchsorted(at, end) - np.searchsorted(at, begin)
        blinks_ns = np.maximum(hidden, 0).sum() - self.step_ns * within.sum()
        return float(len(at) * self.step_ns + max(0, blinks_ns))


@lru_cache(maxsize=2)
def _signal(recording: Recording, part: int) -> _Signal | None:
    """Return the pupil of a session's part; None where the tracker measures none."""
    gaze = recording.stream_arrays(GAZE, part=part)
    pupil_mm = pupil_mm_of(gaze)
    if pupil_mm is None:
        return None
    order = order_of(
        gaze["t_host_ns"], gaze["direction_head"], backward="sort", conflicts="keep_first"
    )
    rows = np.arange(len(pupil_mm)) if order.rows is None else order.rows
    t_ns = gaze["t_host_ns"][rows] - gaze_delay_ns(recording)
    size = pupil_mm[rows]
    return _Signal(t_ns, np.isfinite(size), typical_step_ns(t_ns), pupil_blinks(t_ns, size))
