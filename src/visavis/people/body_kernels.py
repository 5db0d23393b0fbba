"""Head, eyes and hand of a standing person, any number of instants at once.

A simulated body is asked at every frame, mostly about one instant, where NumPy's calls would cost
more than the arithmetic. Each instant is computed by itself, so that asking about many at once
gives the same numbers as asking one by one.
"""

from typing import Final

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.quaternion_kernels import (
    Triple,
    dot,
    inverse,
    minus,
    plus,
    quat_of,
    rotate_vector,
    triple_of,
)
from visavis.stimuli.motion.rhythm_kernels import ease

TURN_S: Final = 0.45
"""Time in which the head turns from one point to the next."""
HEAD_SHARE: Final = 0.6
"""Share of a gaze shift that the head takes over."""
SWAY_M: Final = 0.006
SWAY_HZ: Final = (0.13, 0.11, 0.17)
HALF_IPD_M: Final = 0.0315
POINT_S: Final = 0.5
"""Time of a hand movement from one point to the next, in seconds."""
NO_LENGTH: Final = 1e-9


@compiled
def _unit(v: Triple) -> Triple:
    length = np.sqrt(dot(v, v))
    if not 0.0 < length < np.inf:
        return np.nan, np.nan, np.nan
    return v[0] / length, v[1] / length, v[2] / length


@compiled
def head_rows(
    t_s: Vector, starts_s: Vector, aims_rad: Vector, eye_m: Vector, sway_rad: Vector
) -> tuple[Vector, Vector]:
    """Return where the eyes are (t, 3) and how the head is turned (t, 4) (w, x, y, z) at times.

    The head turns to yaw and pitch `aims_rad` (n, 2) from `starts_s` (n,) on, and stands at the
    first before; the eyes sway about `eye_m` (3,) with initial phases `sway_rad` (3,).
    """
    positions, turns = np.empty((len(t_s), 3)), np.empty((len(t_s), 4))
    for i in range(len(t_s)):
        yaw, pitch = 0.0, 0.0
        for k in range(1, len(starts_s)):
            share = ease((t_s[i] - starts_s[k]) / TURN_S)
            yaw += share * (aims_rad[k, 0] - aims_rad[k - 1, 0])
            pitch += share * (aims_rad[k, 1] - aims_rad[k - 1, 1])
        left, up = (
            HEAD_SHARE * (aims_rad[0, 0] + yaw) / 2,
            HEAD_SHARE * (aims_rad[0, 1] + pitch) / 2,
        )
        cy, sy, cp, sp = np.cos(left), np.sin(left), np.cos(up), np.sin(up)
        turns[i, 0], turns[i, 1], turns[i, 2], turns[i, 3] = cy * cp, cy * sp, sy * cp, -sy * sp
        for axis in range(3):
            wave = np.sin(2 * np.pi * SWAY_HZ[axis] * t_s[i] + sway_rad[axis])
            positions[i, axis] = eye_m[axis] + SWAY_M * wave
    return positions, turns


@compiled
def gaze_rows(
    t_s: Vector, starts_s: Vector, points_m: Vector, positions_m: Vector, turns: Vector
) -> tuple[Vector, Vector]:
    """Return the directions (t, 3) of the left and the right eye in the head.

    Both look at the last of `points_m` (n, 3) that has begun, at once; the head follows slowly.
    """
    left, right = np.empty((len(t_s), 3)), np.empty((len(t_s), 3))
    for i in range(len(t_s)):
        k = max(np.searchsorted(starts_s, t_s[i], side="right"), 1) - 1
        target, turn = triple_of(points_m[k]), quat_of(turns[i])
        for rows, side_m in ((left, -HALF_IPD_M), (right, HALF_IPD_M)):
            at = plus(triple_of(positions_m[i]), rotate_vector(turn, (side_m, 0.0, 0.0)))
            ahead = _unit(rotate_vector(inverse(turn), minus(target, at)))
            rows[i, 0], rows[i, 1], rows[i, 2] = ahead
    return left, right


@compiled
def pointed_rows(t_s: Vector, starts_s: Vector, points_m: Vector) -> Vector:
    """Return the points (t, 3) to which a hand points that moves on to `points_m` (n, 3)."""
    rows = np.empty((len(t_s), 3))
    for i in range(len(t_s)):
        for axis in range(3):
            at = points_m[0, axis]
            for k in range(1, len(starts_s)):
                at += ease((t_s[i] - starts_s[k]) / POINT_S) * (points_m[k, axis] - at)
            rows[i, axis] = at
    return rows


@compiled
def finger_rows(hand_m: Vector, pointed_m: Vector, along: Vector) -> Vector:
    """Return turns (t, 4) of a right hand at `hand_m` (t, 3) whose fingers point to points (t, 3).

    `along` (3,) are the fingers of a hand that is not turned.
    """
    turns = np.empty((len(hand_m), 4))
    for i in range(len(hand_m)):
        ahead = _unit(minus(triple_of(pointed_m[i]), triple_of(hand_m[i])))
        turns[i, 0] = 1.0 + dot(ahead, triple_of(along))
        turns[i, 1] = along[1] * ahead[2] - along[2] * ahead[1]
        turns[i, 2] = along[2] * ahead[0] - along[0] * ahead[2]
        turns[i, 3] = along[0] * ahead[1] - along[1] * ahead[0]
        length = np.sqrt((turns[i] * turns[i]).sum())
        if length < NO_LENGTH:  # exactly backwards: any axis would do
            turns[i, 0], turns[i, 1], turns[i, 2], turns[i, 3] = 0.0, 0.0, 1.0, 0.0
        else:
            turns[i] /= length
    return turns
