"""Which people a tracked participant's capsules touch, per sample, fast enough for every frame.

A circle and a box leave the few people who stand near. Of those, only who may have moved into a
capsule since last posed is posed anew and compared, capsule by capsule.
"""

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.body import CAPSULE_JOINTS
from visavis.stimuli.contact.figures import Figures, crowd_figures
from visavis.stimuli.contact.idle import N_PERSON, Workspace, people_of, place_person, workspace
from visavis.stimuli.motion.quaternion_kernels import Triple, triple_of
from visavis.stimuli.scenes.station_crowd import Crowd

REACH_M: Final = 0.58
"""No part of an idle person is farther than this from where they stand (a telephoning elbow)."""
NEARER_WAITING_M: Final = 0.06
"""How much less far the parts of a waiting person reach, whose arms hang."""
FRONT_M: Final = 0.42
BACK_M: Final = 0.19
ASIDE_M: Final = 0.45
ELBOW_BACK_M: Final = 0.34
ELBOW_ASIDE_M: Final = 0.57
"""Largest reach to the front, back and sides; people on the phone lift an elbow. Some 3 cm beyond
what 4,800 seeds of twelve people reached within a quarter of an hour.
"""
MAX_TOUCHES: Final = 64
WAITING_M_S: Final = 0.5
TELEPHONING_M_S: Final = 2.0
"""No part of an idle person moves faster than this; three thousand seeds of twelve people reached
0.22 and 0.92 m/s."""


Lasting = tuple[Vector, tuple[Vector, ...], tuple[npt.NDArray[Any], ...], Vector]
"""What every call for one crowd takes: people, last poses, figures, room for touches. In plain
tuples, because numba takes longer to look through named ones than to test six arms.
"""


class LastPoses(NamedTuple):
    """The capsules of n people as they were last posed: when (n,), and both ends (n, 2, 19, 3)."""

    t_s: Vector
    ends_m: Vector


def no_poses(n: int) -> LastPoses:
    """Return room for the poses of n people of whom none is posed yet."""
    return LastPoses(np.full(n, np.inf), np.zeros((n, 2, len(CAPSULE_JOINTS), 3)))


class Touch(NamedTuple):
    """One of the participant's capsules inside a person at an instant.

    `part` indexes the participant's capsules, `person` the crowd, `person_part` the person's
    capsules where it is deepest; `depth_m` how far the surfaces have passed each other;
    `point_m` (3,) the middle of the shortest way between the two axes.
    """

    part: int
    person: int
    person_part: int
    depth_m: float
    point_m: tuple[float, float, float]


@compiled
def segment_distance(a: Vector, b: Vector, c: Vector, d: Vector, point: Vector) -> float:
    """Return the squared distance of segments a–b and c–d; write the middle of the way between.

    After Ericson 2005 (clamped closest points); exact for points and parallel segments.
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    rx, ry, rz = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    vr = vx * rx + vy * ry + vz * rz
    s = t = 0.0
    tiny = 1e-18
    if uu <= tiny and vv <= tiny:
        s = t = 0.0
    elif uu <= tiny:
        t = min(max(vr / vv, 0.0), 1.0)
    else:
        ur = ux * rx + uy * ry + uz * rz
        if vv <= tiny:
            s = min(max(-ur / uu, 0.0), 1.0)
        else:
            uv = ux * vx + uy * vy + uz * vz
            denominator = uu * vv - uv * uv
            # Parallel segments have no single nearest pair; s stays 0 and t follows from it.
            if denominator > 1e-12 * uu * vv:
                s = min(max((uv * vr - ur * vv) / denominator, 0.0), 1.0)
            t = (uv * s + vr) / vv
            # t outside its segment: clamp it and find the nearest s for that end.
            if t < 0.0:
                t = 0.0
                s = min(max(-ur / uu, 0.0), 1.0)
            elif t > 1.0:
                t = 1.0
                s = min(max((uv - ur) / uu, 0.0), 1.0)
    px, py, pz = a[0] + s * ux, a[1] + s * uy, a[2] + s * uz
    qx, qy, qz = c[0] + t * vx, c[1] + t * vy, c[2] + t * vz
    point[0], point[1], point[2] = (px + qx) / 2, (py + qy) / 2, (pz + qz) / 2
    square: float = (px - qx) ** 2 + (py - qy) ** 2 + (pz - qz) ** 2
    return square


@compiled
def pose_capsules(
    position: Vector,
    world: Vector,
    columns: npt.NDArray[np.int64],
    start_m: Vector,
    end_m: Vector,
    scale: float,
    starts: Vector,
    ends: Vector,
) -> None:
    """Write capsules (m, 3) of one body posed at joints (22, 3) and (22, 4)."""
    for k in range(columns.shape[0]):
        j = columns[k]
        w, x, y, z = world[j, 0], world[j, 1], world[j, 2], world[j, 3]
        for end in range(2):
            if end == 0:
                vx, vy, vz = scale * start_m[k, 0], scale * start_m[k, 1], scale * start_m[k, 2]
            else:
                vx, vy, vz = scale * end_m[k, 0], scale * end_m[k, 1], scale * end_m[k, 2]
            # Rotate by the joint's unit quaternion: v + w t + q × t with t = 2 q × v.
            tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
            rx = position[j, 0] + vx + w * tx + y * tz - z * ty
            ry = position[j, 1] + vy + w * ty + z * tx - x * tz
            rz = position[j, 2] + vz + w * tz + x * ty - y * tx
            if end == 0:
                starts[k, 0], starts[k, 1], starts[k, 2] = rx, ry, rz
            else:
                ends[k, 0], ends[k, 1], ends[k, 2] = rx, ry, rz


@compiled
def _any_near(starts: Vector, ends: Vector, radii: Vector, person: Vector, reach_m: float) -> bool:
    """Return whether any part comes, seen from above, within reach of a person's place and overlaps
    the box that the person fills.
    """
    cos, sin = np.cos(person[2]), np.sin(person[2])
    aside_m, back_m = (ELBOW_ASIDE_M, ELBOW_BACK_M) if person[4] > 0.5 else (ASIDE_M, BACK_M)
    for k in range(starts.shape[0]):
        ux, uz = ends[k, 0] - starts[k, 0], ends[k, 2] - starts[k, 2]
        px, pz = person[0] - starts[k, 0], person[1] - starts[k, 2]
        along = ux * ux + uz * uz
        t = min(max((px * ux + pz * uz) / along, 0.0), 1.0) if along > 0.0 else 0.0
        dx, dz = px - t * ux, pz - t * uz
        far = reach_m + radii[k]
        if not dx * dx + dz * dz <= far * far:
            continue
        # Both ends in the person's own axes, against the box that the person fills.
        x0, x1 = sin * pz - cos * px, sin * (pz - uz) - cos * (px - ux)
        z0, z1 = -sin * px - cos * pz, -sin * (px - ux) - cos * (pz - uz)
        if min(x0, x1) - radii[k] > aside_m or max(x0, x1) + radii[k] < -aside_m:
            continue
        if min(z0, z1) - radii[k] > back_m or max(z0, z1) + radii[k] < -FRONT_M:
            continue
        return True
    return False


@compiled
def _box_of(starts: Vector, ends: Vector, radii: Vector) -> tuple[Triple, Triple]:
    """Return the corners of the box about capsules; those with a NaN are left out."""
    low_x = low_y = low_z = np.inf
    high_x = high_y = high_z = -np.inf
    for k in range(starts.shape[0]):
        (ax, ay, az), (bx, by, bz), r = triple_of(starts[k]), triple_of(ends[k]), radii[k]
        if not np.isfinite(ax + ay + az + bx + by + bz):
            continue
        low_x, high_x = min(low_x, ax - r, bx - r), max(high_x, ax + r, bx + r)
        low_y, high_y = min(low_y, ay - r, by - r), max(high_y, ay + r, by + r)
        low_z, high_z = min(low_z, az - r, bz - r), max(high_z, az + r, bz + r)
    return (low_x, low_y, low_z), (high_x, high_y, high_z)


@compiled
def _capsules_in(
    low: Triple,
    high: Triple,
    beyond_m: float,
    starts: Vector,
    ends: Vector,
    radii: Vector,
    which: npt.NDArray[np.int64],
) -> int:
    """Write which capsules' boxes come within `beyond_m` of a box; return how many."""
    n = 0
    for c in range(starts.shape[0]):
        r = radii[c] + beyond_m
        # Without branches, which nothing could predict here.
        if (
            (max(starts[c, 0], ends[c, 0]) + r >= low[0])
            & (min(starts[c, 0], ends[c, 0]) - r <= high[0])
            & (max(starts[c, 1], ends[c, 1]) + r >= low[1])
            & (min(starts[c, 1], ends[c, 1]) - r <= high[1])
            & (max(starts[c, 2], ends[c, 2]) + r >= low[2])
            & (min(starts[c, 2], ends[c, 2]) - r <= high[2])
        ):
            which[n] = c
            n += 1
    return n


@compiled
def _is_apart(a: Vector, b: Vector, c: Vector, d: Vector, r: float) -> bool:
    """Return whether the boxes of segments a–b and c–d are farther apart than r along an axis."""
    return bool(
        (max(a[0], b[0]) < min(c[0], d[0]) - r)
        | (min(a[0], b[0]) > max(c[0], d[0]) + r)
        | (max(a[1], b[1]) < min(c[1], d[1]) - r)
        | (min(a[1], b[1]) > max(c[1], d[1]) + r)
        | (max(a[2], b[2]) < min(c[2], d[2]) - r)
        | (min(a[2], b[2]) > max(c[2], d[2]) + r)
    )


@compiled
def pose_person(
    who: Vector,
    t_s: float,
    figures: Figures,
    room: Workspace,
    starts: Vector,
    ends: Vector,
) -> None:
    """Write the ends (capsules, 3) of a person's capsules at a time.

    `who` is a row of `idle.people_of`.
    """
    place_person(who, t_s, figures, room)
    person = int(who[15])
    starts_m, ends_m = figures.start_m[person], figures.end_m[person]
    position_m, world = room.position_m[0], room.world[0]
    pose_capsules(position_m, world, figures.columns, starts_m, ends_m, 1.0, starts, ends)


@compiled
def find_touches(
    part_starts: Vector,
    part_ends: Vector,
    part_radii: Vector,
    people: Vector,
    last: LastPoses,
    t_s: float,
    figures: Figures,
    touch_rows: Vector,
) -> int:
    """Write touches (k, 7) as the numbers of a `Touch` in their order; return how many.

    `people` as `idle.people_of`; who is posed is written to `last`. One touch per part and person,
    where it is deepest. Parts with a NaN touch nothing.
    """
    n_parts, n_capsules = part_starts.shape[0], figures.columns.shape[0]
    low, high = _box_of(part_starts, part_ends, part_radii)
    room, point, near = workspace(), np.empty(3), np.empty(n_capsules, np.int64)
    n_touches = 0
    for i in range(people.shape[0]):
        # Three cheap tests before somebody is posed: the box of all parts, along one axis first,
        # part by part against the box of the person, and against the last pose.
        dx = max(low[0] - people[i, 0], people[i, 0] - high[0])
        if dx > REACH_M:
            continue
        dx, dz = max(dx, 0.0), max(low[2] - people[i, 1], 0.0, people[i, 1] - high[2])
        telephones = people[i, 4] > 0.5
        reach = REACH_M if telephones else REACH_M - NEARER_WAITING_M
        if not dx * dx + dz * dz <= reach * reach:
            continue
        if not _any_near(part_starts, part_ends, part_radii, people[i], reach):
            continue
        person = int(people[i, 15])
        starts, ends = last.ends_m[i, 0], last.ends_m[i, 1]
        radius = figures.radius_m[person]
        speed_m_s = TELEPHONING_M_S if telephones else WAITING_M_S
        moved_m = speed_m_s * abs(t_s - last.t_s[i])
        n_near = _capsules_in(low, high, moved_m, starts, ends, radius, near)
        may_touch = False
        for k in range(n_parts):
            for c in near[:n_near]:
                r = part_radii[k] + radius[c] + moved_m
                if _is_apart(part_starts[k], part_ends[k], starts[c], ends[c], r):
                    continue
                square = segment_distance(part_starts[k], part_ends[k], starts[c], ends[c], point)
                if square < r * r:
                    may_touch = True
                    break
            if may_touch:
                break
        if not may_touch:
            continue
        pose_person(people[i], t_s, figures, room, starts, ends)
        last.t_s[i] = t_s
        n_near = _capsules_in(low, high, 0.0, starts, ends, radius, near)
        for k in range(n_parts):
            # Of one part and one person only the deepest pair of capsules is a touch.
            deepest = 0.0
            at = -1
            for c in near[:n_near]:
                r = part_radii[k] + radius[c]
                if _is_apart(part_starts[k], part_ends[k], starts[c], ends[c], r):
                    continue
                square = segment_distance(part_starts[k], part_ends[k], starts[c], ends[c], point)
                if square < r * r:
                    depth = r - np.sqrt(square)
                    if depth > deepest:
                        deepest, at = depth, c
                        if n_touches < touch_rows.shape[0]:
                            touch_rows[n_touches, 4:] = point
            if at >= 0 and n_touches < touch_rows.shape[0]:
                touch_rows[n_touches, 0], touch_rows[n_touches, 1], touch_rows[n_touches, 2] = (
                    k,
                    i,
                    at,
                )
                touch_rows[n_touches, 3] = deepest
                n_touches += 1
    return n_touches


@compiled
def rows_touching(
    positions: Vector,
    worlds: Vector,
    crowd_t_s: Vector,
    columns: npt.NDArray[np.int64],
    start_m: Vector,
    end_m: Vector,
    radius_m: Vector,
    people: Vector,
    last: LastPoses,
    figures: Figures,
) -> int:
    """Return at how many steps of a moving body, (n, 22, 3) and (n, 22, 4), it touches anybody.

    `people` and `last` as in `find_touches`.
    """
    m = columns.shape[0]
    starts, ends = np.empty((m, 3)), np.empty((m, 3))
    touch_rows = np.empty((1, 7))
    touching = 0
    for i in range(positions.shape[0]):
        pose_capsules(positions[i], worlds[i], columns, start_m, end_m, 1.0, starts, ends)
        n_touches = find_touches(
            starts, ends, radius_m, people, last, crowd_t_s[i], figures, touch_rows
        )
        # Room for one touch is enough: only whether there is any counts.
        touching += n_touches > 0
    return touching


def touches_of(touch_rows: Vector) -> tuple[Touch, ...]:
    """Return rows (n, 7) that `find_touches` wrote as touches."""
    return tuple(
        [
            Touch(int(part), int(person), int(person_part), depth_m, (x, y, z))
            for part, person, person_part, depth_m, x, y, z in touch_rows.tolist()
        ]
    )


@compiled
def _find_touches_of(
    part_starts: Vector, part_ends: Vector, part_radii: Vector, t_s: float, lasting: Lasting
) -> int:
    """Write touches, as `find_touches` does."""
    people, last, figures, touch_rows = lasting
    return find_touches(
        part_starts,
        part_ends,
        part_radii,
        people,
        LastPoses(*last),
        t_s,
        Figures(*figures),
        touch_rows,
    )


class TouchSensor:
    """Compare capsules of a participant with a crowd, sample by sample."""

    def __init__(self, crowd: Crowd) -> None:
        people = people_of(crowd) if len(crowd) else np.empty((0, N_PERSON))
        self._found = np.empty((MAX_TOUCHES, 7))
        self._lasting = people, tuple(no_poses(len(people))), tuple(crowd_figures()), self._found

    def touches(
        self, starts_m: Vector, ends_m: Vector, radii_m: Vector, crowd_t_s: float
    ) -> tuple[Touch, ...]:
        """Return what capsules (m, 3) touch at a time of the crowd, by person, then part."""
        n = self.count(starts_m, ends_m, radii_m, crowd_t_s)
        if not n:
            return ()
        return touches_of(self._found[:n])

    def count(self, starts_m: Vector, ends_m: Vector, radii_m: Vector, crowd_t_s: float) -> int:
        """Return how many touches there are, without describing them."""
        return _find_touches_of(starts_m, ends_m, radii_m, crowd_t_s, self._lasting)
