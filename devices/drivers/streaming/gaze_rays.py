"""Build rows of canonical gaze from the values of each eye; pure, missing stays NaN."""

import math
import struct
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import GAZE
from visavis.devices.drivers.streaming.screen import NAN, Triple
from visavis.devices.plausible import is_place

NO_VECTOR: Triple = (NAN, NAN, NAN)
MAX_F4 = 3.4e38
MIN_PUPIL_MM, MAX_PUPIL_MM = 0.5, 20.0
"""Far outside the range of pupils (1.5 to 9 mm): other numbers are not diameters."""

_CODES = {"f4": "f", "?": "?", "u1": "B"}
_ROW = struct.Struct("<" + "".join(_CODES[f.dtype] * math.prod(f.shape) for f in GAZE.fields))


class Eye(NamedTuple):
    """One eye in the head frame: a unit ray or NaN, where it starts (m), pupil diameter."""

    ray: Triple = NO_VECTOR
    at: Triple = NO_VECTOR
    valid: bool = False
    pupil_mm: float = NAN


class Sample(NamedTuple):
    """A decoded sample: device time, the device's own counter if any, a row of `GAZE.dtype`, and
    the openness of the left and the right eye if the device measures it.
    """

    t_device_ns: int
    counter: int | None
    row: bytes
    openness_01: tuple[float, float] | None = None


NO_EYE = Eye()


def unit_triple(x: float, y: float, z: float) -> Triple:
    """Scale to length one; NaN if there is no direction."""
    length = math.sqrt(x * x + y * y + z * z) if abs(x) + abs(y) + abs(z) < 1e150 else math.inf
    if not 1e-9 < length < math.inf:
        return NO_VECTOR
    return x / length, y / length, z / length


def diameter_mm(value: float) -> float:
    """Return a pupil diameter; NaN for an impossible one (zero, negative, larger than a pupil)."""
    return value if MIN_PUPIL_MM <= value < MAX_PUPIL_MM else NAN


def gaze_row(
    left: Eye,
    right: Eye,
    *,
    confidence_01: float = NAN,
    ray: Triple | None = None,
    origin: Triple | None = None,
    valid: bool | None = None,
    used_eyes: int | None = None,
) -> bytes:
    """Return one packed row of `GAZE.dtype`.

    Without a combined `ray` of the device's own, it is the mean of the valid eyes' lines, or of
    both (flagged invalid) when neither is valid. `confidence_01` is NaN when the device has none.
    """
    if ray is None:
        ray, mean_at, mean_used = combine(left, right)
        origin = mean_at if origin is None else origin
        used_eyes = mean_used if used_eyes is None else used_eyes
    if valid is None:
        valid = left.valid or right.valid
    valid = valid and ray[0] == ray[0]
    if used_eyes is None:
        used_eyes = (1 if left.valid else 0) | (2 if right.valid else 0)
    at = NO_VECTOR if origin is None else origin
    if at[0] == at[0] and not is_place(*at):
        at, valid = NO_VECTOR, False
    return _ROW.pack(
        *map(_single, (*ray, *at)),
        valid,
        used_eyes,
        _single(confidence_01),
        *left.ray,
        left.valid and left.ray[0] == left.ray[0],
        _single(left.pupil_mm),
        *right.ray,
        right.valid and right.ray[0] == right.ray[0],
        _single(right.pupil_mm),
    )


def combine(left: Eye, right: Eye) -> tuple[Triple, Triple, int]:
    """Return the mean ray of the usable eyes, its origin, and a mask of these eyes."""
    left_seen, right_seen = left.ray[0] == left.ray[0], right.ray[0] == right.ray[0]
    if left_seen and right_seen and left.valid == right.valid:
        (ax, ay, az), (bx, by, bz) = left.ray, right.ray
        (px, py, pz), (qx, qy, qz) = left.at, right.at
        at = ((px + qx) / 2, (py + qy) / 2, (pz + qz) / 2)
        return unit_triple(ax + bx, ay + by, az + bz), at, 3
    if left_seen and (left.valid or not right_seen):
        return left.ray, left.at, 1
    if right_seen:
        return right.ray, right.at, 2
    return NO_VECTOR, NO_VECTOR, 0


def rows_to_values(rows: Iterable[bytes]) -> npt.NDArray[np.void]:
    """Return joined rows as samples, shape (n,), read-only."""
    values: npt.NDArray[np.void] = np.frombuffer(b"".join(rows), GAZE.dtype)
    return values


def ray_between(at: Triple, point: Triple) -> Triple:
    """Return the unit vector from an eye to a point; NaN when either is missing."""
    return unit_triple(point[0] - at[0], point[1] - at[1], point[2] - at[2])


def _single(value: float) -> float:
    return value if -MAX_F4 < value < MAX_F4 else NAN
