"""Rotations between key poses by four methods behind one interface: LinEuler, Slerp, Squad, Spline.

All hold the keys of any number of joints and answer for any number of times at once.
Squad is Shoemake's: three nested arcs towards the keys and towards control points. Keys are put
into one hemisphere, the nested arcs are taken as they lie: a shorter-arc rule inside makes
figures jump when neighbouring keys are more than 90° apart.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.key_kernels import locate_rows
from visavis.stimuli.motion.rotations import (
    check_order,
    euler_from_quat,
    quat_from_euler,
    same_hemisphere,
    squad_control,
    unit_quats,
)
from visavis.stimuli.motion.slerp_kernels import slerp_segments
from visavis.stimuli.motion.squad_kernels import arcs_of, squad_segments

if TYPE_CHECKING:
    from scipy.spatial.transform import RotationSpline

Method: TypeAlias = Literal["lineuler", "slerp", "squad", "spline"]


@dataclass(frozen=True, eq=False)
class KeyTimes:
    """When the keys are: `t_s` (k,) rising.

    With `period_s` the motion is closed: one more segment leads from the last key back to the
    first, which returns at `t_s[0] + period_s`. Outside the keys an open motion rests, or goes
    on along its first and last segment when `extrapolate` is set.
    """

    t_s: Vector
    period_s: float | None = None
    extrapolate: bool = False

    def __post_init__(self) -> None:
        t = np.asarray(self.t_s, dtype=np.float64)
        object.__setattr__(self, "t_s", t)
        if t.ndim != 1 or t.size < 2:
            raise MotionError(f"key times have shape {t.shape}; give at least two keys")
        if not np.isfinite(t).all() or (np.diff(t) <= 0).any():
            raise MotionError("key times must be finite and rise from key to key; sort the keys")
        if self.period_s is not None and not t[-1] - t[0] < self.period_s < np.inf:
            raise MotionError(
                f"period {self.period_s} s does not reach beyond the last key, {t[-1] - t[0]} s "
                "after the first; leave time for the way back"
            )

    @property
    def is_closed(self) -> bool:
        """Whether the last key leads back to the first."""
        return self.period_s is not None

    @cached_property
    def segment_s(self) -> Vector:
        """Duration of every segment, shape (segments,)."""
        inner = np.diff(self.t_s)
        if self.period_s is None:
            return inner
        return np.append(inner, self.t_s[0] + self.period_s - self.t_s[-1])

    def locate(self, t_s: npt.ArrayLike) -> tuple[npt.NDArray[np.int64], Vector]:
        """Return segment and share h of it for times of any shape.

        Raises:
            MotionError: a time is not finite.
        """
        t = np.asarray(t_s, dtype=np.float64)
        segment, h = np.empty(t.shape, np.int64), np.empty(t.shape)
        is_finite = locate_rows(
            t.ravel(),
            float(self.t_s[0]),
            self._starts_s,
            self.segment_s,
            float(self.period_s or 0.0),
            self.is_closed or not self.extrapolate,
            segment.reshape(-1),
            h.reshape(-1),
        )
        if not is_finite:
            raise MotionError("asked for a pose at a time that is not a number; give finite times")
        return segment[()], h[()]

    @cached_property
    def _starts_s(self) -> Vector:
        """Where segments begin, from the first key on, shape (segments,)."""
        starts: Vector = self.t_s[: len(self.segment_s)] - self.t_s[0]
        return starts


class Interpolation(Protocol):
    """Rotations of any joints as a function of time."""

    @property
    def times(self) -> KeyTimes:
        """When the keys are."""
        ...

    def in_segment(self, segment: npt.ArrayLike, h: npt.ArrayLike) -> Vector:
        """Return rotations at share h of segments; same shapes as `at`, h is not clamped."""
        ...

    def at(self, t_s: npt.ArrayLike) -> Vector:
        """Return unit quaternions, shape (shape of t_s, shape of the joints, 4)."""
        ...


def _neighbours(times: KeyTimes, keys: Vector, ahead: int) -> Vector:
    """Return the key `ahead` places after the start of every segment; the ends repeat."""
    first = np.arange(len(times.segment_s))
    index = first + ahead
    if times.is_closed:
        return keys[index % len(keys)]
    return keys[np.clip(index, 0, len(keys) - 1)]


def _flat(keys: Vector) -> Vector:
    """Gather all joints in one axis: (keys, joints, 4), contiguous."""
    return np.ascontiguousarray(keys.reshape(len(keys), -1, 4))


def _count(times: KeyTimes, keys: Vector) -> None:
    if len(keys) != len(times.t_s):
        raise MotionError(f"{len(keys)} keys at {len(times.t_s)} times; give one time per key")


def _shares(
    times: KeyTimes, segment: npt.ArrayLike, h: npt.ArrayLike
) -> tuple[npt.NDArray[np.int64], Vector]:
    """Broadcast and check segments and shares."""
    s, x = np.asarray(segment, dtype=np.int64), np.asarray(h, dtype=np.float64)
    if s.shape != x.shape:
        s, x = np.broadcast_arrays(s, x)
    # Read without a sign, a number below zero is beyond all segments: one pass tells both.
    if s.size and np.maximum.reduce(s.view(np.uint64), axis=None) >= len(times.segment_s):
        raise MotionError(
            f"segments {s.min()} to {s.max()} asked for; there are {len(times.segment_s)}"
        )
    return s, x


@dataclass(frozen=True, eq=False)
class LinEuler:
    """Blend Euler angles one by one: the method the others are compared with.

    `keys_rad` (k, ..., 3) in the order of `order`. Angles are taken as authored, so 170° to −170°
    goes through 0°; `unwrap` takes the short way round for every angle instead.
    """

    times: KeyTimes
    keys_rad: Vector
    order: str
    unwrap: bool = False

    def __post_init__(self) -> None:
        keys = np.asarray(self.keys_rad, dtype=np.float64)
        object.__setattr__(self, "keys_rad", keys)
        object.__setattr__(self, "order", check_order(self.order))
        _count(self.times, keys)
        if keys.shape[-1] != 3 or not np.isfinite(keys).all():
            raise MotionError("Euler keys must be finite with three angles each; correct them")

    @cached_property
    def _ends(self) -> tuple[Vector, Vector]:
        start, end = (_neighbours(self.times, self.keys_rad, a) for a in (0, 1))
        turn = end - start
        if self.unwrap:
            turn = turn - 2 * np.pi * np.round(turn / (2 * np.pi))
        return start, turn

    def in_segment(self, segment: npt.ArrayLike, h: npt.ArrayLike) -> Vector:
        """Return rotations at share h of segments; h is not clamped."""
        s, x = _shares(self.times, segment, h)
        start, turn = self._ends
        x = x.reshape(x.shape + (1,) * (start.ndim - 1))
        return quat_from_euler(start[s] + x * turn[s], self.order)

    def at(self, t_s: npt.ArrayLike) -> Vector:
        """Return unit quaternions, shape (shape of t_s, shape of the joints, 4)."""
        return self.in_segment(*self.times.locate(t_s))


@dataclass(frozen=True, eq=False)
class Slerp:
    """Turn along the shorter arc from key to key at constant speed.

    `keys_wxyz` (k, ..., 4). Keys exactly 180° apart turn as the signs given say.
    """

    times: KeyTimes
    keys_wxyz: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "keys_wxyz", unit_quats(self.keys_wxyz, "keys"))
        _count(self.times, self.keys_wxyz)

    @cached_property
    def _ends(self) -> tuple[Vector, Vector]:
        keys = _flat(self.keys_wxyz)
        start = _neighbours(self.times, keys, 0)
        return start, same_hemisphere(_neighbours(self.times, keys, 1), start)

    def in_segment(self, segment: npt.ArrayLike, h: npt.ArrayLike) -> Vector:
        """Return rotations at share h of segments; h is not clamped."""
        s, x = _shares(self.times, segment, h)
        start, end = self._ends
        out = np.empty((s.size, *start.shape[1:]))
        slerp_segments(start, end, s.ravel(), x.ravel(), out)
        return out.reshape(*s.shape, *self.keys_wxyz.shape[1:])

    def at(self, t_s: npt.ArrayLike) -> Vector:
        """Return unit quaternions, shape (shape of t_s, shape of the joints, 4)."""
        return self.in_segment(*self.times.locate(t_s))


@dataclass(frozen=True, eq=False)
class Squad:
    """Pass through the keys without a break in speed.

    `keys_wxyz` (k, ..., 4). An open motion has its end keys as their own control points. With
    `time_aware` uneven key times are allowed for, so angular velocity is continuous at every
    key; without it the formula for even times is used whatever the times. `controls="neighbours"`
    puts the keys before and after a segment in place of control points, a published variant that
    slows down and backs up at the keys; it is there to be compared with.
    """

    times: KeyTimes
    keys_wxyz: Vector
    time_aware: bool = True
    controls: Literal["shoemake", "neighbours"] = "shoemake"

    def __post_init__(self) -> None:
        object.__setattr__(self, "keys_wxyz", unit_quats(self.keys_wxyz, "keys"))
        _count(self.times, self.keys_wxyz)

    @cached_property
    def _ends(self) -> tuple[Vector, Vector, Vector, Vector]:
        times, keys = self.times, _flat(self.keys_wxyz)
        start = _neighbours(times, keys, 0)
        end = same_hemisphere(_neighbours(times, keys, 1), start)
        before = same_hemisphere(_neighbours(times, keys, -1), start)
        after = same_hemisphere(_neighbours(times, keys, 2), end)
        if self.controls == "neighbours":
            return start, end, before, after
        lasts = times.segment_s[:, None]
        share_in, share_out = np.ones_like(lasts), np.ones_like(lasts)
        if self.time_aware:
            share_in = lasts / np.roll(lasts, 1, axis=0)
            share_out = lasts / np.roll(lasts, -1, axis=0)
        leave = squad_control(before, start, end, share_in)
        arrive = squad_control(after, end, start, share_out)
        if not times.is_closed:
            leave[0], arrive[-1] = start[0], end[-1]
        return start, end, leave, arrive

    @cached_property
    def arcs(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Arcs between keys and between control points, as `squad_segments` reads them."""
        start, end, leave, arrive = self._ends
        return *arcs_of(start, end), *arcs_of(leave, arrive)

    def in_segment(self, segment: npt.ArrayLike, h: npt.ArrayLike) -> Vector:
        """Return rotations at share h of segments; h is not clamped."""
        s, x = _shares(self.times, segment, h)
        out = np.empty((s.size, *self._ends[0].shape[1:]))
        squad_segments(*self.arcs, s.ravel(), x.ravel(), out)
        return out.reshape(*s.shape, *self.keys_wxyz.shape[1:])

    def at(self, t_s: npt.ArrayLike) -> Vector:
        """Return unit quaternions, shape (shape of t_s, shape of the joints, 4)."""
        return self.in_segment(*self.times.locate(t_s))


@dataclass(frozen=True, eq=False)
class Spline:
    """Pass through the keys without a break in angular acceleration: a cubic spline of rotations.

    `keys_wxyz` (k, ..., 4), of an open motion. Source: the rotation spline of SciPy, after
    McEnnan; natural ends, where nothing accelerates.

    Raises:
        MotionError: the motion is closed.
    """

    times: KeyTimes
    keys_wxyz: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "keys_wxyz", unit_quats(self.keys_wxyz, "keys"))
        _count(self.times, self.keys_wxyz)
        if self.times.is_closed:
            raise MotionError("a spline of rotations is open; close a motion with Squad")

    @cached_property
    def _curves(self) -> tuple["RotationSpline", ...]:
        from scipy.spatial.transform import Rotation, RotationSpline

        keys = _flat(self.keys_wxyz)
        return tuple(
            RotationSpline(self.times.t_s, Rotation.from_quat(np.roll(keys[:, j], -1, axis=-1)))
            for j in range(keys.shape[1])
        )

    def in_segment(self, segment: npt.ArrayLike, h: npt.ArrayLike) -> Vector:
        """Return rotations at share h of segments; h is not clamped."""
        s, x = _shares(self.times, segment, h)
        t_s = (self.times.t_s[s] + x * self.times.segment_s[s]).ravel()
        quaternions = [np.roll(curve(t_s).as_quat(), 1, axis=-1) for curve in self._curves]
        near = _flat(self.keys_wxyz)[s.ravel()]
        out = same_hemisphere(np.stack(quaternions, axis=1), near)
        return out.reshape(*s.shape, *self.keys_wxyz.shape[1:])

    def at(self, t_s: npt.ArrayLike) -> Vector:
        """Return unit quaternions, shape (shape of t_s, shape of the joints, 4)."""
        return self.in_segment(*self.times.locate(t_s))


def interpolate(
    method: Method, times: KeyTimes, keys_wxyz: npt.ArrayLike, *, order: str = "ZXY"
) -> Interpolation:
    """Return the rotations between key poses (k, ..., 4) by one of the methods.

    `order` is that of the Euler angles LinEuler blends; they are taken within ±180°, the middle
    one within ±90°. Authored angles go to `LinEuler` itself.
    """
    keys = unit_quats(keys_wxyz, "keys")
    if method == "lineuler":
        return LinEuler(times, euler_from_quat(keys, order), order)
    if method == "slerp":
        return Slerp(times, keys)
    return Squad(times, keys) if method == "squad" else Spline(times, keys)
