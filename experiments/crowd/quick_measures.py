"""Measure walks simulated in memory, by the hundred: what a recording gives, but coarsely.

Every 50 ms instead of every 10, on capsules instead of meshes, people held still for a third of
a second, cells by where the samples lie. `tests/experiments/crowd/test_quick_study.py` holds the
result to the measures of a recording.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay

from visavis.analysis.cells import folded_angle_deg
from visavis.analysis.gait import walk_measures
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.body import capsule_body
from visavis.stimuli.contact.common import Capsules, volumes_along
from visavis.stimuli.contact.cubes import cubes_at
from visavis.stimuli.contact.figures import crowd_figures
from visavis.stimuli.contact.idle import people_of
from visavis.stimuli.contact.touch import REACH_M
from visavis.stimuli.scenes.station_crowd import BOARD_M, Crowd

CELL_M: Final = 0.025
CUBE_M: Final = 0.01
"""Side of the cubes that the source counts."""
HOLD_S: Final = 0.34
THRESHOLD_M3: Final = 1e-6
_HIPS = BODY_JOINTS.index("hips")
_SHOULDERS = BODY_JOINTS.index("left_upper_arm"), BODY_JOINTS.index("right_upper_arm")
_FLOOR = (0, 2)

Cell = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class QuickWalk:
    """A walk simulated in memory.

    `t_s` (n,) since the crowd came on, evenly spaced; `position_m` (n, 22, 3) and
    `orientation_wxyz` (n, 22, 4) of `BODY_JOINTS`; `touching_s` how long an arm was in contact
    while the bands were on, 0 where they were off.
    """

    crowd: Crowd
    t_s: Vector
    position_m: Vector
    orientation_wxyz: Vector
    stature_m: float
    came_back: bool
    caution: float
    touching_s: float


def quick_measures(walk: QuickWalk, step_m: float) -> tuple[dict[str, Any], frozenset[Cell]]:
    """Return the row of measures of a walk and the cells it visited, as vertex triples."""
    place = walk.position_m[:, _HIPS][:, _FLOOR]
    collisions = _collisions(walk)
    cells, to_gap, to_way = _crossings(walk, place)
    board = BOARD_M[0], BOARD_M[2]
    gait = walk_measures(np.rint(walk.t_s * NS_PER_S).astype(np.int64), place, board, step_m)
    row = {
        "collisions": len(collisions.largest_m3),
        "max_volume_dm3": _mean_dm3(collisions.largest_m3),
        "max_volume_published_dm3": _mean_dm3(collisions.of_cubes_m3),
        "shoulders_to_gap_deg": to_gap,
        "shoulders_to_way_deg": to_way,
        "speed_m_s": gait.speed_m_s,
        "path_m": gait.path_m,
        "time_s": gait.time_s,
        "came_back": walk.came_back,
        "caution": walk.caution,
        "touching_s": walk.touching_s,
    }
    return row, cells


class _Collisions(NamedTuple):
    """Every collision's largest common volume and, then, that of the cubes that touch both."""

    largest_m3: Vector
    of_cubes_m3: Vector


def _collisions(walk: QuickWalk) -> _Collisions:
    """Return the largest common volume of every collision, and the cubes of that step."""
    people, body = people_of_crowd(walk.crowd), capsule_body(walk.stature_m)
    own = Capsules(body.start_m, body.end_m, body.radius_m)
    volumes = np.empty((len(walk.t_s), len(people)))
    volumes_along(
        walk.position_m,
        walk.orientation_wxyz,
        walk.t_s,
        own,
        people,
        crowd_figures(),
        REACH_M,
        CELL_M,
        HOLD_S,
        volumes,
    )
    in_contact = np.flatnonzero(volumes.max(axis=0) > THRESHOLD_M3)
    # every person's course after another's, with a step without contact between
    n = len(volumes) + 1
    course: Vector = np.vstack([volumes[:, in_contact], np.zeros(len(in_contact))]).T.ravel()
    edges = np.diff(np.concatenate([[False], course > THRESHOLD_M3]).astype(int))
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    peaks = np.array(
        [a + np.argmax(course[a:b]) for a, b in zip(begins, ends, strict=True)], np.int64
    )
    cubes = np.empty(len(peaks), np.int64)
    cubes_at(
        walk.position_m,
        walk.orientation_wxyz,
        walk.t_s,
        own,
        people,
        crowd_figures(),
        CUBE_M,
        peaks % n,
        in_contact[peaks // n],
        cubes,
    )
    of_cubes: Vector = cubes.astype(np.float64) * CUBE_M**3
    return _Collisions(course[peaks], of_cubes)


def _mean_dm3(volumes_m3: Vector) -> float:
    return 1000 * float(volumes_m3.mean()) if len(volumes_m3) else float("nan")


@lru_cache(maxsize=16)
def people_of_crowd(crowd: Crowd) -> Vector:
    """Return the rows of `visavis.stimuli.contact.idle` for a crowd of the study, laid out once."""
    return people_of(crowd)


@lru_cache(maxsize=16)
def _cells(crowd: Crowd) -> Delaunay:
    return Delaunay(crowd.position_m)


def _crossings(walk: QuickWalk, place: Vector) -> tuple[frozenset[Cell], float, float]:
    """Return cells visited and mean angles (degrees) of the shoulders at their edges."""
    mesh = _cells(walk.crowd)
    triple = np.sort(mesh.simplices, axis=1).astype(np.int64)
    at = mesh.find_simplex(place)
    visited_cells = frozenset((a, b, c) for a, b, c in triple[np.unique(at[at >= 0])].tolist())
    change = np.flatnonzero(at[1:] != at[:-1])
    edges, rows = [], []
    for i in change.tolist():
        edge = _edge_between(triple, int(at[i]), int(at[i + 1]), mesh)
        if edge is not None:
            edges.append(edge)
            rows.append(i)
    if not rows:
        return visited_cells, float("nan"), float("nan")
    left, right = (walk.position_m[:, joint][:, _FLOOR] for joint in _SHOULDERS)
    shoulders = (left - right)[rows]
    a, b = mesh.points[np.array(edges)].transpose(1, 0, 2)
    heading = place[np.array(rows) + 1] - place[rows]
    square = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    to_gap = folded_angle_deg(shoulders, b - a)
    return visited_cells, float(to_gap.mean()), float(folded_angle_deg(shoulders, square).mean())


def _edge_between(
    triple: npt.NDArray[np.int64], before: int, after: int, mesh: Delaunay
) -> list[int] | None:
    """Return the edge two neighbouring cells share; None where a corner was cut."""
    if before >= 0 and after >= 0:
        common_corners = sorted(set(triple[before].tolist()) & set(triple[after].tolist()))
        return common_corners if len(common_corners) == 2 else None
    inner = max(before, after)
    outer = [k for k in range(3) if mesh.neighbors[inner, k] < 0]
    if len(outer) != 1:
        return None
    return sorted(set(mesh.simplices[inner].tolist()) - {int(mesh.simplices[inner, outer[0]])})
