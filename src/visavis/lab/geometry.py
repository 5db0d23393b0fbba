"""Vectors, quaternions and poses: metres, right-handed, y up, −z forward, (w, x, y, z)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """A position (3,) in metres and a unit quaternion (4,) (w, x, y, z), both in world."""

    position_m: Vector
    orientation_wxyz: Vector


def unit(v: Vector) -> Vector:
    """Scale vectors (..., 3) to length one; zero and non-finite vectors become NaN."""
    if v.shape == (3,) and v.dtype == np.float64:  # as below, without the cost of arrays
        x, y, z = v.tolist()
        length_1 = math.sqrt(x * x + y * y + z * z)
        if 0.0 < length_1 < math.inf:
            return np.array([x / length_1, y / length_1, z / length_1])
        return np.full(3, np.nan)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        direction: Vector = np.where(np.isfinite(length) & (length > 0), v / length, np.nan)
    return direction


def angle_deg(a: Vector, b: Vector) -> Vector:
    """Return the angle between unit vectors (..., 3) in degrees.

    Uses 2 asin(|a-b|/2), which keeps small angles that arccos of a dot product loses, and its
    complement for directions more than 90° apart.
    """
    half_chord: Vector = np.linalg.norm(a - b, axis=-1) / 2
    half_sum = np.linalg.norm(a + b, axis=-1) / 2
    angles: Vector = np.degrees(2 * np.arctan2(half_chord, half_sum))
    return angles


def quat_from_yaw_pitch_deg(yaw_deg: float, pitch_deg: float = 0.0) -> Vector:
    """Return the rotation that turns −z left by yaw (about +y) and up by pitch, roll zero."""
    y, p = np.radians(yaw_deg) / 2, np.radians(pitch_deg) / 2
    cy, sy, cp, sp = np.cos(y), np.sin(y), np.cos(p), np.sin(p)
    return np.array([cy * cp, cy * sp, sy * cp, -sy * sp])


def quat_multiply(a: Vector, b: Vector) -> Vector:
    """Compose rotations (..., 4): first b, then a."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def quat_conjugate(q: Vector) -> Vector:
    """Invert unit quaternions (..., 4)."""
    inverse: Vector = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def rotate(q: Vector, v: Vector) -> Vector:
    """Rotate vectors (..., 3) by unit quaternions (..., 4)."""
    if q.ndim == v.ndim == 1 and q.dtype == v.dtype == np.float64:
        return np.array(rotate_one(q.tolist(), v.tolist()))
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    vx, vy, vz = v[..., 0], v[..., 1], v[..., 2]
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    result: Vector = np.stack(
        [
            vx + w * tx + y * tz - z * ty,
            vy + w * ty + z * tx - x * tz,
            vz + w * tz + x * ty - y * tx,
        ],
        axis=-1,
    )
    return result


def rotate_one(q: Sequence[float], v: Sequence[float]) -> tuple[float, float, float]:
    """Rotate one vector (3,) by a unit quaternion (4,): bit for bit as `rotate`, in a sixth of the
    time, because frames of a session rotate one vector at a time.
    """
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def direction_from_yaw_pitch_deg(yaw_deg: npt.ArrayLike, pitch_deg: npt.ArrayLike) -> Vector:
    """Return unit vectors (..., 3): yaw positive to the left of −z, pitch positive up."""
    yaw, pitch = np.radians(np.asarray(yaw_deg)), np.radians(np.asarray(pitch_deg))
    return np.stack(
        [-np.sin(yaw) * np.cos(pitch), np.sin(pitch), -np.cos(yaw) * np.cos(pitch)], axis=-1
    )


def yaw_pitch_deg_of(direction: Vector) -> tuple[Vector, Vector]:
    """Return yaw (left positive) and pitch (up positive) in degrees of vectors (..., 3)."""
    x, y, z = np.moveaxis(direction, -1, 0)
    return np.degrees(np.arctan2(-x, -z)), np.degrees(np.arctan2(y, np.hypot(x, z)))


def turn_towards(direction: Vector) -> Vector:
    """Return a rotation (4,) that turns −z to a unit direction (3,)."""
    x, y, z = direction.tolist()
    # One and the dot product, then the cross product with what is ahead, zeros with their signs.
    quaternion = np.array([1.0 - z, 0.0 * z + y, -x - 0.0 * z, 0.0 * y - 0.0 * x])
    length = float(np.linalg.norm(quaternion))
    return np.array([0.0, 0.0, 1.0, 0.0]) if length < 1e-9 else quaternion / length
