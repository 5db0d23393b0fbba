"""Rotations as unit quaternions: logarithm, arcs, Euler angles, reflection, means.

Arrays are (..., 4), (w, x, y, z), Hamilton, active; angles in radians.
"""

from typing import Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply, rotate
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.slerp_kernels import slerp_rows

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
UNIT_TOLERANCE = 1e-3
"""How far from 1 the length of an authored quaternion may be; it is scaled to 1."""


def unit_quats(q: npt.ArrayLike, what: str = "rotations") -> Vector:
    """Check and normalise quaternions (..., 4).

    Raises:
        MotionError: wrong shape, not finite, or a length off by more than `UNIT_TOLERANCE`.
    """
    array = np.asarray(q, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 4:
        raise MotionError(f"{what} have shape {array.shape}; give arrays (..., 4), w first")
    with np.errstate(over="ignore"):  # a length beyond all numbers is none of 1
        length = np.linalg.norm(array, axis=-1, keepdims=True)
    wrong = ~(np.abs(length[..., 0] - 1.0) <= UNIT_TOLERANCE)
    if wrong.any():
        where = tuple(int(i) for i in np.argwhere(wrong)[0])
        raise MotionError(
            f"{what} at index {where} is {array[where]!s}, not a unit quaternion; "
            "normalise it or correct the source"
        )
    exact: Vector = array / length
    return exact


def quat_log(q: Vector) -> Vector:
    """Return axis times half angle (..., 3); the sign of q is taken as it is."""
    v = q[..., 1:]
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = np.arctan2(sine, q[..., :1])
    small = sine < 1e-12
    half_turn: Vector = v * np.where(small, 1.0, angle / np.where(small, 1.0, sine))
    return half_turn


def quat_exp(v: Vector) -> Vector:
    """Return the unit quaternion of axis times half angle (..., 3)."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * v], axis=-1)


def same_hemisphere(q: Vector, reference: Vector) -> Vector:
    """Give q the sign that makes its dot product with the reference at least zero."""
    sign = np.where(np.sum(q * reference, axis=-1, keepdims=True) < 0, -1.0, 1.0)
    result: Vector = q * sign
    return result


def continuous(q: Vector) -> Vector:
    """Choose signs along the first axis so that no neighbours have a negative dot product."""
    dots = np.sum(q[1:] * q[:-1], axis=-1, keepdims=True)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([q[:1], q[1:] * signs])


def slerp_as_given(p: Vector, q: Vector, h: npt.ArrayLike) -> Vector:
    """Turn from p towards q along the arc between the quaternions as given, without a flip.

    p, q (..., 4) and h (...) broadcast; h is not clamped.
    """
    share = np.asarray(h, dtype=np.float64)
    shape = np.broadcast_shapes(p.shape[:-1], q.shape[:-1], share.shape)
    start, end = (np.broadcast_to(x, (*shape, 4)).reshape(-1, 4).copy() for x in (p, q))
    out = np.empty_like(start)
    slerp_rows(start, end, np.broadcast_to(share, shape).reshape(-1).copy(), out)
    return out.reshape(*shape, 4)


def slerp(p: Vector, q: Vector, h: npt.ArrayLike) -> Vector:
    """Turn from p towards q along the shorter arc; h is not clamped.

    Rotations exactly 180° apart have two shorter arcs: the one of the signs given is taken.
    """
    return slerp_as_given(p, same_hemisphere(q, p), h)


def squad_control(before: Vector, key: Vector, after: Vector, share: npt.ArrayLike = 1.0) -> Vector:
    """Return key exp(-(log(key⁻¹ after) + share log(key⁻¹ before)) / 4), Shoemake's control.

    All three in one hemisphere. `share` (...) weighs the neighbour that lies outside the segment
    `key`–`after` by (duration of the segment) / (duration of the other one).
    """
    inverse = quat_conjugate(key)
    outward = quat_log(quat_multiply(inverse, before)) * np.asarray(share)[..., None]
    bend = quat_log(quat_multiply(inverse, after)) + outward
    return quat_multiply(key, quat_exp(-bend / 4))


def check_order(order: str) -> str:
    """Return the axes of Euler angles in upper case, such as ZXY.

    Raises:
        MotionError: not three letters of X, Y, Z with neighbours different.
    """
    axes = order.upper()
    if len(axes) != 3 or set(axes) - set("XYZ") or axes[0] == axes[1] or axes[1] == axes[2]:
        raise MotionError(f"axis order {order!r} is not possible; write three axes such as ZXY")
    return axes


def quat_about(axis: str, angle_rad: Vector) -> Vector:
    """Return rotations (..., 4) about X, Y or Z."""
    q = np.zeros((*np.shape(angle_rad), 4))
    q[..., 0] = np.cos(angle_rad / 2)
    q[..., 1 + "XYZ".index(axis)] = np.sin(angle_rad / 2)
    return q


def quat_from_euler(angles_rad: Vector, order: str) -> Vector:
    """Compose R_a R_b R_c from angles (..., 3) about the axes of `order`, left to right."""
    a, b, c = tuple(check_order(order))
    first = quat_multiply(quat_about(a, angles_rad[..., 0]), quat_about(b, angles_rad[..., 1]))
    return quat_multiply(first, quat_about(c, angles_rad[..., 2]))


def matrix_of_quat(q: Vector) -> Vector:
    """Return rotation matrices (..., 3, 3)."""
    columns = [rotate(q, np.broadcast_to(e, (*q.shape[:-1], 3))) for e in np.eye(3)]
    return np.stack(columns, axis=-1)


def euler_from_quat(q: Vector, order: str) -> Vector:
    """Return angles (..., 3) about three different axes; the middle one within ±90°.

    Where the middle angle is ±90° the third angle is set to zero.
    """
    axes = check_order(order)
    i, j, k = ("XYZ".index(a) for a in axes)
    if i == k:
        raise MotionError(f"axis order {order!r} repeats an axis; write one with three axes")
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    m = matrix_of_quat(q)
    flat = np.hypot(m[..., i, i], m[..., i, j])
    middle = np.arctan2(sign * m[..., i, k], flat)
    is_gimbal_locked = flat < 1e-9
    first = np.where(
        is_gimbal_locked,
        np.arctan2(sign * m[..., k, j], m[..., j, j]),
        np.arctan2(-sign * m[..., j, k], m[..., k, k]),
    )
    third = np.where(is_gimbal_locked, 0.0, np.arctan2(-sign * m[..., i, j], m[..., i, i]))
    return np.stack([first, middle, third], axis=-1)


def quat_between(a: Vector, b: Vector) -> Vector:
    """Return the smallest rotation that takes unit vectors a (..., 3) to b.

    Opposite vectors turn about an axis square to a that is as near to y as there is, or to x.
    """
    cross = np.cross(a, b)
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    near = np.where(np.abs(a[..., 1:2]) < 0.9, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0, 0]))
    square = near - a * np.sum(near * a, axis=-1, keepdims=True)
    square = square / np.linalg.norm(square, axis=-1, keepdims=True)
    opposite = w < 1e-12
    q = np.concatenate([np.where(opposite, 0.0, w), np.where(opposite, square, cross)], axis=-1)
    rotation: Vector = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return rotation


def quat_from_axes(x: Vector, y: Vector, z: Vector) -> Vector:
    """Return the rotation (4,) that takes the coordinate axes to unit vectors x, y, z (3,)."""
    first = quat_between(np.array([1.0, 0.0, 0.0]), x)
    turned_y, turned_z = rotate(first, np.array([0.0, 1.0, 0.0])), rotate(first, np.eye(3)[2])
    about_x = np.arctan2(y @ turned_z, y @ turned_y)
    return quat_multiply(quat_exp(x * about_x / 2), first)


def mirrored_quat(q: Vector, axis: Literal["X", "Y", "Z"] = "X") -> Vector:
    """Reflect rotations across the plane whose normal is the axis."""
    sign = -np.ones(4)
    sign[0] = sign[1 + "XYZ".index(axis)] = 1.0
    result: Vector = q * sign
    return result


def weighted_mean(q: Vector, weights: Vector) -> Vector:
    """Return the rotation nearest to q (n, ..., 4) in the weighted least-squares sense.

    `weights` (n, ...) are at least zero and have a positive sum. Signs of q do not matter; the
    sign of the result is that of the heaviest.
    """
    moment = np.einsum("n...,n...i,n...j->...ij", weights, q, q)
    mean = np.linalg.eigh(moment)[1][..., :, -1]
    heaviest = np.argmax(weights, axis=0)[None, ..., None]
    return same_hemisphere(mean, np.take_along_axis(q, heaviest, axis=0)[0])


def one_way_round(orientation_wxyz: Vector) -> Vector:
    """Return quaternions (n, ..., 4) whose signs do not jump from sample to sample."""
    quaternions = orientation_wxyz.copy()
    flips = (quaternions[1:] * quaternions[:-1]).sum(axis=-1) < 0
    some = flips.any(axis=0)  # mostly none: their signs stay as they are
    signs = np.cumprod(np.where(flips[:, some], -1.0, 1.0), axis=0)
    quaternions[1:, some] *= signs[..., None]
    return quaternions
