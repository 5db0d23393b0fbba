"""Carry rows of posture numbers from a person's own frame to world, and mix them."""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.quaternion_kernels import Triple, triple_of
from visavis.stimuli.motion.rhythm_kernels import ease


@compiled
def _move_point(c: Vector, start: int, place: Triple, cosine: float, sine: float) -> None:
    x, z = c[start], c[start + 2]
    c[start] = place[0] + cosine * x + sine * z
    c[start + 1] += place[1]
    c[start + 2] = place[2] - sine * x + cosine * z


@compiled
def put_at(c: Vector, place_m: Triple, heading_rad: float) -> None:
    """Move one row (SIZE,), as `placed_rows` does."""
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    # Hips and feet are places in world; all else turns with the hips.
    _move_point(c, p.HIPS, place_m, cosine, sine)
    c[p.HIPS_YAW] += heading_rad
    c[p.FRONT] += heading_rad
    for side in range(2):
        start = p.LEG + side * p.LEG_SIZE
        _move_point(c, start + p.ANKLE, place_m, cosine, sine)
        c[start + p.FOOT_YAW] += heading_rad


@compiled
def placed_rows(controls: Vector, place_m: Vector, heading_rad: Vector) -> None:
    """Move rows (n, SIZE) to places (n, 3) on the floor and headings (n,), left of −z."""
    for r in range(controls.shape[0]):
        put_at(controls[r], triple_of(place_m[r]), heading_rad[r])


@compiled
def mix_rows(controls: Vector, rows: npt.NDArray[np.int64], other: Vector, share: Vector) -> None:
    """Lead `other` (k, SIZE) over into the rows (k,) of `controls`, `share` (k,) from 0 to 1.

    Feet that have to go elsewhere step there, the left one first.
    """
    for i in range(rows.shape[0]):
        c, before, s = controls[rows[i]], other[i], ease(share[i])
        lifts, shares = np.zeros(2), np.full(2, s)
        for side in range(2):
            foot = p.LEG + side * p.LEG_SIZE
            way = 0.0
            for k in range(3):
                way += (c[foot + k] - before[foot + k]) ** 2
            way = np.sqrt(way) + 0.1 * abs(c[foot + p.FOOT_YAW] - before[foot + p.FOOT_YAW])
            # Steps of less than a centimetre are none; the rule sets in smoothly.
            steps = ease(way / 0.03)
            own = ease(1.9 * share[i] - 0.9 * side)
            shares[side] = (1.0 - steps) * s + steps * own
            lifts[side] = steps * 16.0 * (own * (1.0 - own)) ** 2 * min(0.10, 0.02 + 0.15 * way)
        for j in range(c.shape[0]):
            h = s
            if p.LEG <= j < p.LEG + 2 * p.LEG_SIZE:
                h = shares[(j - p.LEG) // p.LEG_SIZE]
            c[j] = (1.0 - h) * before[j] + h * c[j]
        for side in range(2):
            c[p.LEG + side * p.LEG_SIZE + p.ANKLE + 1] += lifts[side]
            # A hand that goes to another place of the same thing has two holds meanwhile: mixed
            # directions would nearly cancel out, and turn it over at once.
            for hold in range(p.HOLDS):
                a = p.ARM + side * p.ARM_SIZE + p.HOLD + hold * p.HOLD_SIZE
                if before[a] > 0.0 and c[a] > (1.0 - s) * before[a]:
                    earlier = a + p.HOLDS * p.HOLD_SIZE
                    for k in range(p.HOLD_SIZE):
                        c[earlier + k] = (1.0 - s) * before[a + k]
                        c[a + k] -= c[earlier + k]
