"""Collisions of a recorded walk: common volumes every 10 ms, then one row per collision."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from visavis.analysis.collisions import (
    ClosedMesh,
    Rule,
    Settings,
    common_volume,
    find_collisions,
    nearest_part,
    speed_at,
)
from visavis.experiments.crowd.surfaces import (
    MeshSurface,
    Surface,
    avatar_of,
    crowd_surfaces,
    own_surface,
    own_surfaces,
    person_surface,
)
from visavis.experiments.crowd.walk_kernel import Measuring, volumes_of_walk
from visavis.experiments.crowd.walks import Walk
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.body import CAPSULE_JOINTS, capsule_body
from visavis.stimuli.contact.common import Capsules, volumes_along
from visavis.stimuli.contact.figures import crowd_figures
from visavis.stimuli.contact.idle import place_person, workspace
from visavis.stimuli.contact.touch import REACH_M, TouchSensor

CAPSULE_CELL_M: Final = 0.0125
SURFACE_REACH_M: Final = REACH_M + 0.22
"""No part of an idle person's surface is farther than this from where they stand."""
SIDE_OF: Final = {"left": "left", "right": "right"}
_FINE_ENOUGH: Final = Settings()
_IN_CONTACT: Final = Settings(require_contact=False)
"""For cubes of two bodies of which it is known that they share volume."""


@dataclass(frozen=True, eq=False)
class WalkVolumes:
    """Common volumes of a walk: `volume_m3` (n, people), NaN where the body was lost.

    `surface` says what bodies were measured: those of the `characters`, bodies built round
    capsules (`fine`, `light`), or the `capsules` themselves. `avatar` plays the participant.
    """

    volume_m3: Vector
    rule: Rule
    surface: Surface
    avatar: str


def walk_volumes(
    walk: Walk,
    *,
    rule: Rule = "volume",
    surface: Surface = "characters",
    sex: str | None = None,
) -> WalkVolumes:
    """Measure what participant and every person have in common at every step of a walk.

    Bodies whose boxes do not meet, piece by piece, share nothing; the others are posed and
    measured by the rule. `sex` chooses the participant's body.
    """
    avatar = avatar_of(sex, walk.stature_m)
    if surface == "capsules":
        return WalkVolumes(_capsule_volumes(walk), rule, surface, avatar)
    volumes = volumes_or_nearness(walk, surface, avatar, only_near=rule != "volume")
    if rule != "volume":
        poser = _Poser(walk, surface, avatar)
        for i, person in np.argwhere(volumes == 1.0).tolist():
            volumes[i, person] = common_volume(poser.own(i), poser.other(i, person), rule).volume_m3
    return WalkVolumes(volumes, rule, surface, avatar)


def volumes_or_nearness(
    walk: Walk, surface: MeshSurface, avatar: str, *, only_near: bool
) -> Vector:
    """Return what an avatar and everybody have in common at every step, (n, people); `only_near`
    poses everybody near, measures nothing, and returns 1 where boxes of their parts meet, else 0.
    """
    volumes = np.empty((len(walk.t_ns), len(walk.crowd)))
    volumes_of_walk(
        np.ascontiguousarray(walk.position_m),
        np.ascontiguousarray(walk.orientation_wxyz),
        walk.crowd_t_s,
        own_surfaces(surface, avatar),
        walk.stature_m / own_surface(surface, avatar)[1],
        walk.people,
        crowd_figures(),
        crowd_surfaces(surface),
        Measuring(
            SURFACE_REACH_M,
            _FINE_ENOUGH.cell_m,
            _FINE_ENOUGH.refine_below_m3,
            _FINE_ENOUGH.fine_columns,
            only_near=only_near,
        ),
        volumes,
    )
    return volumes


def _capsule_volumes(walk: Walk) -> Vector:
    volumes = np.empty((len(walk.t_ns), len(walk.crowd)))
    body = capsule_body(walk.stature_m)
    volumes_along(
        walk.position_m,
        walk.orientation_wxyz,
        walk.crowd_t_s,
        Capsules(body.start_m, body.end_m, body.radius_m),
        walk.people,
        crowd_figures(),
        REACH_M,
        CAPSULE_CELL_M,
        0.0,
        volumes,
    )
    return volumes


def collision_rows(walk: Walk, volumes: WalkVolumes) -> list[dict[str, Any]]:
    """Return one row per collision, uncounted ones included, in order of their start."""
    rows = []
    place = walk.place_m
    poser = None
    if volumes.surface != "capsules":
        poser = _Poser(walk, volumes.surface, volumes.avatar)
    sensor = TouchSensor(walk.crowd)
    body = capsule_body(walk.stature_m)
    start_ns = int(walk.row["t_start_ns"])
    index = {int(t): i for i, t in enumerate(walk.t_ns)}
    for collision in find_collisions(walk.t_ns, volumes.volume_m3, volumes.rule):
        i = index[collision.peak_ns]
        x_m, z_m = place[index[collision.start_ns]].tolist()
        starts, ends = body.posed(walk.position_m[i], walk.orientation_wxyz[i])
        centre, printed_m3 = np.full(3, np.nan), np.nan
        if poser is not None:
            own, other = poser.own(i), poser.other(i, collision.character)
            common = common_volume(own, other)
            centre, printed_m3 = common.centre_m, 0.0
            if common.contact:
                cubes = common_volume(own, other, "published", settings=_IN_CONTACT)
                printed_m3 = cubes.volume_m3
        part = _part_at(walk, sensor, i, collision.character, centre, starts, ends, body.radius_m)
        side, _, rest = part.partition("_")
        rows.append(
            {
                "trial_id": walk.trial_id,
                "person": collision.character,
                "behaviour": int(walk.crowd.behaviour[collision.character]),
                "start_s": (collision.start_ns - start_ns) / 1e9,
                "end_s": (collision.end_ns - start_ns) / 1e9,
                "duration_s": collision.duration_s,
                "x_m": x_m,
                "z_m": z_m,
                "max_volume_dm3": 1000 * collision.max_volume_m3,
                "max_volume_published_dm3": 1000 * printed_m3,
                "peak_s": (collision.peak_ns - start_ns) / 1e9,
                "body_part": rest if side in SIDE_OF else part,
                "side": side if side in SIDE_OF else "middle",
                "speed_m_s": speed_at(walk.t_ns, place, collision.start_ns),
                "counted": collision.counted,
                "cut": collision.cut,
                "rule": collision.rule,
                "surface": volumes.surface,
            }
        )
    return rows


def _part_at(
    walk: Walk,
    sensor: TouchSensor,
    i: int,
    person: int,
    centre_m: Vector,
    starts: Vector,
    ends: Vector,
    radii: Vector,
) -> str:
    """Name the participant's part nearest to a place, or else the one deepest in the person."""
    if np.isfinite(centre_m).all():
        return CAPSULE_JOINTS[nearest_part(centre_m, starts, ends, radii)[0]]
    touches = sensor.touches(starts, ends, radii, float(walk.crowd_t_s[i]))
    of_person = [t for t in touches if t.person == person]
    if not of_person:
        return "unknown"
    return CAPSULE_JOINTS[max(of_person, key=lambda t: t.depth_m).part]


class _Poser:
    """Pose the surfaces of a walk: the participant's, and those of people at a step."""

    def __init__(self, walk: Walk, surface: MeshSurface, avatar: str) -> None:
        self._walk, self._surface = walk, surface
        self._own, size_m = own_surface(surface, avatar)
        self._scale = walk.stature_m / size_m
        self._people, self._t_s = walk.people, walk.crowd_t_s
        self._step, self._mesh = -1, ClosedMesh(np.empty((0, 3)), np.empty((0, 3), np.int32))
        self._room = workspace()

    def own(self, step: int) -> ClosedMesh:
        """Return the participant's surface."""
        if step != self._step:
            walk = self._walk
            self._step = step
            self._mesh = self._own.mesh_at(
                walk.position_m[step], walk.orientation_wxyz[step], self._scale
            )
        return self._mesh

    def other(self, step: int, person: int) -> ClosedMesh:
        """Return a person's surface."""
        room = self._room
        place_person(self._people[person], float(self._t_s[step]), crowd_figures(), room)
        surface = person_surface(int(self._walk.crowd.character[person]), self._surface)
        return surface.mesh_at(room.position_m[0], room.world[0])
