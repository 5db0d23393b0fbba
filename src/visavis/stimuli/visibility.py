"""Geometry of a gaze ray in a scene: angles to heads, their visible size, the first surface hit.

Heads are spheres, bodies and furniture capsules. The rule of the area of interest itself (which
angle counts as a look) is analysis' business; here is only the geometry it needs.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.moving_heads import MovingHeads, moving_heads
from visavis.stimuli.room_areas import RoomAreas
from visavis.stimuli.room_shape import areas_of_room
from visavis.stimuli.scene import Scene

HIT_NOTHING = -1
HIT_LOST = -2
BESIDE_DEG: Final = 10.0
"""How far beside a head it is asked whether a room's mesh is before it; no pad is usually more."""

Observation = tuple[
    npt.NDArray[np.float64],
    npt.NDArray[np.float64],
    npt.NDArray[np.float64],
    npt.NDArray[np.int16],
]


@compiled
def _sphere_entry_m(
    ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, radius: float
) -> float:
    """Return the distance along a unit ray to a sphere at −(ox, oy, oz); 0 inside, inf missed."""
    c = ox * ox + oy * oy + oz * oz - radius * radius
    if c <= 0.0:
        return 0.0
    b = ox * dx + oy * dy + oz * dz
    if b >= 0.0:
        return np.inf
    # The perpendicular offset keeps precision that b² − c loses for distant small spheres.
    px, py, pz = ox - b * dx, oy - b * dy, oz - b * dz
    h = radius * radius - (px * px + py * py + pz * pz)
    if h < 0.0:
        return np.inf
    return float(c / (-b + np.sqrt(h)))


@compiled
def capsule_entry_m(
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    capsule: npt.NDArray[np.float64],
) -> float:
    """Return the distance along a unit ray to a capsule; 0 inside, inf missed."""
    ax, ay, az = capsule[3] - capsule[0], capsule[4] - capsule[1], capsule[5] - capsule[2]
    radius = capsule[6]
    sx, sy, sz = ox - capsule[0], oy - capsule[1], oz - capsule[2]
    first = _sphere_entry_m(sx, sy, sz, dx, dy, dz, radius)
    ex, ey, ez = ox - capsule[3], oy - capsule[4], oz - capsule[5]
    first = min(first, _sphere_entry_m(ex, ey, ez, dx, dy, dz, radius))
    length2 = ax * ax + ay * ay + az * az
    if length2 == 0.0:
        return first
    ad = (ax * dx + ay * dy + az * dz) / length2
    as_ = (ax * sx + ay * sy + az * sz) / length2
    # Drop the components along the axis: a circle in the plane across it.
    ux, uy, uz = dx - ad * ax, dy - ad * ay, dz - ad * az
    wx, wy, wz = sx - as_ * ax, sy - as_ * ay, sz - as_ * az
    a = ux * ux + uy * uy + uz * uz
    c = wx * wx + wy * wy + wz * wz - radius * radius
    if c <= 0.0 and 0.0 <= as_ <= 1.0:
        return 0.0
    if a < 1e-18:
        return first
    b = ux * wx + uy * wy + uz * wz
    h = b * b - a * c
    if h < 0.0:
        return first
    t = (-b - np.sqrt(h)) / a
    if t >= 0.0 and 0.0 <= as_ + t * ad <= 1.0:
        first = min(first, t)
    return first


@compiled
def _angle_rad(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> float:  # of unit vectors
    chord2 = (ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2
    sum2 = (ax + bx) ** 2 + (ay + by) ** 2 + (az + bz) ** 2
    return float(2.0 * np.arctan2(np.sqrt(chord2), np.sqrt(sum2)))


@compiled
def _see_heads(
    ox: float,
    oy: float,
    oz: float,
    heads: npt.NDArray[np.float64],
    views: npt.NDArray[np.float64],
    radius_deg: npt.NDArray[np.float64],
    pad_limit_deg: npt.NDArray[np.float64],
) -> None:
    """Fill sizes and half gaps as seen from a point; `views` (m, 5) holds direction,
    radius and gap.
    """
    m = heads.shape[0]
    for j in range(m):
        x, y, z = heads[j, 0] - ox, heads[j, 1] - oy, heads[j, 2] - oz
        r = heads[j, 3]
        d2 = x * x + y * y + z * z
        scale = 1.0 / np.sqrt(d2) if d2 > 0.0 else np.nan
        views[j, 0], views[j, 1], views[j, 2] = x * scale, y * scale, z * scale
        # From within a head it fills half the view or more; a right angle is all one can say.
        views[j, 3] = np.arctan2(r, np.sqrt(d2 - r * r)) if d2 > r * r else np.pi / 2
        views[j, 4] = np.inf
    # A chord is never longer than its arc, so a pair whose chord leaves a wider gap than both
    # heads already have needs no arctangent.
    for j in range(m):
        for k in range(j + 1, m):
            x, y, z = (
                views[j, 0] - views[k, 0],
                views[j, 1] - views[k, 1],
                views[j, 2] - views[k, 2],
            )
            rims = views[j, 3] + views[k, 3]
            least = np.sqrt(x * x + y * y + z * z) - rims
            if least < views[j, 4] or least < views[k, 4]:
                gap = (
                    _angle_rad(
                        views[j, 0], views[j, 1], views[j, 2], views[k, 0], views[k, 1], views[k, 2]
                    )
                    - rims
                )
                views[j, 4] = min(views[j, 4], gap)
                views[k, 4] = min(views[k, 4], gap)
    for j in range(m):
        radius_deg[j] = np.degrees(views[j, 3])
        pad_limit_deg[j] = np.degrees(max(views[j, 4], 0.0) / 2)


@compiled
def observe_rays(
    origin: npt.NDArray[np.float64],
    direction: npt.NDArray[np.float64],
    valid: npt.NDArray[np.bool_],
    heads: npt.NDArray[np.float64],
    capsules: npt.NDArray[np.float64],
    is_lit: bool,
    out: npt.NDArray[np.float64],
    hit: npt.NDArray[np.int16],
) -> None:
    """Do what `SceneGeometry.observe` says; `out` (3, n, m) and `hit` (n,) receive its results.

    `heads` (1, m, 4) stay where they are, `heads` (n, m, 4) are elsewhere for every ray.
    """
    n, m = origin.shape[0], heads.shape[1]
    views = np.empty((m, 5))
    is_still = heads.shape[0] == 1
    for i in range(n):
        now = heads[0 if is_still else i]
        ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
        if not (np.isfinite(ox) and np.isfinite(oy) and np.isfinite(oz)):
            out[:, i, :] = np.nan
            hit[i] = -2
            continue
        # Gaze samples come several to a head pose; sizes then are those of the sample before.
        same_origin = (
            is_still
            and i > 0
            and ox == origin[i - 1, 0]
            and oy == origin[i - 1, 1]
            and oz == origin[i - 1, 2]
        )
        if same_origin:
            for j in range(m):
                out[1, i, j] = out[1, i - 1, j]
                out[2, i, j] = out[2, i - 1, j]
        else:
            _see_heads(ox, oy, oz, now, views, out[1, i], out[2, i])
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if not valid[i] or not (length > 0.0) or not np.isfinite(length):
            out[0, i, :] = np.nan
            hit[i] = -2
            continue
        dx, dy, dz = dx / length, dy / length, dz / length
        first = np.inf
        which = -1
        for j in range(m):
            angle = _angle_rad(dx, dy, dz, views[j, 0], views[j, 1], views[j, 2])
            out[0, i, j] = np.degrees(angle)
            # Only a ray within the head's disc (1 µrad for rounding) is worth the exact
            # intersection.
            if is_lit and angle <= views[j, 3] + 1e-6:
                t = _sphere_entry_m(
                    ox - now[j, 0],
                    oy - now[j, 1],
                    oz - now[j, 2],
                    dx,
                    dy,
                    dz,
                    now[j, 3],
                )
                if t < first:
                    first = t
                    which = j
        # A body nearer than the head hides it.
        if which >= 0:
            for k in range(capsules.shape[0]):
                if capsule_entry_m(ox, oy, oz, dx, dy, dz, capsules[k]) < first:
                    which = -1
                    break
        hit[i] = which


@dataclass(frozen=True)
class SceneGeometry:
    """The surfaces of a scene packed for ray tests.

    `heads` (m, 4): centre and radius in metres; `capsules` (c, 7): start, end and radius. Heads
    that have a `course` are there at the onset only. The meshes of a laboratory's own `room` hide
    what is behind them.
    """

    heads: npt.NDArray[np.float64]
    capsules: npt.NDArray[np.float64]
    is_lit: bool
    course: MovingHeads | None = None
    room: RoomAreas | None = None

    @classmethod
    def from_scene(cls, scene: Scene) -> Self:
        """Pack a scene's heads and occluders; agent order is the scene's."""
        heads = np.array([[*a.head_centre_m, a.head_radius_m] for a in scene.agents]).reshape(-1, 4)
        capsules = np.array([[*c.start_m, *c.end_m, c.radius_m] for c in scene.occluders])
        is_lit = scene.brightness_01 > 0
        room = areas_of_room(scene.room) if scene.room and scene.agents and is_lit else None
        return cls(heads, capsules.reshape(-1, 7), is_lit, moving_heads(scene), room)

    def heads_at(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """Return the heads at session times (n,): (n, m, 4), or (1, m, 4) if they never move."""
        if self.course is None:
            return self.heads[None]
        radius_m = np.broadcast_to(self.heads[:, 3:], (len(t_ns), len(self.heads), 1))
        return np.concatenate([self.course.centres_m(t_ns), radius_m], axis=2)

    def observe(
        self,
        origin_m: Vector,
        direction: Vector,
        valid: npt.NDArray[np.bool_],
        t_ns: npt.NDArray[np.int64] | None = None,
    ) -> Observation:
        """See n gaze rays: `(angle_deg, radius_deg, pad_limit_deg, hit)`, shapes (n, m) and (n,).

        `origin_m` (n, 3) and `direction` (n, 3) in world; directions need not be unit length.
        `angle_deg` from ray to head centre, NaN when lost; `radius_deg` the head's angular
        radius; `pad_limit_deg` half the rim-to-rim gap to the nearest other head as seen (0 when
        they overlap, inf for a head alone); both need only an origin. `hit` is the head met
        before any other surface, -1 for none, -2 lost. A ray is lost when not valid, or when its
        direction has no length or is not finite. In the dark nothing is hit. `t_ns` (n,) are the
        session times of the rays, without which heads are where they are at the onset.
        """
        n = origin_m.shape[0]
        out = np.empty((3, n, self.heads.shape[0]))
        hit = np.empty(n, np.int16)
        heads = self.heads[None] if t_ns is None else self.heads_at(t_ns)
        observe_rays(
            np.ascontiguousarray(origin_m, np.float64),
            np.ascontiguousarray(direction, np.float64),
            np.ascontiguousarray(valid, np.bool_),
            heads,
            self.capsules,
            self.is_lit,
            out,
            hit,
        )
        self.hide(origin_m, unit(direction), heads, out, hit)
        return out[0], out[1], out[2], hit

    def hide(
        self,
        origin_m: Vector,
        direction: Vector,
        heads: npt.NDArray[np.float64],
        per_head: npt.NDArray[np.float64],
        hit: npt.NDArray[np.int16],
    ) -> None:
        """Change what `observe_rays` found of rays (n, 3) that a mesh of the room ends before a
        head: it is not met, and no pad around it holds them.
        """
        if self.room is None:
            return
        angle_deg, radius_deg, pad_limit_deg = per_head
        with np.errstate(invalid="ignore"):
            near = np.flatnonzero((angle_deg <= radius_deg + BESIDE_DEG).any(axis=1))
        if not len(near):
            return
        surface_m = self.room.distance_m(origin_m[near], direction[near])[:, None]
        at = heads[near] if len(heads) > 1 else np.repeat(heads, len(near), axis=0)
        to_head_m, radius_m = np.linalg.norm(at[..., :3] - origin_m[near, None], axis=2), at[..., 3]
        # A ray through the head meets it later than the head's nearest point is away.
        along_m = to_head_m * np.cos(np.radians(angle_deg[near]))
        depth_m2 = radius_m**2 - to_head_m**2 + along_m**2
        meets_m = np.where(depth_m2 >= 0, along_m - np.sqrt(np.maximum(depth_m2, 0)), np.inf)
        meets_m = np.where(np.isfinite(meets_m), meets_m, to_head_m - radius_m)
        is_hidden = surface_m < meets_m
        pad_limit_deg[near] = np.where(is_hidden, 0.0, pad_limit_deg[near])
        of_hit = hit[near]
        hides_hit = (of_hit >= 0) & is_hidden[np.arange(len(near)), np.maximum(of_hit, 0)]
        hit[near[hides_hit]] = HIT_NOTHING
