"""Measures of pedestrian laboratories for a walk, by PedPy, and files for PedPy.

Ground plane for PedPy: x to the right, y away from the start (our −z), metres.
"""

import importlib
import importlib.util
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.experiments.crowd.walks import STEP_NS, Walk
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.idle import crowd_poses
from visavis.stimuli.scenes.station_crowd import ROOM_SIDE_M

PEDPY_MISSING: Final = (
    "PedPy is not installed here; install it with: pip install 'visavis[pedestrian]'"
)
LOOK_HZ: Final = 1.0
"""Density is read once a second: people stand, and the participant walks half a metre a second."""
SPEED_OVER_S: Final = 1.0
NEAR_M: Final = 3.0
SAME_PLACE_M: Final = 1e-6
CUT_OFF_M: Final = 1.0
"""Voronoi cells end this far from a person, as usual for people at the edge of a crowd."""
PARTICIPANT_ID: Final = 0
EXPORT_HZ: Final = 25.0
FILE_VERSION: Final = "0.2.0"


@dataclass(frozen=True, eq=False)
class PedestrianMeasures:
    """Density and speed of the participant at moments of a walk: `t_s`, `density_per_m2`,
    `speed_m_s` (k,), NaN where the body was lost or there is no speed yet; there is no density
    where the participant stands in somebody's very place.
    """

    t_s: Vector
    density_per_m2: Vector
    speed_m_s: Vector


def pedestrian_measures(walk: Walk) -> PedestrianMeasures:
    """Return density by the participant's Voronoi cell, and individual speed, by PedPy.

    Raises:
        UsageError: PedPy is not installed.
    """
    pedpy = load_pedpy()
    every = max(round(1e9 / LOOK_HZ / STEP_NS), 1)
    steps = np.arange(0, len(walk.t_ns), every)
    place = _flat(walk.place_m[steps])
    is_known = np.isfinite(place).all(axis=1)
    # people who stand at one place border the participant's cell as one person would
    people = np.unique(np.round(_flat(walk.crowd.position_m), 6), axis=0)
    rows = []
    for frame in np.flatnonzero(is_known).tolist():
        apart = np.linalg.norm(people - place[frame], axis=1)
        near = (apart < NEAR_M) & (apart > SAME_PLACE_M)
        rows.append((PARTICIPANT_ID, frame, *place[frame]))
        rows += [(1 + k, frame, *people[k]) for k in np.flatnonzero(near).tolist()]
    density = np.full(len(steps), np.nan)
    speed = np.full(len(steps), np.nan)
    if rows:
        table = pd.DataFrame(rows, columns=["id", "frame", "x", "y"])
        trajectory = pedpy.TrajectoryData(data=table, frame_rate=LOOK_HZ)
        area = pedpy.WalkableArea(_room(place[is_known]))
        cells = pedpy.compute_individual_voronoi_polygons(
            traj_data=trajectory,
            walkable_area=area,
            cut_off=pedpy.Cutoff(radius=CUT_OFF_M, quad_segments=8),
        )
        own = cells[cells["id"] == PARTICIPANT_ID]
        density[own["frame"].to_numpy(int)] = own["density"].to_numpy(float)
        density[[_stands_on_somebody(at, people) for at in place]] = np.nan
        alone = pedpy.TrajectoryData(
            data=table[table["id"] == PARTICIPANT_ID].reset_index(drop=True), frame_rate=LOOK_HZ
        )
        if len(alone.data) > 2 * round(SPEED_OVER_S * LOOK_HZ):
            speeds = pedpy.compute_individual_speed(
                traj_data=alone,
                frame_step=round(SPEED_OVER_S * LOOK_HZ),
                speed_calculation=pedpy.SpeedCalculation.BORDER_EXCLUDE,
            )
            speed[speeds["frame"].to_numpy(int)] = speeds["speed"].to_numpy(float)
    return PedestrianMeasures(walk.crowd_t_s[steps], density, speed)


def _stands_on_somebody(place: Vector, people: Vector) -> bool:
    return bool((np.linalg.norm(people - place, axis=1) <= SAME_PLACE_M).any())


def load_pedpy() -> Any:
    """Return PedPy.

    Raises:
        UsageError: it is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module("pedpy")
    except ImportError as error:
        raise UsageError(PEDPY_MISSING) from error


def has_pedpy() -> bool:
    """Tell whether PedPy is installed."""
    return importlib.util.find_spec("pedpy") is not None


def write_pedpy_files(walk: Walk, folder: Path, name: str) -> list[Path]:
    """Write a walk as PedPy reads it: text, JuPedSim sqlite, and HDF5 where h5py is installed.

    The participant has identifier 0, people of the crowd 1 and up; 25 frames a second. Frames in
    which the body was lost hold the crowd alone. The sqlite file alone carries orientation.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table = trajectory_table(walk)
    wkt = _room(_flat(walk.place_m[np.isfinite(walk.place_m).all(axis=1)]))
    text = folder / f"{name}.txt"
    np.savetxt(
        text,
        table[["id", "frame", "x", "y", "z"]],
        ("%d", "%d", "%.6f", "%.6f", "%.6f"),
        header=f"framerate: {EXPORT_HZ:g} fps\nid frame x/m y/m z/m",
        encoding="utf-8",
    )
    sqlite = folder / f"{name}.sqlite"
    _write_sqlite(sqlite, table, wkt)
    paths = [text, sqlite]
    if importlib.util.find_spec("h5py") is not None:
        paths.append(_write_hdf5(folder / f"{name}.h5", table, wkt))
    return paths


def trajectory_table(walk: Walk) -> pd.DataFrame:
    """Return id, frame, x, y, z (of the head), ori_x, ori_y of everybody, 25 frames a second."""
    since = walk.crowd_t_s
    parts = []
    across = walk.joint("right_upper_arm") - walk.joint("left_upper_arm")
    for frame, step in enumerate(walk.steps_at(EXPORT_HZ).tolist()):
        joints, _ = crowd_poses(walk.people, float(since[step]))
        yaw = walk.crowd.yaw_rad
        crowd = np.column_stack(
            [
                np.arange(1, len(joints) + 1),
                np.full(len(joints), frame),
                _flat(joints[:, 0][:, [0, 2]]),
                joints[:, 5, 1],
                -np.sin(yaw),
                np.cos(yaw),
            ]
        )
        place = _flat(walk.place_m[step][None])[0]
        if np.isfinite(place).all():
            facing = np.array([across[step, 2], across[step, 0]])
            facing = facing / max(float(np.linalg.norm(facing)), 1e-9)
            own = [PARTICIPANT_ID, frame, *place, walk.joint("head")[step, 1], *facing]
            crowd = np.vstack([own, crowd])
        parts.append(crowd)
    table = pd.DataFrame(
        np.concatenate(parts), columns=["id", "frame", "x", "y", "z", "ori_x", "ori_y"]
    )
    return table.astype({"id": int, "frame": int})


def _write_sqlite(path: Path, table: pd.DataFrame, wkt: str) -> None:
    path.unlink(missing_ok=True)
    at = table.rename(columns={"x": "pos_x", "y": "pos_y"})
    meta = {"version": "2", "fps": f"{EXPORT_HZ:g}"} | {
        f"{axis}{end}": repr(float(getattr(table[axis], end)()))
        for axis in ("x", "y")
        for end in ("min", "max")
    }
    frames = pd.DataFrame({"frame": sorted(set(table["frame"])), "geometry_hash": 1})
    tables = {
        "trajectory_data": at[["frame", "id", "pos_x", "pos_y", "ori_x", "ori_y"]],
        "metadata": pd.DataFrame(list(meta.items()), columns=["key", "value"]),
        "geometry": pd.DataFrame({"hash": [1], "wkt": [wkt]}),
        "frame_data": frames,
    }
    with closing(sqlite3.connect(path)) as connection:
        for name, rows in tables.items():
            rows.to_sql(name, connection, index=False)


def _write_hdf5(path: Path, table: pd.DataFrame, wkt: str) -> Path:
    h5py: Any = importlib.import_module("h5py")
    data = table[["id", "frame", "x", "y", "z"]].to_records(index=False)
    with h5py.File(path, "w") as file:
        dataset = file.create_dataset("trajectory", data=data)
        dataset.attrs["fps"] = EXPORT_HZ
        file.attrs["file_version"] = FILE_VERSION
        file.attrs["wkt_geometry"] = wkt
    return path


def _flat(place_m: Vector) -> Vector:
    """Return places (n, 2) x and z as PedPy's x and y: seen from above, away is up."""
    flat: Vector = np.asarray(place_m, float) * np.array([1.0, -1.0])
    return flat


def _room(place: Vector) -> str:
    """Return the room as text, widened where the way leaves it."""
    half = ROOM_SIDE_M / 2
    if len(place):
        half = max(half, float(np.abs(place).max()) + 0.5)
    corners = ((-half, -half), (half, -half), (half, half), (-half, half), (-half, -half))
    return f"POLYGON (({', '.join(f'{x:g} {y:g}' for x, y in corners)}))"
