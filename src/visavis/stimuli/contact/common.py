"""The common volume of two bodies of capsules, computed quickly along columns, without a mesh.

For studies simulated by the hundred. Recordings are measured with meshes
(`visavis.analysis.collisions`).
"""

from typing import NamedTuple

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.figures import Figures
from visavis.stimuli.contact.idle import place_person, workspace
from visavis.stimuli.contact.touch import pose_capsules, segment_distance

_MAX_SPANS = 64


class Capsules(NamedTuple):
    """A body's capsules: `start_m`, `end_m` (m, 3) from their joints at rest, `radius_m` (m,)."""

    start_m: Vector
    end_m: Vector
    radius_m: Vector


@compiled
def stretch(a: Vector, b: Vector, r: float, x: float, z: float) -> tuple[float, float]:
    """Return where a vertical line is inside a capsule: low and high, low > high when nowhere."""
    low, high = np.inf, -np.inf
    for end in range(2):
        p = a if end == 0 else b
        dx, dz = x - p[0], z - p[2]
        rest = r * r - dx * dx - dz * dz
        if rest > 0.0:
            root = np.sqrt(rest)
            low, high = min(low, p[1] - root), max(high, p[1] + root)
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    uu = ux * ux + uy * uy + uz * uz
    if uu > 0.0:
        wx, wz = x - a[0], z - a[2]
        # points (x, y, z) at distance r from the axis: a quadratic in y - a_y
        flat = wx * ux + wz * uz
        qa = 1.0 - uy * uy / uu
        qb = -2.0 * uy * flat / uu
        qc = wx * wx + wz * wz - flat * flat / uu - r * r
        if qa > 1e-9:
            disc = qb * qb - 4.0 * qa * qc
            if disc > 0.0:
                root = np.sqrt(disc)
                for sign in range(2):
                    y = (-qb - root) / (2 * qa) if sign == 0 else (-qb + root) / (2 * qa)
                    share = (flat + y * uy) / uu
                    if 0.0 <= share <= 1.0:
                        low, high = min(low, a[1] + y), max(high, a[1] + y)
        elif qc < 0.0:
            low, high = min(low, a[1], b[1]), max(high, a[1], b[1])
    return low, high


@compiled
def _merge(lows: Vector, highs: Vector, n: int) -> int:
    """Merge overlapping stretches in place, rising; return how many are left."""
    # Insertion sort: a column meets a handful of capsules, often in order already.
    for i in range(1, n):
        low, high = lows[i], highs[i]
        j = i - 1
        while j >= 0 and lows[j] > low:
            lows[j + 1], highs[j + 1] = lows[j], highs[j]
            j -= 1
        lows[j + 1], highs[j + 1] = low, high
    n_merged = 0
    for i in range(n):
        if n_merged and lows[i] <= highs[n_merged - 1]:
            highs[n_merged - 1] = max(highs[n_merged - 1], highs[i])
        else:
            lows[n_merged], highs[n_merged] = lows[i], highs[i]
            n_merged += 1
    return n_merged


@compiled
def capsules_in_common_m3(
    starts_a: Vector,
    ends_a: Vector,
    radii_a: Vector,
    starts_b: Vector,
    ends_b: Vector,
    radii_b: Vector,
    cell_m: float,
) -> float:
    """Return the common volume of two unions of capsules by vertical columns `cell_m` apart.

    Only pairs of capsules that touch are looked at; parts that overlap count once.
    """
    n_a, n_b = radii_a.shape[0], radii_b.shape[0]
    use_a, use_b = np.zeros(n_a, np.bool_), np.zeros(n_b, np.bool_)
    low_x = low_z = np.inf
    high_x = high_z = -np.inf
    point, low_a, high_a = np.empty(3), np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(n_a):
        for k in range(3):
            low_a[k] = min(low_a[k], min(starts_a[i, k], ends_a[i, k]) - radii_a[i])
            high_a[k] = max(high_a[k], max(starts_a[i, k], ends_a[i, k]) + radii_a[i])
    # Boxes first, then distances: most pairs of a crowd are apart and cost three comparisons. The
    # box round all touching pairs is the region over which columns are laid.
    for j in range(n_b):
        rb = radii_b[j]
        beyond = False
        for k in range(3):
            if (
                min(starts_b[j, k], ends_b[j, k]) - rb >= high_a[k]
                or max(starts_b[j, k], ends_b[j, k]) + rb <= low_a[k]
            ):
                beyond = True
        if beyond:
            continue
        for i in range(n_a):
            ra = radii_a[i]
            is_apart = False
            for k in range(3):
                if (
                    min(starts_a[i, k], ends_a[i, k]) - ra >= max(starts_b[j, k], ends_b[j, k]) + rb
                    or min(starts_b[j, k], ends_b[j, k]) - rb
                    >= max(starts_a[i, k], ends_a[i, k]) + ra
                ):
                    is_apart = True
                    break
            if is_apart:
                continue
            square = segment_distance(starts_a[i], ends_a[i], starts_b[j], ends_b[j], point)
            if square >= (ra + rb) ** 2:
                continue
            use_a[i] = use_b[j] = True
            low_x = min(
                low_x,
                max(min(starts_a[i, 0], ends_a[i, 0]) - ra, min(starts_b[j, 0], ends_b[j, 0]) - rb),
            )
            high_x = max(
                high_x,
                min(max(starts_a[i, 0], ends_a[i, 0]) + ra, max(starts_b[j, 0], ends_b[j, 0]) + rb),
            )
            low_z = min(
                low_z,
                max(min(starts_a[i, 2], ends_a[i, 2]) - ra, min(starts_b[j, 2], ends_b[j, 2]) - rb),
            )
            high_z = max(
                high_z,
                min(max(starts_a[i, 2], ends_a[i, 2]) + ra, max(starts_b[j, 2], ends_b[j, 2]) + rb),
            )
    if not high_x > low_x or not high_z > low_z:
        return 0.0
    # Whole columns that fill the region exactly, none wider than `cell_m`.
    nx = max(int(np.ceil((high_x - low_x) / cell_m)), 1)
    nz = max(int(np.ceil((high_z - low_z) / cell_m)), 1)
    step_x, step_z = (high_x - low_x) / nx, (high_z - low_z) / nz
    al, ah = np.empty(_MAX_SPANS), np.empty(_MAX_SPANS)
    bl, bh = np.empty(_MAX_SPANS), np.empty(_MAX_SPANS)
    length = 0.0
    for ix in range(nx):
        x = low_x + (ix + 0.5) * step_x
        for iz in range(nz):
            z = low_z + (iz + 0.5) * step_z
            na = 0
            for i in range(n_a):
                if use_a[i]:
                    low, high = stretch(starts_a[i], ends_a[i], radii_a[i], x, z)
                    if low < high:
                        al[na], ah[na] = low, high
                        na += 1
            if na == 0:
                continue
            nb = 0
            for j in range(n_b):
                if use_b[j]:
                    low, high = stretch(starts_b[j], ends_b[j], radii_b[j], x, z)
                    if low < high:
                        bl[nb], bh[nb] = low, high
                        nb += 1
            if nb == 0:
                continue
            # Merge before intersecting: where two capsules of one body overlap, the volume counts
            # once.
            na, nb = _merge(al, ah, na), _merge(bl, bh, nb)
            for i in range(na):
                for j in range(nb):
                    overlap_m = min(ah[i], bh[j]) - max(al[i], bl[j])
                    if overlap_m > 0.0:
                        length += overlap_m
    return length * step_x * step_z


@compiled
def volumes_along(
    positions: Vector,
    worlds: Vector,
    crowd_t_s: Vector,
    own: Capsules,
    people: Vector,
    figures: Figures,
    reach_m: float,
    cell_m: float,
    hold_s: float,
    volumes: Vector,
) -> None:
    """Write the common volume (n, people) of a moving body with everybody, step by step.

    `positions` (n, 22, 3) and `worlds` (n, 22, 4); own capsules hang on the same joints as those
    of the figures. Steps with a lost joint are NaN. People are posed anew after `hold_s`; with 0
    at every step.
    """
    columns = figures.columns
    m = columns.shape[0]
    starts, ends = np.empty((m, 3)), np.empty((m, 3))
    n_people = people.shape[0]
    theirs, their_ends = np.empty((n_people, m, 3)), np.empty((n_people, m, 3))
    posed_s = np.full(n_people, -np.inf)
    radii = own.radius_m
    room = workspace()
    for i in range(positions.shape[0]):
        if not np.isfinite(positions[i].sum() + worlds[i].sum()):
            volumes[i] = np.nan
            continue
        pose_capsules(positions[i], worlds[i], columns, own.start_m, own.end_m, 1.0, starts, ends)
        low_x = low_z = np.inf
        high_x = high_z = -np.inf
        for k in range(m):
            low_x = min(low_x, starts[k, 0] - radii[k], ends[k, 0] - radii[k])
            high_x = max(high_x, starts[k, 0] + radii[k], ends[k, 0] + radii[k])
            low_z = min(low_z, starts[k, 2] - radii[k], ends[k, 2] - radii[k])
            high_z = max(high_z, starts[k, 2] + radii[k], ends[k, 2] + radii[k])
        # People whose feet are farther than `reach_m` from the body, seen from above, are not
        # posed.
        for p in range(people.shape[0]):
            volumes[i, p] = 0.0
            dx = max(low_x - people[p, 0], 0.0, people[p, 0] - high_x)
            dz = max(low_z - people[p, 1], 0.0, people[p, 1] - high_z)
            if dx * dx + dz * dz > reach_m * reach_m:
                continue
            who = int(people[p, 15])
            # Posing costs more than the volume; whoever stands and sways is posed anew after
            # `hold_s` only.
            if abs(crowd_t_s[i] - posed_s[p]) > hold_s or hold_s == 0.0:
                posed_s[p] = crowd_t_s[i]
                place_person(people[p], crowd_t_s[i], figures, room)
                pose_capsules(
                    room.position_m[0],
                    room.world[0],
                    columns,
                    figures.start_m[who],
                    figures.end_m[who],
                    1.0,
                    theirs[p],
                    their_ends[p],
                )
            volumes[i, p] = capsules_in_common_m3(
                starts, ends, radii, theirs[p], their_ends[p], figures.radius_m[who], cell_m
            )
