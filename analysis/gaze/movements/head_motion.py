"""Take out of gaze what the head alone puts in: eyes paired with the head of another moment, VOR.

Gaze in world is the eye in the head, turned by the head. Where both bear times that are apart (a
tracker's delay that nobody measured), gaze that rests seems to move with the head's acceleration:
30 ms make 38°/s of it when a head turns to and fro once a second with 200°/s. Where the eyes turn
back by a little less than the head turns on, gaze that rests slips with the head's speed. Both are
measured in the recording and taken out before movements are told apart.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.analysis.gaze.stamps import Times
from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector

MAX_LATE_MS: Final = 100.0
MAX_SLIP: Final = 0.15
"""Eyes turn back by 85 to 115 % of what the head turns; what moves more with it is a movement."""
STANDARD_ERRORS: Final = 3.0
SMOOTHED_MS: Final = 40.0
SLOW_SPREADS: Final = 3.0
ROUNDS: Final = 4
TURNING_DEG_S: Final = 10.0
MIN_ROWS: Final = 60


@dataclass(frozen=True, slots=True)
class HeadMotion:
    """What the head puts into a recording's gaze in world: `late_ms` by which eyes are paired with
    a later head, and `slip_01`, the share of its turns that the eyes leave uncompensated.
    """

    late_ms: float
    slip_01: float


STILL: Final = HeadMotion(0.0, 0.0)


def without_head(t_ns: Times, in_world: Vector, in_head: Vector) -> tuple[Vector, HeadMotion]:
    """Return gaze in world (n, 3) as if eyes and head were of one moment and VOR complete.

    Both are measured together, by robust least squares of slow gaze on the head's speed and
    acceleration, and used where they stand out of their standard errors.
    """
    turn, nod = _head_deg(in_world, in_head)
    is_seen = np.isfinite(turn)
    if is_seen.sum() < MIN_ROWS:
        return in_world, STILL
    s = (t_ns - t_ns[0]) * 1e-9
    seen_s = s[is_seen]
    head = np.column_stack([np.unwrap(turn[is_seen], period=360.0), nod[is_seen]])
    width = max(1, round(SMOOTHED_MS * NS_PER_MS / max(float(np.median(np.diff(t_ns))), 1.0)))
    if np.sqrt((_slopes(seen_s, head, width) ** 2).mean()) < TURNING_DEG_S:
        return in_world, STILL
    eye = in_head[is_seen]
    motion = STILL
    head_free = _places_deg(_turn(eye, head))
    for _ in range(2):  # the second round takes what the first left, as shifts are not quite linear
        rest = _fit_motion(seen_s, head_free, head, width)
        motion = HeadMotion(motion.late_ms + rest.late_ms, motion.slip_01 + rest.slip_01)
        if abs(motion.late_ms) > MAX_LATE_MS or abs(motion.slip_01) > MAX_SLIP:
            return in_world, STILL
        shifted = np.column_stack(
            [np.interp(seen_s - motion.late_ms * 1e-3, seen_s, axis) for axis in head.T]
        )
        slip_deg = motion.slip_01 * (shifted - shifted.mean(axis=0))
        head_free = _places_deg(_turn(eye, shifted)) - slip_deg
        head_free[:, 0] = np.unwrap(head_free[:, 0], period=360.0)
    if motion == STILL:
        return in_world, STILL
    free = np.full(in_world.shape, np.nan)
    free[is_seen] = _rays(head_free)
    return free, motion


def _fit_motion(s: Vector, gaze: Vector, head: Vector, width: int) -> HeadMotion:
    """Fit speeds of gaze by the head's speed and acceleration; leave out what is fast."""
    gaze = np.column_stack([np.unwrap(gaze[:, 0], period=360.0), gaze[:, 1]])
    speed, turning = _slopes(s, gaze, width), _slopes(s, head, width)
    speeding = _slopes(s, turning, width)
    y = speed.T.ravel()
    x = np.column_stack([speeding.T.ravel(), turning.T.ravel()])
    is_known = np.isfinite(y) & np.isfinite(x).all(axis=1)
    y, x = y[is_known], x[is_known]
    weight: Vector = np.ones(len(y))
    off: Vector = np.zeros(len(y))
    coefficients: Vector = np.zeros(2)
    for _ in range(ROUNDS):
        table = x.T @ (x * weight[:, None]) + np.eye(2) * 1e-9
        coefficients = np.asarray(np.linalg.solve(table, x.T @ (y * weight)), np.float64)
        off = np.abs(y - x @ coefficients)
        limit = SLOW_SPREADS * 1.4826 * float(np.median(off)) + 1e-9
        weight = (1 - np.minimum(off / limit / 2, 1.0) ** 2) ** 2
    table = x.T @ (x * weight[:, None]) + np.eye(2) * 1e-9
    variance = float((weight * off**2).sum() / max(weight.sum(), 1.0))
    # Neighbouring speeds share samples, so fewer of them are independent.
    errors = np.sqrt(np.diag(np.linalg.inv(table)) * variance * (2 * width + 1))
    sure = np.where(np.abs(coefficients) > STANDARD_ERRORS * errors, coefficients, 0.0)
    return HeadMotion(1000 * float(sure[0]), float(sure[1]))


def _slopes(s: Vector, places: Vector, width: int) -> Vector:
    """Return slopes (n, 2) over `width` rows to either side; NaN at ends and across losses."""
    out = np.full(places.shape, np.nan)
    span = s[2 * width :] - s[: -2 * width]
    rise = (places[2 * width :] - places[: -2 * width]) / span[:, None]
    if len(span):
        rise[span > 3 * float(np.median(span))] = np.nan
    out[width : len(s) - width] = rise
    return out


def _head_deg(in_world: Vector, in_head: Vector) -> tuple[Vector, Vector]:
    """Return turn and nod (n,) of a head without roll that takes the one into the other."""
    x, y, z = in_head.T
    # Nodding by b takes (y, z) to height y cos b − z sin b, which is that of gaze in world.
    reach, lean = np.hypot(y, z), np.arctan2(-z, y)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip(in_world[:, 1] / reach, -1.0, 1.0)
        ahead = np.where(lean > 0, lean - np.arccos(share), lean + np.arccos(share))
        depth = y * np.sin(ahead) + z * np.cos(ahead)
        turn = np.arctan2(in_world[:, 0], -in_world[:, 2]) - np.arctan2(x, -depth)
    is_seen = np.ones(len(x), np.bool_)
    for ray in (in_world, in_head):
        is_seen &= np.isfinite(ray).all(axis=1) & (np.abs(ray).sum(axis=1) > 0)
    turn[~is_seen], ahead[~is_seen] = np.nan, np.nan
    return np.degrees(turn), np.degrees(ahead)


def _turn(eye: Vector, head_deg: Vector) -> Vector:
    """Return eyes (n, 3) by heads that nod, then turn (n, 2)."""
    a, b = np.radians(head_deg).T
    x, y, z = eye.T
    height, depth = y * np.cos(b) - z * np.sin(b), y * np.sin(b) + z * np.cos(b)
    rays: Vector = np.column_stack(
        [x * np.cos(a) - depth * np.sin(a), height, x * np.sin(a) + depth * np.cos(a)]
    )
    return rays


def _places_deg(ray: Vector) -> Vector:
    x, y, z = ray.T
    places: Vector = np.degrees(np.column_stack([np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))]))
    return places


def _rays(places_deg: Vector) -> Vector:
    right, up = np.radians(places_deg).T
    rays: Vector = np.column_stack(
        [np.cos(up) * np.sin(right), np.sin(up), -np.cos(up) * np.cos(right)]
    )
    return rays
