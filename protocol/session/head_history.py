"""The time model of a session: every pose of the head carries the time it describes.

Three times meet in a frame (docs/decisions/0022-one-time-for-head-gaze-and-picture.md):

- a gaze sample describes the eyes at its own time, `t_sample_ns`;
- a measured pose describes the head at a time that has passed, when the frame began;
- a foreseen pose describes the head when the frame's light will leave, 11 to 60 ms later.

The picture is drawn from the foreseen pose. Gaze is turned by the head of its own time:
interpolated between measured poses, or, where a sample is younger than the last of them or nothing
is measured, towards the foreseen ones. How far a sample lies beyond the last measured pose is
recorded with it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Pose, Vector
from visavis.lab.rings import put_round

POSES_KEPT = 32
"""Number of poses of each kind searched for a time: 0.3 s at 90 Hz."""
MAX_WAITING = 64
"""Number of frames whose gaze may be deferred; as many more poses are remembered."""
MEASURED, FORESEEN = 0, 1
NEVER_MEASURED = math.nan
"""What is beyond the last measured pose where there is none."""
_NS_PER_MS = 1e6
_CAPACITY = POSES_KEPT + MAX_WAITING


class HeadPoses(NamedTuple):
    """Two rings of poses, measured (row 0) and foreseen (row 1), each in order of arrival."""

    t_ns: npt.NDArray[np.int64]
    position_m: npt.NDArray[np.float64]
    orientation_wxyz: npt.NDArray[np.float64]


class HeadHistory:
    """The latest poses of the head, each with the session time that it describes."""

    def __init__(self) -> None:
        self.poses = HeadPoses(
            np.zeros((2, _CAPACITY), np.int64),
            np.zeros((2, _CAPACITY, 3)),
            np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (2, _CAPACITY, 1)),
        )
        self._rows = tuple(zip(*self.poses, strict=True))
        self._newest = [-1, -1]
        self._counts = [0, 0]

    def copy(self) -> "HeadHistory":
        """Return one with the same poses."""
        other = HeadHistory()
        for ring, own in zip(other.poses, self.poses, strict=True):
            ring[:] = own
        other._newest, other._counts = list(self._newest), list(self._counts)
        return other

    @property
    def extent(self) -> tuple[int, int, int, int]:
        """The newest measured pose, how many there are to search, and the same of foreseen ones.

        A frame that is evaluated later stores it, so that later poses are not used for it.
        """
        return self._extent(POSES_KEPT)

    def _extent(self, most: int) -> tuple[int, int, int, int]:
        a, b = self._counts
        return self._newest[0], min(a, most), self._newest[1], min(b, most)

    def add_measured(self, t_ns: int, pose: Pose) -> None:
        """Remember where the head was at a time."""
        self._add(MEASURED, t_ns, pose)

    def add_foreseen(self, t_ns: int, pose: Pose) -> None:
        """Remember where the head was foreseen to be at a time."""
        self._add(FORESEEN, t_ns, pose)

    def add_together(
        self, measured_ns: Sequence[int], foreseen_ns: Sequence[int], poses: npt.NDArray[np.float32]
    ) -> list[tuple[int, int, int, int]]:
        """Remember n measured and n foreseen poses (n, 2, 7): position, then orientation. Return
        the `extent` after each.
        """
        n = len(measured_ns)
        columns: list[list[int]] = []
        for kind, times_ns in ((MEASURED, measured_ns), (FORESEEN, foreseen_ns)):
            first, count = (self._newest[kind] + 1) % _CAPACITY, self._counts[kind]
            t_kept_ns, position_m, orientation_wxyz = self._rows[kind]
            put_round(t_kept_ns, first, np.array(times_ns))
            put_round(position_m, first, poses[:, kind, :3])
            put_round(orientation_wxyz, first, poses[:, kind, 3:])
            columns.append([i % _CAPACITY for i in range(first, first + n)])
            columns.append([min(i, POSES_KEPT) for i in range(count + 1, count + n + 1)])
            self._newest[kind], self._counts[kind] = columns[-2][-1], count + n
        a, b, c, d = columns
        return list(zip(a, b, c, d, strict=True))

    def at(self, t_ns: int) -> tuple[Pose, float] | None:
        """Return the head at a time, and how many ms that is beyond the last measured pose.

        All poses are searched, because a frame may be asked about when those after it have passed.
        None before the first pose; `NEVER_MEASURED` where poses are foreseen only.
        """
        if not any(self._counts):
            return None
        place, turn = np.empty(3), np.empty(4)
        ahead_ms = head_at(self.poses, self._extent(_CAPACITY), t_ns, place, turn)
        return Pose(place, turn), ahead_ms

    def _add(self, kind: int, t_ns: int, pose: Pose) -> None:
        i = self._newest[kind] = (self._newest[kind] + 1) % _CAPACITY
        t_kept_ns, position_m, orientation_wxyz = self._rows[kind]
        t_kept_ns[i] = t_ns
        position_m[i] = pose.position_m
        orientation_wxyz[i] = pose.orientation_wxyz
        self._counts[kind] += 1


def heads_between(
    t_ns: Sequence[int], heads: Sequence[Pose], at_ns: npt.NDArray[np.int64]
) -> tuple[Vector, Vector]:
    """Return places (n, 3) and orientations (n, 4) of the head between poses, at the times (n,).

    Before the first and after the last of the poses, which are in order of time, that one is taken.
    """
    if not heads or not len(at_ns):
        return np.empty((0, 3)), np.empty((0, 4))
    times = np.asarray(t_ns, np.int64)
    b = np.clip(np.searchsorted(times, at_ns), 1, max(1, len(times) - 1)) % len(times)
    a = np.maximum(b - 1, 0)
    span_ns = np.maximum(times[b] - times[a], 1)
    share = np.clip((at_ns - times[a]) / span_ns, 0.0, 1.0)[:, None]
    places = np.array([head.position_m for head in heads])
    turns = np.array([head.orientation_wxyz for head in heads])
    sign = np.where((turns[a] * turns[b]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    between = (1 - share) * turns[a] + share * sign * turns[b]
    length = np.linalg.norm(between, axis=1, keepdims=True)
    return (1 - share) * places[a] + share * places[b], between / length


@compiled
def head_at(
    poses: HeadPoses,
    extent: tuple[int, int, int, int],
    t_ns: int,
    place: npt.NDArray[np.float64],
    turn: npt.NDArray[np.float64],
) -> float:
    """Write the head at a time into `place` (3,) and `turn` (4,).

    Return how many ms the time is beyond the last measured pose: 0 up to it, NaN without any. A
    time outside all poses takes the nearest.
    """
    capacity = poses.t_ns.shape[1]
    newest_measured, measured_count, newest_foreseen, foreseen_count = extent
    is_measured = measured_count > 0 and t_ns <= poses.t_ns[0, newest_measured]
    beyond_ms = 0.0
    foresees = foreseen_count > 0 and (
        measured_count == 0 or poses.t_ns[1, newest_foreseen] > poses.t_ns[0, newest_measured]
    )
    if is_measured or not foresees:
        ring, b, count = 0, newest_measured, measured_count
    else:
        ring, b, count = 1, newest_foreseen, foreseen_count
    if not is_measured:
        beyond_ms = np.nan
        if measured_count > 0:
            beyond_ms = (t_ns - poses.t_ns[0, newest_measured]) / _NS_PER_MS
    # Search back from the newest for the two poses around the time.
    steps = 1
    while steps < count and poses.t_ns[ring, (b - 1 + capacity) % capacity] > t_ns:
        b = (b - 1 + capacity) % capacity
        steps += 1
    ring_a, a = ring, b
    if steps < count:
        a = (b - 1 + capacity) % capacity
    # A pose foreseen for an earlier time than the last measured one says less than that does.
    if (
        ring == 1
        and measured_count > 0
        and poses.t_ns[1, b] > t_ns
        and (steps == count or poses.t_ns[1, a] < poses.t_ns[0, newest_measured])
    ):
        ring_a, a = 0, newest_measured
    f = 0.0
    span = poses.t_ns[ring, b] - poses.t_ns[ring_a, a]
    if span > 0:
        f = min(max((t_ns - poses.t_ns[ring_a, a]) / span, 0.0), 1.0)
    p, q = poses.position_m, poses.orientation_wxyz
    # Interpolate the quaternions linearly and normalise. q and -q are the same rotation, so the
    # sign is chosen that makes the way between them short.
    dot = 0.0
    for k in range(4):
        dot += q[ring_a, a, k] * q[ring, b, k]
    sign = 1.0 if dot >= 0 else -1.0
    length = 0.0
    for k in range(4):
        turn[k] = (1 - f) * q[ring_a, a, k] + f * sign * q[ring, b, k]
        length += turn[k] * turn[k]
    length = np.sqrt(length)
    for k in range(4):
        turn[k] /= length
    for k in range(3):
        place[k] = (1 - f) * p[ring_a, a, k] + f * p[ring, b, k]
    return beyond_ms
