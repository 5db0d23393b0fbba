"""Gaze samples with where each fell in the scene, as the session records them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import LOST, aoi_of_samples
from visavis.analysis.gaze.loss import frozen_samples
from visavis.analysis.gaze.pupil import pupil_mm_of
from visavis.lab.clock import NS_PER_MS
from visavis.lab.device_clock import ClockJump
from visavis.lab.errors import DataError
from visavis.recording.reader import Recording
from visavis.recording.session_times import session_times

MISDATED_NS = 20 * NS_PER_MS
"""Gaze dated wrongly by more was turned by the head of another moment: at 50°/s, by a degree."""


@dataclass(frozen=True)
class GazeTargets:
    """Samples of the `gaze_targets` stream: n samples, m agents, in order of arrival.

    `t_ns` (n,) when each was taken; `valid` (n,); `direction_world` (n, 3), NaN where lost;
    `angle_deg`, `radius_deg`, `pad_limit_deg` (n, m) and `hit` (n,) as in `GazeView`;
    `direction_head` (n, 3) the eye in the head, `origin_world_m` (n, 3) where its ray starts, and
    `pupil_mm` (n,), each None where it is not known.
    """

    t_ns: npt.NDArray[np.int64]
    valid: npt.NDArray[np.bool_]
    direction_world: npt.NDArray[np.floating[Any]]
    angle_deg: npt.NDArray[np.floating[Any]]
    radius_deg: npt.NDArray[np.floating[Any]]
    pad_limit_deg: npt.NDArray[np.floating[Any]]
    hit: npt.NDArray[np.integer[Any]]
    direction_head: npt.NDArray[np.floating[Any]] | None = None
    origin_world_m: npt.NDArray[np.floating[Any]] | None = None
    pupil_mm: npt.NDArray[np.floating[Any]] | None = None

    @classmethod
    def from_columns(cls, columns: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Take the columns of the recorded stream; raises DataError naming a missing one."""
        names = {
            "t_ns": "t_sample_ns",
            "valid": "valid",
            "direction_world": "direction_world",
            "angle_deg": "angle_deg",
            "radius_deg": "radius_deg",
            "pad_limit_deg": "pad_limit_deg",
            "hit": "hit",
        }
        missing = [name for name in names.values() if name not in columns]
        if missing:
            raise DataError(
                f"the gaze_targets stream lacks {', '.join(missing)}; it was not recorded by a "
                "session with an eye tracker"
            )
        by_field = {own: columns[name] for own, name in names.items()}
        more: dict[str, Any] = {
            name: columns.get(name) for name in ("direction_head", "origin_world_m", "pupil_mm")
        }
        return cls(**by_field, **more)

    def between(self, start_ns: int, end_ns: int) -> Self:
        """Return the samples of a stretch of time and the one before it, as views."""
        inside = np.flatnonzero((self.t_ns >= start_ns) & (self.t_ns < end_ns))
        first, last = (int(inside[0]), int(inside[-1])) if inside.size else (0, -1)
        if inside.size and first > 0 and self.t_ns[first - 1] < start_ns:
            first -= 1
        return self.rows(slice(first, last + 1))

    def rows(self, selection: slice | npt.NDArray[Any]) -> Self:
        """Return some of the samples."""
        columns = [(f.name, getattr(self, f.name)) for f in fields(self)]
        cut: dict[str, Any] = {k: v if v is None else v[selection] for k, v in columns}
        return replace(self, **cut)

    def areas(self, pad_deg: float) -> npt.NDArray[np.int16]:
        """Return the head (n,) that each sample is on by the padded rule; see `aoi_of_samples`."""
        return aoi_of_samples(
            self.angle_deg, self.radius_deg, self.pad_limit_deg, self.hit, pad_deg=pad_deg
        )


def gaze_delay_ms(recording: Recording) -> float | None:
    """Return how late the eye tracker stamped its samples, as configured; None: not known."""
    for device in recording.manifest.devices:
        if device["role"] == "eye_tracker":
            delay_ms = device.get("gaze_delay_ms")
            return None if delay_ms is None else float(delay_ms)
    return None


def gaze_delay_ns(recording: Recording) -> int:
    """Return the delay that a session took off its gaze samples' times, in nanoseconds.

    The manifests of older recordings say it in the configuration alone.
    """
    options = recording.manifest.configuration["devices"].get("eye_tracker", {})
    infos = [i for i in recording.manifest.devices if i.get("role") == "eye_tracker"]
    delays = [i.get("gaze_delay_ms") for i in infos] or [options.get("gaze_delay_ms")]
    return round((delays[-1] or 0.0) * NS_PER_MS)


@dataclass(frozen=True)
class PartGaze:
    """The evaluated gaze samples of one part, as an analysis takes them.

    `targets` (n samples) are dated by all time exchanges of the part. `frozen` (n,) tells which
    repeat one direction too long. `misdated_ns` (n,) is by how much the session, which knew only
    earlier exchanges, dated a sample otherwise; `jumps` are those of the tracker's clock.
    """

    targets: GazeTargets
    frozen: npt.NDArray[np.bool_]
    misdated_ns: npt.NDArray[np.int64]
    jumps: tuple[ClockJump, ...] = ()

    def clock_jump_ms(self, start_ns: int, end_ns: int) -> float:
        """Return the largest jump of the tracker's clock that a stretch of time suffers from.

        It lies within, or samples there were still dated by the clock as it was before. 0: none.
        """
        jumps_ns = [abs(j.by_ns) for j in self.jumps if start_ns <= j.t_ns < end_ns]
        if self.jumps:
            t_ns = self.targets.t_ns
            late = np.abs(self.misdated_ns[(t_ns >= start_ns) & (t_ns < end_ns)])
            jumps_ns += late[late > MISDATED_NS].tolist()
        return max(jumps_ns, default=0) / NS_PER_MS


def gaze_of_part(recording: Recording, part: int) -> PartGaze:
    """Return a part's evaluated samples, dated anew, with useless ones marked as lost.

    A tracker that repeats one direction for 100 ms or more has lost the eyes (docs/gaze.md).
    After a jump of the tracker's clock the session took, until it was aligned again, the head and
    the scene of another moment: what was evaluated so is lost as well.
    """
    columns = dict(recording.stream_arrays("gaze_targets", part=part))
    gaze = recording.stream_arrays("gaze", part=part)
    numbers = columns["gaze_seq"]
    times = session_times(recording, "gaze", part)
    is_repeat = frozen_samples(times.t_ns, gaze["direction_head"])
    is_frozen = np.isin(numbers, gaze["seq"][is_repeat]) if is_repeat.any() else _none(numbers)
    rows, is_match = _rows_of(gaze["seq"], numbers)
    recorded_ns = columns["t_sample_ns"]
    if is_match.any():
        seen_ns = times.t_ns[rows] - gaze_delay_ns(recording)
        columns["t_sample_ns"] = np.where(is_match, seen_ns, recorded_ns)
    misdated_ns = recorded_ns - columns["t_sample_ns"]
    is_lost = is_frozen | (np.abs(misdated_ns) > MISDATED_NS) if times.jumps else is_frozen
    if is_lost.any():
        columns["valid"] = columns["valid"] & ~is_lost
        columns["hit"] = np.where(is_lost, LOST, columns["hit"]).astype(columns["hit"].dtype)
        columns["angle_deg"] = np.where(is_lost[:, None], np.nan, columns["angle_deg"])
        columns["direction_world"] = np.where(is_lost[:, None], np.nan, columns["direction_world"])
    columns["direction_head"] = _in_head(gaze, rows, is_match)
    pupil_mm = pupil_mm_of(gaze)
    if pupil_mm is not None and len(pupil_mm):
        columns["pupil_mm"] = np.where(is_match, pupil_mm[rows], np.nan)
    return PartGaze(GazeTargets.from_columns(columns), is_frozen, misdated_ns, times.jumps)


def _none(numbers: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    return np.zeros(len(numbers), dtype=np.bool_)


def _rows_of(
    recorded: npt.NDArray[np.integer[Any]], numbers: npt.NDArray[np.integer[Any]]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Return the rows of the gaze stream (n,) that bear these numbers, and whether there is one."""
    if not len(recorded):
        return np.zeros(len(numbers), np.intp), _none(numbers)
    order = np.argsort(recorded, kind="stable")
    places = np.searchsorted(recorded, numbers, sorter=order)
    rows = order[np.minimum(places, len(order) - 1)]
    return rows, recorded[rows] == numbers


def _in_head(
    gaze: Mapping[str, npt.NDArray[Any]],
    rows: npt.NDArray[np.intp],
    is_match: npt.NDArray[np.bool_],
) -> npt.NDArray[np.float32]:
    """Return (n, 3) the eye in the head of samples; NaN where lost or not recorded."""
    in_head = np.full((len(rows), 3), np.nan, np.float32)
    if is_match.any():
        is_seen = is_match & gaze["valid"][rows]
        in_head[is_seen] = gaze["direction_head"][rows[is_seen]]
    return in_head
