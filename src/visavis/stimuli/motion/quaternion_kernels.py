"""Quaternions and two-bone limbs as compiled scalars, for kernels that pose one person at a time.

Nothing here allocates: a rotation is a tuple (w, x, y, z), a vector a tuple (x, y, z).
"""

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Quat = tuple[float, float, float, float]
Triple = tuple[float, float, float]

NEARLY_STRAIGHT = 0.996
"""Beyond this share of its length a limb is stretched more and more reluctantly."""


@compiled
def triple_of(row: Vector) -> Triple:
    """Return a row (3,) as a vector."""
    return row[0], row[1], row[2]


@compiled
def quat_of(row: Vector) -> Quat:
    """Return a row (4,) as a rotation."""
    return row[0], row[1], row[2], row[3]


@compiled
def about_x(angle: float) -> Quat:
    """Turn about x by an angle in radians."""
    return np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0


@compiled
def about_y(angle: float) -> Quat:
    """Turn about y by an angle in radians."""
    return np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0


@compiled
def about_z(angle: float) -> Quat:
    """Turn about z by an angle in radians."""
    return np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)


@compiled
def about(axis: Triple, angle: float) -> Quat:
    """Turn about a unit axis."""
    s = np.sin(0.5 * angle)
    return np.cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]


@compiled
def times(a: Quat, b: Quat) -> Quat:
    """Compose two rotations: first b, then a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@compiled
def inverse(q: Quat) -> Quat:
    """Invert a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@compiled
def rotate_vector(q: Quat, v: Triple) -> Triple:
    """Rotate a vector."""
    tx = 2.0 * (q[2] * v[2] - q[3] * v[1])
    ty = 2.0 * (q[3] * v[0] - q[1] * v[2])
    tz = 2.0 * (q[1] * v[1] - q[2] * v[0])
    return (
        v[0] + q[0] * tx + q[2] * tz - q[3] * ty,
        v[1] + q[0] * ty + q[3] * tx - q[1] * tz,
        v[2] + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@compiled
def plus(a: Triple, b: Triple) -> Triple:
    """Add vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def minus(a: Triple, b: Triple) -> Triple:
    """Subtract vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def scale_vector(a: Triple, factor: float) -> Triple:
    """Multiply a vector by a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@compiled
def dot(a: Triple, b: Triple) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Triple, b: Triple) -> Triple:
    """Return the vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def unit_of(a: Triple, otherwise: Triple) -> Triple:
    """Scale to length one; a vector of no length becomes `otherwise`."""
    length = np.sqrt(dot(a, a))
    if length < 1e-9:
        return otherwise
    return a[0] / length, a[1] / length, a[2] / length


@compiled
def square_to(a: Triple, axis: Triple, otherwise: Triple) -> Triple:
    """Return the unit direction of a without its part along a unit axis."""
    return unit_of(minus(a, scale_vector(axis, dot(a, axis))), otherwise)


@compiled
def of_axes(x: Triple, y: Triple, z: Triple) -> Quat:
    """Return the rotation that takes the coordinate axes to three orthonormal vectors."""
    # Divide by the largest of the four numbers: near half a turn w is about 0.
    trace = x[0] + y[1] + z[2]
    if trace > 0.0:
        s = 2.0 * np.sqrt(trace + 1.0)
        return 0.25 * s, (y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s
    if x[0] >= y[1] and x[0] >= z[2]:
        s = 2.0 * np.sqrt(1.0 + x[0] - y[1] - z[2])
        return (y[2] - z[1]) / s, 0.25 * s, (y[0] + x[1]) / s, (z[0] + x[2]) / s
    if y[1] >= z[2]:
        s = 2.0 * np.sqrt(1.0 + y[1] - x[0] - z[2])
        return (z[0] - x[2]) / s, (y[0] + x[1]) / s, 0.25 * s, (z[1] + y[2]) / s
    s = 2.0 * np.sqrt(1.0 + z[2] - x[0] - y[1])
    return (x[1] - y[0]) / s, (z[0] + x[2]) / s, (z[1] + y[2]) / s, 0.25 * s


@compiled
def write_matrix(q: Quat, m: Vector) -> None:
    """Write a rotation as a matrix into the first three columns of m (3, 3 or more)."""
    w, x, y, z = q
    m[0, 0], m[0, 1], m[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@compiled
def frame_to_frame(a: Triple, a_side: Triple, b: Triple, b_side: Triple) -> Quat:
    """Return the rotation that takes unit a to b and its square companion a_side to b_side."""
    first = of_axes(a, a_side, cross(a, a_side))
    second = of_axes(b, b_side, cross(b, b_side))
    return times(second, inverse(first))


@compiled
def between(a: Triple, b: Triple) -> Quat:
    """Return the smallest rotation that takes unit a to unit b; opposite ones turn about x."""
    # Half the angle without trigonometry: (1 + a·b, a × b), scaled to length 1.
    w = 1.0 + dot(a, b)
    if w < 1e-9:
        return 0.0, 1.0, 0.0, 0.0
    c = cross(a, b)
    n = np.sqrt(w * w + dot(c, c))
    return w / n, c[0] / n, c[1] / n, c[2] / n


@compiled
def mirror_quat(q: Quat) -> Quat:
    """Reflect a rotation across the plane between left and right."""
    return q[0], q[1], -q[2], -q[3]


@compiled
def mix_quats(a: Quat, b: Quat, share: float) -> Quat:
    """Blend rotations less than 180° apart: share 0 gives a, 1 gives b."""
    sign = 1.0 if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] >= 0.0 else -1.0
    u, v = 1.0 - share, sign * share
    w, x, y, z = u * a[0] + v * b[0], u * a[1] + v * b[1], u * a[2] + v * b[2], u * a[3] + v * b[3]
    n = np.sqrt(w * w + x * x + y * y + z * z)
    return w / n, x / n, y / n, z / n


@compiled
def bend_for(upper: Triple, lower: Triple, hinge: Triple, reach: float, most_rad: float) -> float:
    """Return how far a hinge must bend so that two bones span a distance.

    `upper`, `lower` are the bones at rest, `hinge` the unit axis at their joint. Distances near
    full length are approached and never reached, so the bend has no kink.
    """
    along = dot(upper, hinge) * dot(lower, hinge)
    sideways = cross(hinge, lower)
    a, b = dot(upper, lower) - along, dot(upper, sideways)
    size = np.sqrt(a * a + b * b)
    both = dot(upper, upper) + dot(lower, lower) + 2.0 * along
    longest = np.sqrt(both + 2.0 * size)
    soft = NEARLY_STRAIGHT * longest
    if reach > soft:
        rest = longest - soft
        reach = soft + rest * (1.0 - np.exp(-(reach - soft) / rest))
    # Law of cosines for two bones about the hinge.
    cosine = (reach * reach - both) / (2.0 * size)
    bend = np.arctan2(b, a) + np.arccos(min(1.0, max(-1.0, cosine)))
    return float(min(most_rad, bend))


@compiled
def limb_turn(
    upper: Triple, lower: Triple, hinge: Triple, bend: float, target: Triple, pole: Triple
) -> Quat:
    """Return the turn of the upper bone that points the bent limb at a target.

    `target` leads from the limb's root; the middle joint goes to the side of `pole`.
    """
    # Bend the limb at rest, then lead its end and hinge to the target and the pole's side.
    end = plus(upper, rotate_vector(about(hinge, bend), lower))
    rest = unit_of(end, upper)
    rest_hinge = square_to(hinge, rest, hinge)
    to = unit_of(target, rest)
    hinge_to = unit_of(cross(pole, to), rest_hinge)
    return frame_to_frame(rest, rest_hinge, to, hinge_to)


@compiled
def twist_about(q: Quat, axis: Triple) -> float:
    """Return the angle of the part of a rotation that turns about a unit axis, within ±180°."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    along = sign * (q[1] * axis[0] + q[2] * axis[1] + q[3] * axis[2])
    return float(2.0 * np.arctan2(along, abs(q[0])))
