"""Collisions of a recorded walk: common volumes every 10 ms, then one row per collision."""

from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from analysis.collisions import Rule, common_volume, find_collisions, nearest_part, speed_at
from experiments.crowd.body_mesh import Detail, body_mesh
from experiments.crowd.replay import Walk
from lab.geometry import Vector
from stimuli.contact.body import CAPSULE_JOINTS, capsule_body
from stimuli.contact.common import volumes_along
from stimuli.contact.figures import crowd_figures
from stimuli.contact.idle import N_JOINTS, place_person
from stimuli.contact.touch import REACH_M, TouchSensor

Surface: TypeAlias = Literal["fine", "light", "capsules"]

CAPSULE_CELL_M: Final = 0.0125
SIDE_OF: Final = {"left": "left", "right": "right"}


@dataclass(frozen=True, eq=False)
class WalkVolumes:
    """Common volumes of a walk: `volume_m3` (n, people), NaN where the body was lost.

    `surface` says what bodies were measured: a body mesh, `fine` or `light`, or `capsules`.
    """

    volume_m3: Vector
    rule: Rule
    surface: Surface


def walk_volumes(walk: Walk, *, rule: Rule = "volume", surface: Surface = "fine") -> WalkVolumes:
    """Measure what participant and every person have in common at every step of a walk.

    A touch of capsules comes first, as the meshes lie inside them; then the surfaces are posed
    and measured by the rule.
    """
    if surface == "capsules":
        return WalkVolumes(_capsule_volumes(walk), rule, surface)
    n = len(walk.t_ns)
    volumes = np.zeros((n, len(walk.crowd)))
    whole = capsule_body(1.0)
    sensor = TouchSensor(walk.crowd)
    radius = walk.stature_m * whole.radius_m
    lost = ~np.isfinite(walk.position_m).all(axis=(1, 2))
    volumes[lost] = np.nan
    poser = _Poser(walk)
    crowd_t_s = walk.crowd_t_s
    scaled = capsule_body(walk.stature_m)
    for i in np.flatnonzero(~lost):
        position, turn = walk.position_m[i], walk.orientation_wxyz[i]
        starts, ends = scaled.posed(position, turn)
        touched = {t.person for t in sensor.touches(starts, ends, radius, float(crowd_t_s[i]))}
        if not touched:
            continue
        mesh = body_mesh(surface)
        own = mesh.posed(position, turn, walk.stature_m)
        for person in touched:
            other = poser.mesh(person, float(crowd_t_s[i]), surface)
            volumes[i, person] = common_volume(own, other, rule).volume_m3
    return WalkVolumes(volumes, rule, surface)


def _capsule_volumes(walk: Walk) -> Vector:
    volumes = np.empty((len(walk.t_ns), len(walk.crowd)))
    body = capsule_body(walk.stature_m)
    volumes_along(
        walk.position_m,
        walk.orientation_wxyz,
        walk.crowd_t_s,
        body.start_m,
        body.end_m,
        body.radius_m,
        walk.people,
        crowd_figures(),
        REACH_M,
        CAPSULE_CELL_M,
        0.0,
        volumes,
    )
    return volumes


def collision_rows(walk: Walk, measured: WalkVolumes) -> list[dict[str, Any]]:
    """Return one row per collision, uncounted ones included, in order of their start."""
    rows = []
    place = walk.place_m
    poser = _Poser(walk)
    sensor = TouchSensor(walk.crowd)
    body = capsule_body(walk.stature_m)
    start_ns = int(walk.row["t_start_ns"])
    index = {int(t): i for i, t in enumerate(walk.t_ns)}
    for found in find_collisions(walk.t_ns, measured.volume_m3, measured.rule):
        i = index[found.peak_ns]
        starts, ends = body.posed(walk.position_m[i], walk.orientation_wxyz[i])
        centre = np.full(3, np.nan)
        if measured.surface != "capsules":
            centre = _centre_at(walk, poser, i, found.character, measured.surface)
        part = _part_at(walk, sensor, i, found.character, centre, starts, ends, body.radius_m)
        side, _, rest = part.partition("_")
        rows.append(
            {
                "trial_id": walk.trial_id,
                "person": found.character,
                "behaviour": int(walk.crowd.behaviour[found.character]),
                "start_s": (found.start_ns - start_ns) / 1e9,
                "end_s": (found.end_ns - start_ns) / 1e9,
                "duration_s": found.duration_s,
                "max_volume_dm3": 1000 * found.max_volume_m3,
                "peak_s": (found.peak_ns - start_ns) / 1e9,
                "body_part": rest if side in SIDE_OF else part,
                "side": side if side in SIDE_OF else "middle",
                "speed_m_s": speed_at(walk.t_ns, place, found.start_ns),
                "counted": found.counted,
                "cut": found.cut,
                "rule": found.rule,
                "surface": measured.surface,
            }
        )
    return rows


def _centre_at(walk: Walk, poser: "_Poser", i: int, person: int, surface: Detail) -> Vector:
    """Return the middle of what participant and person have in common at a step."""
    own = body_mesh(surface).posed(walk.position_m[i], walk.orientation_wxyz[i], walk.stature_m)
    return common_volume(own, poser.mesh(person, float(walk.crowd_t_s[i]), surface)).centre_m


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
    """Pose people of a walk's crowd at a time, as capsules or as meshes."""

    def __init__(self, walk: Walk) -> None:
        self._people = walk.people
        self._figures = crowd_figures()
        self._root, self._local = np.empty((1, 3)), np.empty((1, N_JOINTS, 4))
        self._position, self._world = np.empty((1, N_JOINTS, 3)), np.empty((1, N_JOINTS, 4))

    def _place(self, person: int, t_s: float) -> tuple[Vector, Vector]:
        place_person(
            self._people[person],
            t_s,
            self._figures,
            self._root,
            self._local,
            self._position,
            self._world,
        )
        return self._position[0], self._world[0]

    def mesh(self, person: int, t_s: float, detail: Detail) -> Any:
        """Return a person's closed mesh."""
        figure = int(self._people[person, 15])
        return body_mesh(detail, figure).posed(*self._place(person, t_s), 1.0)
