"""Foresee a body's head as runtimes do: it goes on as it moved last, for 11 to 60 ms.

Runtimes extrapolate from the speed of the head when they are asked. So does this, from the last
two measurements, with the error that comes of it: with an angular acceleration `a`, `a·T²/2` at a
look-ahead of `T`, and what the head turned between the measurements. Not modelled: filters, damping
of long look-aheads.
"""

import math
import threading
from collections import deque
from typing import NamedTuple

import numpy as np

from visavis.devices.contracts import Body
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import Vector

SPEED_OVER_NS = 2 * NS_PER_MS
"""Speed is taken between measurements at least this far apart."""
STALE_NS = NS_PER_S // 5
"""An older measurement says nothing of the speed now."""
MAX_SPEED_M_S = 20.0
MAX_TURN_DEG_S = 1500.0
"""A head that is faster was put elsewhere, and did not move there."""
MEASUREMENTS_KEPT = 64

Numbers = tuple[float, ...]


class _Measurement(NamedTuple):
    t_ns: int
    place_m: Numbers
    turn_wxyz: Numbers


class Foresight:
    """Measure a body's head now, and foresee it for a later time; the body is asked in order."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._lock = threading.Lock()
        self._past: deque[_Measurement] = deque(maxlen=MEASUREMENTS_KEPT)

    def at(self, now_ns: int, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) and orientation (4,) at `t_ns` by what is known at `now_ns`.

        A time that has passed is interpolated between measurements.
        """
        with self._lock:  # devices of one runtime may ask from threads of their own
            newest = self._measured(now_ns)
            if t_ns < newest.t_ns:
                return _arrays(self._between(t_ns))
            before = self._earlier(newest)
        if t_ns == newest.t_ns or before is None:
            return _arrays(newest)
        return _arrays(_moved(before, newest, t_ns))

    def _measured(self, now_ns: int) -> _Measurement:
        past = self._past
        if not past or now_ns > past[-1].t_ns:
            place_m, turn = self._body.head(now_ns)
            past.append(_Measurement(now_ns, tuple(place_m.tolist()), tuple(turn.tolist())))
        return past[-1]

    def _earlier(self, newest: _Measurement) -> _Measurement | None:
        """Return the measurement from which the speed is taken; None where none is fit."""
        for one in reversed(self._past):
            since_ns = newest.t_ns - one.t_ns
            if since_ns >= STALE_NS:
                return None
            if since_ns >= SPEED_OVER_NS:
                return one
        return None

    def _between(self, t_ns: int) -> _Measurement:
        after = self._past[-1]
        for one in reversed(self._past):
            if one.t_ns <= t_ns:
                return _moved(one, after, t_ns)
            after = one
        return after


def _moved(first: _Measurement, last: _Measurement, t_ns: int) -> _Measurement:
    """Return the pose at a time of a steady movement through two; `last` where they are too far."""
    span_ns = last.t_ns - first.t_ns
    if span_ns <= 0:
        return last
    way_m = tuple(b - a for a, b in zip(first.place_m, last.place_m, strict=True))
    w, x, y, z = _between_turns(first.turn_wxyz, last.turn_wxyz)
    sine = math.sqrt(x * x + y * y + z * z)
    angle = 2 * math.atan2(sine, w)
    if sine == 0 and way_m == (0.0, 0.0, 0.0):
        return last._replace(t_ns=t_ns)
    is_jump = (
        math.degrees(angle) * NS_PER_S > MAX_TURN_DEG_S * span_ns
        or math.hypot(*way_m) * NS_PER_S > MAX_SPEED_M_S * span_ns
    )
    if is_jump:
        return last._replace(t_ns=t_ns)
    share = (t_ns - last.t_ns) / span_ns
    place_m = tuple(b + share * d for b, d in zip(last.place_m, way_m, strict=True))
    half = share * angle / 2
    k = math.sin(half) / sine if sine else 0.0
    turn = _multiply((math.cos(half), k * x, k * y, k * z), last.turn_wxyz)
    return _Measurement(t_ns, place_m, turn)


def _between_turns(a: Numbers, b: Numbers) -> Numbers:
    """Return the rotation (w, x, y, z) in world that leads from one orientation to another."""
    turn = _multiply(b, (a[0], -a[1], -a[2], -a[3]))
    return turn if turn[0] >= 0 else tuple(-n for n in turn)


def _multiply(a: Numbers, b: Numbers) -> Numbers:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _arrays(pose: _Measurement) -> tuple[Vector, Vector]:
    return np.array(pose.place_m), np.array(pose.turn_wxyz)
