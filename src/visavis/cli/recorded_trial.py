"""One recorded trial: its streams, and what was shown and measured at any time of it."""

import bisect
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import UsageError
from visavis.lab.geometry import Pose, Vector
from visavis.protocol.plan.shown_scene import RecordedScene, of_part, recorded_scene
from visavis.recording.reader import Recording


@dataclass(frozen=True, eq=False)
class RecordedTrial:
    """The streams of one trial's part, and when it was."""

    recording: Recording
    part: int
    row: dict[str, Any]
    frames: dict[str, Any]
    head: dict[str, Any]
    gaze: dict[str, Any] | None

    @property
    def span_ns(self) -> tuple[int, int]:
        """When the trial began and ended, in session time of its part."""
        return int(self.row["t_start_ns"]), int(self.row["t_end_ns"])

    def span_of(self, name: str) -> tuple[int, int] | None:
        """Return when what columns of a name tell of was shown, as `span_ns`; None if it was not;
        the whole trial without a name.
        """
        if not name:
            return self.span_ns
        ends = [self.row.get(f"{name}_{end}_ns") for end in ("on", "off")]
        begin, end = (None if v is None or v != v else int(v) for v in ends)
        return None if begin is None or end is None else (begin, end)

    @cached_property
    def _valid_heads(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Rows of valid poses, and when they arrived."""
        rows = np.flatnonzero(self.head["valid"])
        return rows, self.head["t_host_ns"][rows]

    def head_at(self, t_ns: int) -> Pose:
        """Return the last valid head pose up to a time."""
        rows, arrival_ns = self._valid_heads
        count = int(np.searchsorted(arrival_ns, t_ns, side="right"))
        i = int(rows[count - 1]) if count else 0
        return Pose(
            self.head["position_m"][i].astype(np.float64),
            self.head["orientation_wxyz"][i].astype(np.float64),
        )

    def gaze_at(self, t_ns: int) -> tuple[Vector, Vector] | None:
        """Return the origin and direction of gaze in world then; None where it was lost."""
        if self.gaze is None or not len(self.gaze["t_sample_ns"]):
            return None
        i = max(0, bisect.bisect_right(self.gaze["t_sample_ns"], t_ns) - 1)
        if not self.gaze["valid"][i]:
            return None
        origin, direction = (
            self.gaze[name][i].astype(np.float64) for name in ("origin_world_m", "direction_world")
        )
        return origin, direction / np.linalg.norm(direction)

    def shown_at(self, t_ns: int) -> RecordedScene:
        """Return what was shown at a time."""
        at = max(0, bisect.bisect_right(self.frames["t_host_ns"], t_ns) - 1)
        head = self.head_at(t_ns)
        return recorded_scene(
            self.recording, self.part, int(self.frames["frame_index"][at]), t_ns, head.position_m
        )


def recorded_trial(recording: Recording, trial_id: str) -> RecordedTrial:
    """Return the last attempt at a trial.

    Raises:
        UsageError: the session has no such trial.
    """
    row = trial_row(recording, trial_id)
    part = int(row["recording_part"])
    names = recording.stream_names
    return RecordedTrial(
        recording,
        part,
        row,
        of_part(recording, "frames", part),
        of_part(recording, "head", part),
        _in_order(of_part(recording, "gaze_targets", part)) if "gaze_targets" in names else None,
    )


def _in_order(gaze: dict[str, Any]) -> dict[str, Any]:
    """Return gaze whose samples are no later than they arrived, despite slips of a clock."""
    return {**gaze, "t_sample_ns": np.minimum(gaze["t_sample_ns"], gaze["t_host_ns"])}


def trial_row(recording: Recording, trial_id: str) -> dict[str, Any]:
    """Return the row of the last attempt at a trial; raises as `recorded_trial`."""
    rows = recording.trials()
    mine = rows[rows["trial_id"] == trial_id] if "trial_id" in rows else rows[:0]
    if not len(mine):
        trial_ids = ", ".join(dict.fromkeys(map(str, rows.get("trial_id", ()))))
        raise UsageError(f"{recording.path} has no trial {trial_id}; it has {trial_ids or 'none'}")
    return {str(k): v for k, v in mine.iloc[-1].to_dict().items()}


def factors_of(recording: Recording, trial_id: str) -> tuple[str, ...]:
    """Return the names of a trial's factors, as planned."""
    for block in recording.manifest.plan.get("blocks", ()):
        for trial in block["trials"]:
            if trial["trial_id"] == trial_id:
                return tuple(trial["factors"])
    return ()
