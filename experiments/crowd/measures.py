"""From the recording of one walk to its measures: one row, its collisions, its gap crossings."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from visavis.analysis.cells import CellError, CellPath, Triangulation, triangulate
from visavis.analysis.cells import walk as walk_cells
from visavis.analysis.collisions import Rule
from visavis.analysis.gait import clearance_m, crossing_angles_deg, walk_measures
from visavis.experiments.crowd.collision_measures import WalkVolumes, collision_rows, walk_volumes
from visavis.experiments.crowd.pedestrian import has_pedpy, pedestrian_measures
from visavis.experiments.crowd.surfaces import Surface
from visavis.experiments.crowd.tracking import format_durations
from visavis.experiments.crowd.walks import Walk
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.geometry import Vector
from visavis.protocol.plan.steps import finite_or_none
from visavis.stimuli.scenes.station_crowd import BOARD_M, Crowd, in_room

JITTER_SEED: Final = 20200


@dataclass(frozen=True)
class MeasureParameters:
    """How walks are measured.

    `rule` is how volumes are measured (`visavis.analysis.collisions`), `surface` of what body; both
    are named in every table. `narrow_gap_m` is the widest gap of two people's centres that
    `shoulders_to_gap_narrow_deg` counts.
    """

    rule: Rule = "volume"
    surface: Surface = "characters"
    narrow_gap_m: float = 1.5

    def __post_init__(self) -> None:
        if not 0 < self.narrow_gap_m < np.inf:
            raise UsageError(
                f"narrow_gap_m is {self.narrow_gap_m}; give a number of metres above 0"
            )
        if self.surface == "capsules" and self.rule != "volume":
            raise ConfigError("capsules are measured by rule volume alone; choose another surface")


DEFAULT_MEASURES: Final = MeasureParameters()


@dataclass(frozen=True, eq=False)
class MeasuredWalk:
    """A walk measured: its `row`, rows of `collisions` and gap `crossings`, the `cells` it
    visited as vertex triples in order (None outside), and its track every 0.1 s, (k, 2).
    """

    row: dict[str, Any]
    collisions: list[dict[str, Any]]
    crossings: list[dict[str, Any]]
    cells: tuple[tuple[int, int, int] | None, ...]
    track_m: Vector


def crowd_cells(crowd: Crowd) -> Triangulation:
    """Return the triangles between the people of a crowd."""
    return triangulate(
        crowd.position_m, cocircular="jitter", rng=np.random.default_rng(JITTER_SEED)
    )


def cells_of(walk: Walk) -> tuple[Triangulation, CellPath]:
    """Return the crowd's cells and the participant's way through them."""
    cells = crowd_cells(walk.crowd)
    return cells, walk_cells(cells, walk.place_m)


def measure_walk(
    walk: Walk,
    step_m: float,
    params: MeasureParameters = DEFAULT_MEASURES,
    *,
    sex: str | None = None,
) -> MeasuredWalk:
    """Measure a walk from its recording alone; `step_m` is left out round the stop.

    What cannot be measured is missing, and `flags` say why: a body never tracked, tracking lost
    for a while, a way out of the room, people at one place (no cells). `sex` chooses the body.
    """
    row = {**walk.row, "measure_rule": params.rule, "measure_surface": params.surface}
    is_lost = np.asarray(~np.isfinite(walk.position_m).all(axis=(1, 2)))
    row["lost_01"] = float(is_lost.mean()) if len(is_lost) else 1.0
    row["tracked_s"] = 0.0
    flags = [text for text in str(walk.row.get("flags") or "").split(";") if text]
    row["frozen_segments_measured"] = format_durations(walk.frozen_ns)
    if walk.frozen_ns:
        flags.append("segment_frozen")
    # A body that was never tracked has no measures at all.
    place = walk.place_m[np.isfinite(walk.place_m).all(axis=1)]
    if len(walk.t_ns) < 3 or not len(place):
        row["flags"] = ";".join([*flags, "not_measured_body_never_tracked"])
        return MeasuredWalk(row, [], [], (), np.empty((0, 2)))
    if is_lost.any():
        flags.append("measured_with_gaps")
    if not in_room(place).all():
        flags.append("left_room")
    # Crowds with people at one place have no Delaunay cells; everything else is still measured.
    try:
        triangulation, path = cells_of(walk)
    except CellError as problem:
        flags.append("no_cells")
        row["cells_problem"] = str(problem)
        triangulation, path = None, CellPath((), (), (0,), 0)
    row["flags"] = ";".join(dict.fromkeys(flags))
    # Collisions from common volumes, crossings from the exact walk through the cells.
    volumes = walk_volumes(walk, rule=params.rule, surface=params.surface, sex=sex)
    collisions = collision_rows(walk, volumes)
    counted_collisions = [c for c in collisions if c["counted"]]
    to_gap = to_way = np.empty(0)
    if triangulation is not None:
        to_gap, to_way = crossing_angles_deg(
            triangulation,
            path,
            walk.joint("left_upper_arm")[:, [0, 2]],
            walk.joint("right_upper_arm")[:, [0, 2]],
        )
    # Crossings of an edge of the hull from outside to outside are not gaps.
    inner = np.array([c.before is not None or c.after is not None for c in path.crossings], bool)
    crossings: list[dict[str, Any]] = [
        {
            "trial_id": walk.trial_id,
            "first": c.edge[0],
            "second": c.edge[1],
            "x_m": c.at_m[0],
            "z_m": c.at_m[1],
            "t_s": float(np.interp(c.s, np.arange(len(walk.t_ns)), walk.crowd_t_s)),
            "centres_apart_m": _apart(walk.crowd.position_m, c.edge),
            "shoulders_to_gap_deg": float(to_gap[k]),
            "shoulders_to_way_deg": float(to_way[k]),
        }
        for k, c in enumerate(path.crossings)
        if inner[k]
    ]
    gait = walk_measures(walk.t_ns, walk.place_m, (BOARD_M[0], BOARD_M[2]), step_m)
    clear = clearance_m(walk.place_m, walk.crowd.position_m)
    row |= _collision_measures(collisions, counted_collisions, _measured_s(walk, volumes))
    row |= {
        "crossings": len(crossings) if triangulation is not None else None,
        "shoulders_to_gap_deg": _mean([c["shoulders_to_gap_deg"] for c in crossings]),
        "shoulders_to_way_deg": _mean([c["shoulders_to_way_deg"] for c in crossings]),
        "speed_m_s": gait.speed_m_s,
        "speed_whole_m_s": gait.speed_whole_m_s,
        "path_m": finite_or_none(gait.path_m),
        "time_s": gait.time_s,
        "stop_s": gait.stop_s,
        "hesitations": gait.hesitations,
        "hesitation_s": gait.hesitation_s,
        "clearance_mean_m": float(np.nanmean(clear)),
        "clearance_min_m": float(np.nanmin(clear)),
        "cells": len(path.cell_set) if triangulation is not None else None,
        "step_m": step_m,
        **_pedestrian(walk),
    }
    return MeasuredWalk(row, collisions, crossings, path.cells, walk.place_m[::10])


def _collision_measures(
    collisions: list[dict[str, Any]], counted_collisions: list[dict[str, Any]], tracked_s: float
) -> dict[str, float | None]:
    """Return a walk's columns about collisions; a body never whole had none that could be seen."""
    columns: dict[str, float | None] = {
        "collisions": len(counted_collisions),
        "collisions_per_tracked_min": 60 * len(counted_collisions) / tracked_s
        if tracked_s
        else None,
        "collisions_uncounted": len(collisions) - len(counted_collisions),
        "collisions_cut": sum(c["cut"] for c in counted_collisions),
        "max_volume_dm3": _mean([c["max_volume_dm3"] for c in counted_collisions]),
        "max_volume_published_dm3": _mean(
            [c["max_volume_published_dm3"] for c in counted_collisions]
        ),
        "largest_volume_dm3": max((c["max_volume_dm3"] for c in counted_collisions), default=0.0),
        "collision_s": _mean([c["duration_s"] for c in counted_collisions]),
        "collision_speed_m_s": _mean([c["speed_m_s"] for c in counted_collisions]),
        "arm_collisions": sum(
            c["body_part"] in ("upper_arm", "lower_arm", "hand") for c in counted_collisions
        ),
    }
    return {**(columns if tracked_s else dict.fromkeys(columns)), "tracked_s": tracked_s}


def _measured_s(walk: Walk, volumes: WalkVolumes) -> float:
    """Return the time of all steps whose common volumes are known."""
    step_s = float(np.median(np.diff(walk.t_ns))) / NS_PER_S
    return int(np.isfinite(volumes.volume_m3).all(axis=1).sum()) * step_s


def _pedestrian(walk: Walk) -> dict[str, float | None]:
    """Return density and individual speed over the walk; None where PedPy is not installed."""
    if not has_pedpy():
        return {"density_per_m2": None, "individual_speed_m_s": None}
    measures = pedestrian_measures(walk)
    return {
        "density_per_m2": _mean(measures.density_per_m2.tolist()),
        "individual_speed_m_s": _mean(measures.speed_m_s.tolist()),
    }


def _apart(positions_m: Vector, edge: tuple[int, int]) -> float:
    a, b = positions_m[list(edge)]
    return float(np.linalg.norm(b - a))


def _mean(values: list[float]) -> float | None:
    finite = [v for v in values if np.isfinite(v)]
    return float(np.mean(finite)) if finite else None
