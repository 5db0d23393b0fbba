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
from visavis.stimuli.motion.quaternion_kernels import times

SPEED_OVER_NS = 2 * NS_PER_MS
"""Speed is taken between measurements at least this far apart."""
STALE_NS = NS_PER_S // 5
"""An older measurement says nothing of the speed now."""
MAX_SPEED_M_S = 20.0
MAX_TURN_DEG_S = 1500.0
"""A head that is faster was put elsewhere, and did not move there."""
MEASUREMENTS_KEPT = 64


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
        place_m, turn_wxyz = np.empty(3), np.empty(4)
        with self._lock:  # devices of one runtime may ask from threads of their own
            if not self._count or now_ns > self._newest_ns:
                self._measure(now_ns)
            _foresee(self._past, self._newest, self._count, t_ns, place_m, turn_wxyz)
        return place_m, turn_wxyz

    def _measure(self, now_ns: int) -> None:
        past = self._past
        i = self._newest = (self._newest + 1) % MEASUREMENTS_KEPT
        past.place_m[i], past.turn_wxyz[i] = self._body.head(now_ns)
        past.t_ns[i] = self._newest_ns = now_ns
        self._count = min(self._count + 1, MEASUREMENTS_KEPT)


@compiled
def _foresee(
    past: _Past, newest: int, count: int, t_ns: int, place_m: Vector, turn_wxyz: Vector
) -> None:
    """Write the head at a time: interpolated up to the newest measurement, then foreseen."""
    capacity = past.t_ns.shape[0]
    first, last = newest, newest
    if t_ns < past.t_ns[newest]:
        # Between two measurements; before the oldest, that one.
        for back in range(count):
            first = (newest - back) % capacity
            if past.t_ns[first] <= t_ns:
                break
            last = first
    elif t_ns > past.t_ns[newest]:
        # The speed is that since the latest measurement that is neither too near nor too old.
        for back in range(1, count):
            i = (newest - back) % capacity
            since_ns = past.t_ns[newest] - past.t_ns[i]
            if since_ns >= STALE_NS:
                break
            if since_ns >= SPEED_OVER_NS:
                first = i
                break
    _move(past, first, last, t_ns, place_m, turn_wxyz)


@compiled
def _move(
    past: _Past, first: int, last: int, t_ns: int, place_m: Vector, turn_wxyz: Vector
) -> None:
    """Write the pose at a time of a steady movement through two; `last` where they are too far."""
    span_ns = past.t_ns[last] - past.t_ns[first]
    bw, bx, by, bz = past.turn_wxyz[last]
    place_m[:] = past.place_m[last]
    turn_wxyz[:] = past.turn_wxyz[last]
    if span_ns <= 0:
        return
    way_x, way_y, way_z = past.place_m[last] - past.place_m[first]
    # The rotation in world that leads from one orientation to the other, the short way round.
    aw, ax, ay, az = past.turn_wxyz[first]
    w, x, y, z = times((bw, bx, by, bz), (aw, -ax, -ay, -az))
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
    share = (t_ns - past.t_ns[last]) / span_ns
    place_m[0] += share * way_x
    place_m[1] += share * way_y
    place_m[2] += share * way_z
    if sine > 0.0:
        half = share * angle / 2.0
        k = np.sin(half) / sine
        turn = times((np.cos(half), k * x, k * y, k * z), (bw, bx, by, bz))
        turn_wxyz[0], turn_wxyz[1], turn_wxyz[2], turn_wxyz[3] = turn
