"""Foresee a body's head as runtimes do: it goes on as it moved last, for 11 to 60 ms.

Runtimes extrapolate from the speed of the head when they are asked. So does this, from the last
two measurements, with the error that comes of it: with an angular acceleration `a`, `a·T²/2` at a
look-ahead of `T`, and what the head turned between the measurements. Not modelled: filters, damping
of long look-aheads.
"""

import threading
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Body
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.lab.rings import put_round
from visavis.stimuli.motion.quaternion_kernels import times

SPEED_OVER_NS = 2 * NS_PER_MS
"""Speed is taken between measurements at least this far apart."""
STALE_NS = NS_PER_S // 5
"""An older measurement says nothing of the speed now."""
MAX_SPEED_M_S = 20.0
MAX_TURN_DEG_S = 1500.0
"""A head that is faster was put elsewhere, and did not move there."""
MEASUREMENTS_KEPT = 64


Times = npt.NDArray[np.int64]


class _Past(NamedTuple):
    """The ring of the latest measurements, in order of time."""

    t_ns: npt.NDArray[np.int64]
    place_m: Vector
    turn_wxyz: Vector


class Foresight:
    """Measure a body's head now, and foresee it for a later time; the body is asked in order."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._lock = threading.Lock()
        n = MEASUREMENTS_KEPT
        self._past = _Past(np.zeros(n, np.int64), np.zeros((n, 3)), np.zeros((n, 4)))
        self._newest = -1
        self._newest_ns = 0
        self._count = 0

    def at(self, now_ns: int, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) and orientation (4,) at `t_ns` by what is known at `now_ns`.

        A time that has passed is interpolated between measurements.
        """
        pose = np.empty(7)
        with self._lock:  # devices of one runtime may ask from threads of their own
            self._measure(now_ns)
            _foresee(*self._past, self._newest, self._count, t_ns, pose)
        return pose[:3], pose[3:]

    def at_once(self, now_ns: int, t_ns: int) -> npt.NDArray[np.float32]:
        """Return the poses (2, 7) that `at` returns for `now_ns` and for `t_ns`: place, then
        orientation, as numbers of a recording.
        """
        poses = np.empty((2, 7), np.float32)
        with self._lock:
            self._measure(now_ns)
            _foresee_both(*self._past, self._newest, self._count, now_ns, t_ns, poses)
        return poses

    def ahead(
        self,
        times_ns: Times,
        lights_ns: Times,
        heads: tuple[Vector, Vector],
    ) -> npt.NDArray[np.float32]:
        """Return (n, 2, 7) what `at_once` will return at coming times, given the heads then."""
        poses = np.empty((times_ns.shape[0], 2, 7), np.float32)
        t_ns, place_m, turn_wxyz = self._past
        past = _Past(t_ns.copy(), place_m.copy(), turn_wxyz.copy())
        _foresee_run(*past, self._newest, self._count, times_ns, lights_ns, *heads, poses)
        return poses

    def pass_times(self, times_ns: Times, heads: tuple[Vector, Vector]) -> None:
        """Measure at each of some times, at which the head is known."""
        past = self._past
        with self._lock:
            n, first = times_ns.shape[0], (self._newest + 1) % MEASUREMENTS_KEPT
            for ring, rows in zip(past, (times_ns, *heads), strict=True):
                put_round(ring, first, rows)
            self._newest, self._newest_ns = (first + n - 1) % MEASUREMENTS_KEPT, int(times_ns[-1])
            self._count = min(self._count + n, MEASUREMENTS_KEPT)

    def is_before(self, t_ns: int) -> bool:
        """Tell whether nothing was measured at this time or later."""
        return not self._count or self._newest_ns < t_ns

    def _measure(self, now_ns: int) -> None:
        """Measure the head now, unless that or a later time was measured."""
        if self._count and now_ns <= self._newest_ns:
            return
        past = self._past
        i = self._newest = (self._newest + 1) % MEASUREMENTS_KEPT
        past.place_m[i], past.turn_wxyz[i] = self._body.head(now_ns)
        past.t_ns[i] = self._newest_ns = now_ns
        self._count = min(self._count + 1, MEASUREMENTS_KEPT)


@compiled
def _foresee_both(
    past_ns: Times,
    past_m: Vector,
    past_wxyz: Vector,
    newest: int,
    count: int,
    now_ns: int,
    t_ns: int,
    poses: npt.NDArray[np.float32],
) -> None:
    """Write the head at two times, one call of a frame in place of two."""
    pose = np.empty(7)
    for row in range(2):
        at_ns = now_ns if row == 0 else t_ns
        _foresee(past_ns, past_m, past_wxyz, newest, count, at_ns, pose)
        for k in range(7):
            poses[row, k] = pose[k]


@compiled
def _foresee_run(
    past_ns: Times,
    past_m: Vector,
    past_wxyz: Vector,
    newest: int,
    count: int,
    times_ns: Times,
    lights_ns: Times,
    heads_m: Vector,
    heads_wxyz: Vector,
    poses: npt.NDArray[np.float32],
) -> None:
    """Measure at several times in turn, and write the head at each and at its light."""
    for i in range(times_ns.shape[0]):
        newest = (newest + 1) % MEASUREMENTS_KEPT
        count = min(count + 1, MEASUREMENTS_KEPT)
        past_ns[newest] = times_ns[i]
        for k in range(3):
            past_m[newest, k] = heads_m[i, k]
        for k in range(4):
            past_wxyz[newest, k] = heads_wxyz[i, k]
        _foresee_both(
            past_ns, past_m, past_wxyz, newest, count, times_ns[i], lights_ns[i], poses[i]
        )


@compiled
def _foresee(
    past_ns: Times,
    past_m: Vector,
    past_wxyz: Vector,
    newest: int,
    count: int,
    t_ns: int,
    pose: Vector,
) -> None:
    """Write the head at a time: interpolated up to the newest measurement, then foreseen."""
    capacity = past_ns.shape[0]
    first, last = newest, newest
    if t_ns < past_ns[newest]:
        # Between two measurements; before the oldest, that one.
        for back in range(count):
            first = (newest - back) % capacity
            if past_ns[first] <= t_ns:
                break
            last = first
    elif t_ns > past_ns[newest]:
        # The speed is that since the latest measurement that is neither too near nor too old.
        for back in range(1, count):
            i = (newest - back) % capacity
            since_ns = past_ns[newest] - past_ns[i]
            if since_ns >= STALE_NS:
                break
            if since_ns >= SPEED_OVER_NS:
                first = i
                break
    _move(past_ns, past_m, past_wxyz, first, last, t_ns, pose)


@compiled
def _move(
    past_ns: Times,
    past_m: Vector,
    past_wxyz: Vector,
    first: int,
    last: int,
    t_ns: int,
    pose: Vector,
) -> None:
    """Write the pose at a time of a steady movement through two; `last` where they are too far."""
    span_ns = past_ns[last] - past_ns[first]
    for k in range(3):
        pose[k] = past_m[last, k]
    for k in range(4):
        pose[3 + k] = past_wxyz[last, k]
    if span_ns <= 0:
        return
    way_x = past_m[last, 0] - past_m[first, 0]
    way_y = past_m[last, 1] - past_m[first, 1]
    way_z = past_m[last, 2] - past_m[first, 2]
    # The rotation in world that leads from one orientation to the other, the short way round.
    before, after = past_wxyz[first], past_wxyz[last]
    orientation = (after[0], after[1], after[2], after[3])
    w, x, y, z = times(orientation, (before[0], -before[1], -before[2], -before[3]))
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * np.arctan2(sine, w)
    way_m = np.sqrt(way_x * way_x + way_y * way_y + way_z * way_z)
    if (
        np.degrees(angle) * NS_PER_S > MAX_TURN_DEG_S * span_ns
        or way_m * NS_PER_S > MAX_SPEED_M_S * span_ns
    ):
        return
    share = (t_ns - past_ns[last]) / span_ns
    pose[0] += share * way_x
    pose[1] += share * way_y
    pose[2] += share * way_z
    if sine > 0.0:
        half = share * angle / 2.0
        scale = np.sin(half) / sine
        turn = times((np.cos(half), scale * x, scale * y, scale * z), orientation)
        pose[3], pose[4], pose[5], pose[6] = turn
