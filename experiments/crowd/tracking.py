"""Watch the body tracker during a walk: what was silent, frozen, lost, or outside the room."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.devices.segment_watch import SegmentWatch
from visavis.lab.clock import NS_PER_MS
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.protocol.plan.steps import BodyView, Scalar
from visavis.stimuli.contact.body import ARM_JOINTS
from visavis.stimuli.scenes.station_crowd import ROOM_SIDE_M

_SAME: Final = 1
_PART_LOST: Final = 2
_OUTSIDE: Final = 4


@dataclass
class TrackingWatch:
    """Record of failures of the body's tracking in a walk; times of loss in ns.

    After `quiet_ns` without a sample, or with samples that repeat bit for bit, the tracker is not
    believed; a single segment that repeats while the others move on is ignored. `moved_segments`
    are those seen to move before; the watch adds to them at the end.
    """

    start_ns: int
    quiet_ns: int
    segments: tuple[str, ...]
    moved_segments: set[tuple[str, int]] = field(default_factory=set)
    samples: int = 0
    silent_ns: int = 0
    frozen_ns: int = 0
    part_lost_samples: int = 0
    outside_samples: int = 0
    last_ns: int = field(init=False)
    _still_since_ns: int = field(init=False)
    _place: Vector = field(default_factory=lambda: np.zeros(3))
    _arms: npt.NDArray[np.int64] = field(init=False)
    _hips: int = field(init=False)
    _parts: SegmentWatch = field(init=False)
    _has_frozen_part: bool = False

    def __post_init__(self) -> None:
        self.last_ns = self._still_since_ns = self.start_ns
        self._arms = np.array([self.segments.index(name) for name in ARM_JOINTS])
        self._hips = self.segments.index("hips")
        self._parts = SegmentWatch(
            self.segments, limit_ns=self.quiet_ns, moved_channels=self.moved_segments
        )

    def believes(self, body: BodyView, i: int, t_ns: int) -> bool:
        """Take note of sample i, at `t_ns`; tell whether it is of a moving, live body."""
        gap_ns = t_ns - self.last_ns
        self.last_ns = t_ns
        if gap_ns > self.quiet_ns:
            self.silent_ns += gap_ns
        self.samples += 1
        self._has_frozen_part = self._parts.look(
            body.position_m[i], body.orientation_wxyz[i], gap_ns
        )
        bits = _look(
            body.position_m[i], body.valid[i], self._arms, self._hips, ROOM_SIDE_M / 2, self._place
        )
        if not bits & _SAME:
            self._still_since_ns = t_ns
        elif t_ns - self._still_since_ns > self.quiet_ns:
            self.frozen_ns += gap_ns
            return False
        self.part_lost_samples += bool(bits & _PART_LOST)
        self.outside_samples += bool(bits & _OUTSIDE)
        return True

    def believed_m(self, body: BodyView, i: int) -> Vector:
        """Return the positions (s, 3) of sample i, the one looked at last; NaN where frozen."""
        position: Vector = body.position_m[i]
        if self._has_frozen_part:
            position = position.copy()
            position[self._parts.frozen] = np.nan
        return position

    def is_silent(self, t_ns: int) -> bool:
        """Tell whether the tracker has said nothing for too long."""
        return t_ns - self.last_ns > self.quiet_ns

    def end(self, t_ns: int) -> None:
        """Count the silence that lasted until the walk's end; remember what moved."""
        self.moved_segments |= self._parts.moved_channels
        if self.is_silent(t_ns):
            self.silent_ns += t_ns - self.last_ns

    def row(self) -> dict[str, Scalar | None]:
        """Return the columns of the trial's row."""
        return {
            "body_samples": self.samples,
            "body_silent_ms": self.silent_ns / NS_PER_MS,
            "body_frozen_ms": self.frozen_ns / NS_PER_MS,
            "frozen_segments": format_durations(self._parts.frozen_for_ns),
            "body_part_lost_samples": self.part_lost_samples,
            "outside_room_samples": self.outside_samples,
        }

    def flags(self) -> list[str]:
        """Name what an analyst must know."""
        marks = (
            ("body_silent", self.silent_ns),
            ("body_part_lost", self.part_lost_samples),
            ("body_frozen", self.frozen_ns),
            ("segment_frozen", len(self._parts.frozen_for_ns)),
            ("left_room", self.outside_samples),
        )
        return [name for name, amount in marks if amount]


def format_durations(duration_ns: Mapping[str, int]) -> str:
    """Return `segment=milliseconds` of every segment, separated by semicolons."""
    return ";".join(f"{name}={round(ns / NS_PER_MS)}" for name, ns in duration_ns.items())


def never_tracked() -> tuple[dict[str, Scalar | None], list[str]]:
    """Return columns and flags of a walk during which no sample came."""
    columns = dict.fromkeys(
        (
            "body_samples",
            "body_silent_ms",
            "body_frozen_ms",
            "frozen_segments",
            "body_part_lost_samples",
            "outside_room_samples",
        )
    )
    return {**columns, "body_samples": 0}, ["body_never_tracked"]


@compiled
def _look(
    position: Vector,
    valid: npt.NDArray[np.bool_],
    arms: npt.NDArray[np.int64],
    hips: int,
    half_m: float,
    place: Vector,
) -> int:
    """Return bits: the arms are exactly where they were, a segment is lost, out of the room.

    `place` (3,), the sum of the arms' joints that are tracked, is renewed where they moved. Arms
    that are lost altogether are lost, not still.
    """
    # "Same" unless the sum of the tracked arm joints changes along some axis.
    bits = 0
    for k in range(arms.shape[0]):
        if np.isfinite(position[arms[k], 0]):
            bits = _SAME
    for axis in range(3):
        total = 0.0
        for k in range(arms.shape[0]):
            if np.isfinite(position[arms[k], axis]):
                total += position[arms[k], axis]
        if total != place[axis]:
            bits = 0
            place[axis] = total
    for k in range(valid.shape[0]):
        if not valid[k]:
            bits |= _PART_LOST
    x, z = position[hips, 0], position[hips, 2]
    if np.isfinite(x) and np.isfinite(z) and max(abs(x), abs(z)) > half_m:
        bits |= _OUTSIDE
    return bits
