"""Gaze samples with where each fell in the scene, as the session records them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import LOST, aoi_of_samples
from visavis.analysis.gaze.loss import frozen_samples
from visavis.lab.errors import DataError
from visavis.recording.reader import Recording


@dataclass(frozen=True)
class GazeTargets:
    """Samples of the `gaze_targets` stream: n samples, m agents, in order of arrival.

    `t_ns` (n,) when each was taken; `valid` (n,); `direction_world` (n, 3), NaN where lost;
    `angle_deg`, `radius_deg`, `pad_limit_deg` (n, m) and `hit` (n,) as in `GazeView`;
    `direction_head` (n, 3) the eye in the head, None where it is not known.
    """

    t_ns: npt.NDArray[np.int64]
    valid: npt.NDArray[np.bool_]
    direction_world: npt.NDArray[np.floating[Any]]
    angle_deg: npt.NDArray[np.floating[Any]]
    radius_deg: npt.NDArray[np.floating[Any]]
    pad_limit_deg: npt.NDArray[np.floating[Any]]
    hit: npt.NDArray[np.integer[Any]]
    direction_head: npt.NDArray[np.floating[Any]] | None = None

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
        return cls(**by_field, direction_head=columns.get("direction_head"))

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


def targets_of_part(recording: Recording, part: int) -> tuple[GazeTargets, npt.NDArray[np.bool_]]:
    """Return a part's evaluated samples with frozen ones marked as lost, and which these are.

    A tracker that repeats one direction for 100 ms or more has lost the eyes (docs/gaze.md).
    """
    columns = dict(recording.stream_arrays("gaze_targets", part=part))
    gaze = recording.stream_arrays("gaze", part=part)
    is_repeat = frozen_samples(gaze["t_device_ns"], gaze["direction_head"])
    is_frozen: npt.NDArray[np.bool_] = np.zeros(len(columns["gaze_seq"]), dtype=np.bool_)
    if is_repeat.any():
        is_frozen = np.isin(columns["gaze_seq"], gaze["seq"][is_repeat])
        columns["valid"] = columns["valid"] & ~is_frozen
        columns["hit"] = np.where(is_frozen, LOST, columns["hit"]).astype(columns["hit"].dtype)
        columns["angle_deg"] = np.where(is_frozen[:, None], np.nan, columns["angle_deg"])
        columns["direction_world"] = np.where(
            is_frozen[:, None], np.nan, columns["direction_world"]
        )
    columns["direction_head"] = _in_head(gaze, columns["gaze_seq"])
    return GazeTargets.from_columns(columns), is_frozen


def _in_head(
    gaze: Mapping[str, npt.NDArray[Any]], gaze_numbers: npt.NDArray[np.integer[Any]]
) -> npt.NDArray[np.float32]:
    """Return (n, 3) the eye in the head at samples by number; NaN where lost or not recorded."""
    in_head = np.full((len(gaze_numbers), 3), np.nan, np.float32)
    if not len(gaze["seq"]):
        return in_head
    order = np.argsort(gaze["seq"], kind="stable")
    at = order[np.minimum(np.searchsorted(gaze["seq"], gaze_numbers, sorter=order), len(order) - 1)]
    is_match = (gaze["seq"][at] == gaze_numbers) & gaze["valid"][at]
    in_head[is_match] = gaze["direction_head"][at[is_match]]
    return in_head
