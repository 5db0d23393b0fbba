"""Cubes that touch both of two bodies of capsules: a common volume as voxel counting gives it.

What the rule `published` of `visavis.analysis.collisions` counts on meshes, for studies simulated
by the hundred.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.common import Capsules, stretch
from visavis.stimuli.contact.figures import Figures
from visavis.stimuli.contact.idle import place_person, workspace
from visavis.stimuli.contact.touch import pose_capsules, segment_distance

_HALVINGS: Final = 24
_GOLDEN: Final = 0.6180339887498949


@compiled
def _axis_to_cube_square_m2(a: Vector, b: Vector, centre: Vector, half_m: float) -> float:
    """Return the squared distance of a segment and a cube, by golden section: it is convex."""
    low, high = 0.0, 1.0
    least = np.inf
    for _ in range(_HALVINGS):
        span = high - low
        first, second = high - _GOLDEN * span, low + _GOLDEN * span
        square_1 = square_2 = 0.0
        for k in range(3):
            along = b[k] - a[k]
            off_1 = max(abs(a[k] + first * along - centre[k]) - half_m, 0.0)
            off_2 = max(abs(a[k] + second * along - centre[k]) - half_m, 0.0)
            square_1 += off_1 * off_1
            square_2 += off_2 * off_2
        least = min(least, square_1, square_2)
        if square_1 < square_2:
            high = second
        elif square_2 < square_1:
            low = first
        elif square_1 == 0.0:
            return 0.0
        else:
            low, high = first, second
    return least


@compiled
def _touches(a: Vector, b: Vector, radius_m: float, centre: Vector, half_m: float) -> bool:
    """Tell whether a cube touches a capsule; most are decided by the ball within or around."""
    uu = wu = ww = 0.0
    for k in range(3):
        u, w = b[k] - a[k], centre[k] - a[k]
        uu += u * u
        wu += w * u
        ww += w * w
    t = min(max(wu / uu, 0.0), 1.0) if uu > 0.0 else 0.0
    square = ww - 2.0 * t * wu + t * t * uu
    within, around = radius_m + half_m, radius_m + 1.7320508075688772 * half_m
    if square < within * within:
        return True
    if square >= around * around:
        return False
    return bool(_axis_to_cube_square_m2(a, b, centre, half_m) < radius_m * radius_m)


@compiled
def cubes_touching_capsules(
    starts_a: Vector,
    ends_a: Vector,
    radii_a: Vector,
    starts_b: Vector,
    ends_b: Vector,
    radii_b: Vector,
    cell_m: float,
) -> int:
    """Return how many cubes of the lattice through the origin touch both unions of capsules."""
    # The box that holds every cube near a pair of capsules.
    n_a, n_b = radii_a.shape[0], radii_b.shape[0]
    near = 1.7320508075688772 * cell_m
    half_near = 0.51 * near
    point, centre = np.empty(3), np.empty(3)
    pairs = np.empty((n_a * n_b, 2), np.int64)
    lows, highs = np.empty((n_a * n_b, 3), np.int64), np.empty((n_a * n_b, 3), np.int64)
    first, past = np.empty(3, np.int64), np.empty(3, np.int64)
    n_pairs = 0
    for i in range(n_a):
        for j in range(n_b):
            reach = radii_a[i] + radii_b[j] + near
            is_apart = False
            for k in range(3):
                low = max(
                    min(starts_a[i, k], ends_a[i, k]) - radii_a[i],
                    min(starts_b[j, k], ends_b[j, k]) - radii_b[j],
                )
                high = min(
                    max(starts_a[i, k], ends_a[i, k]) + radii_a[i],
                    max(starts_b[j, k], ends_b[j, k]) + radii_b[j],
                )
                if low > high + near:
                    is_apart = True
                    break
                lows[n_pairs, k] = int(np.floor(min(low, high) / cell_m))
                highs[n_pairs, k] = int(np.floor(max(low, high) / cell_m)) + 1
            if is_apart:
                continue
            square = segment_distance(starts_a[i], ends_a[i], starts_b[j], ends_b[j], point)
            if square >= reach * reach:
                continue
            pairs[n_pairs, 0], pairs[n_pairs, 1] = i, j
            for k in range(3):
                if n_pairs == 0:
                    first[k], past[k] = lows[0, k], highs[0, k]
                first[k] = min(first[k], lows[n_pairs, k])
                past[k] = max(past[k], highs[n_pairs, k])
            n_pairs += 1
    if n_pairs == 0:
        return 0
    # A cube that several pairs touch counts once.
    is_counted = np.zeros((past[0] - first[0], past[1] - first[1], past[2] - first[2]), np.bool_)
    half, count = cell_m / 2, 0
    for n in range(n_pairs):
        i, j = pairs[n]
        for x in range(lows[n, 0], highs[n, 0]):
            for z in range(lows[n, 2], highs[n, 2]):
                centre[0], centre[2] = (x + 0.5) * cell_m, (z + 0.5) * cell_m
                # The centre of a cube that touches is within half its diagonal of the capsule.
                low_a, high_a = stretch(
                    starts_a[i], ends_a[i], radii_a[i] + half_near, centre[0], centre[2]
                )
                low_b, high_b = stretch(
                    starts_b[j], ends_b[j], radii_b[j] + half_near, centre[0], centre[2]
                )
                low, high = max(low_a, low_b), min(high_a, high_b)
                if not low < high:
                    continue
                bottom = max(lows[n, 1], int(np.floor(low / cell_m)))
                top = min(highs[n, 1], int(np.floor(high / cell_m)) + 1)
                for y in range(bottom, top):
                    at = x - first[0], y - first[1], z - first[2]
                    if is_counted[at]:
                        continue
                    centre[1] = (y + 0.5) * cell_m
                    if _touches(starts_a[i], ends_a[i], radii_a[i], centre, half) and _touches(
                        starts_b[j], ends_b[j], radii_b[j], centre, half
                    ):
                        is_counted[at] = True
                        count += 1
    return count


@compiled
def cubes_at(
    positions: Vector,
    worlds: Vector,
    crowd_t_s: Vector,
    own: Capsules,
    people: Vector,
    figures: Figures,
    cell_m: float,
    steps: npt.NDArray[np.int64],
    persons: npt.NDArray[np.int64],
    cubes: npt.NDArray[np.int64],
) -> None:
    """Write how many cubes touch a moving body and a person, (k,), at `steps` with `persons` (k,).

    `positions` (n, 22, 3), `worlds` (n, 22, 4) and `own` as in `volumes_along`.
    """
    columns = figures.columns
    m = columns.shape[0]
    starts, ends, theirs, their_ends = (
        np.empty((m, 3)),
        np.empty((m, 3)),
        np.empty((m, 3)),
        np.empty((m, 3)),
    )
    room = workspace()
    for n in range(steps.shape[0]):
        i, person = steps[n], people[persons[n]]
        pose_capsules(positions[i], worlds[i], columns, own.start_m, own.end_m, 1.0, starts, ends)
        who = int(person[15])
        place_person(person, crowd_t_s[i], figures, room)
        pose_capsules(
            room.position_m[0],
            room.world[0],
            columns,
            figures.start_m[who],
            figures.end_m[who],
            1.0,
            theirs,
            their_ends,
        )
        cubes[n] = cubes_touching_capsules(
            starts, ends, own.radius_m, theirs, their_ends, figures.radius_m[who], cell_m
        )
