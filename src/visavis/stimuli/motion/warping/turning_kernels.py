"""Turn joints by rotation vectors and hold them within their limits, many poses at a time.

The angles are those of `visavis.stimuli.motion.joint_limits`: a twist about the bone, then a swing
square to it, written as for the left side.
"""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Quat = tuple[float, float, float, float]
Index = npt.NDArray[np.int64]


@compiled
def _times(a: Quat, b: Quat) -> Quat:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@compiled
def _turn(x: float, y: float, z: float) -> Quat:
    """Return the turn of a rotation vector."""
    angle = np.sqrt(x * x + y * y + z * z)
    share = 0.5 if angle < 1e-12 else np.sin(angle / 2) / angle
    return np.cos(angle / 2), share * x, share * y, share * z


@compiled
def _rotation_vector(q: Quat) -> tuple[float, float, float]:
    """Return the shorter rotation vector of a turn."""
    w, x, y, z = q
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    share = 2.0 if sine < 1e-12 else 2 * np.arctan2(sine, w) / sine
    return share * x, share * y, share * z


@compiled
def _limit(q: Quat, low: Vector, high: Vector, bone: int, is_right: bool) -> Quat:
    """Return a turn within its limits; one that is within them as it is."""
    side = -1.0 if is_right else 1.0
    w, x, y, z = q[0], q[1], side * q[2], side * q[3]
    # Swing and twist: split the turn into one about the bone and the rest, limit each.
    half = np.arctan2(x if bone == 0 else y, w)
    half = (half + np.pi / 2) % np.pi - np.pi / 2
    s = np.sin(half)
    back = (np.cos(half), -s if bone == 0 else 0.0, 0.0 if bone == 0 else -s, 0.0)
    vx, vy, vz = _rotation_vector(_times((w, x, y, z), back))
    if bone == 0:
        vx += 2 * half
    else:
        vy += 2 * half
    hx = min(max(vx, np.radians(low[0])), np.radians(high[0]))
    hy = min(max(vy, np.radians(low[1])), np.radians(high[1]))
    hz = min(max(vz, np.radians(low[2])), np.radians(high[2]))
    if hx == vx and hy == vy and hz == vz:
        return q
    if bone == 0:
        twist, swing = _turn(hx, 0.0, 0.0), _turn(0.0, hy, hz)
    else:
        twist, swing = _turn(0.0, hy, 0.0), _turn(hx, 0.0, hz)
    w, x, y, z = _times(swing, twist)
    return w, x, side * y, side * z


@compiled
def turn_joints(
    local: Vector,
    omega: Vector,
    joints: Index,
    turning: Vector,
    low: Vector,
    high: Vector,
    bone: Index,
    right: npt.NDArray[np.bool_],
    is_limited: bool,
    out: Vector,
) -> None:
    """Turn joints (m,) of a pose (j, 4) by n rows of offsets (n, w) into out (n, j, 4).

    `turning` (w, m, 3) is the rotation vector per radian of an offset, `low` and `high` (m, 3)
    limits in degrees, `bone` (m,) the axis of the bone. Joints that get no turn are left alone.
    """
    for n in range(omega.shape[0]):
        for m in range(joints.shape[0]):
            # Rotation vectors of several offsets add, so that their order does not matter.
            x = y = z = 0.0
            for k in range(omega.shape[1]):
                x += omega[n, k] * turning[k, m, 0]
                y += omega[n, k] * turning[k, m, 1]
                z += omega[n, k] * turning[k, m, 2]
            if x == 0.0 and y == 0.0 and z == 0.0:
                continue
            j = joints[m]
            q = _times((local[j, 0], local[j, 1], local[j, 2], local[j, 3]), _turn(x, y, z))
            if is_limited:
                q = _limit(q, low[m], high[m], bone[m], right[m])
            out[n, j, 0], out[n, j, 1], out[n, j, 2], out[n, j, 3] = q
