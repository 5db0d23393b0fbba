"""Read BIDS motion of other laboratories, judge it, and write it in our frame and units.

Positions come out in metres and orientations as quaternions (w, x, y, z); axes are x to the right,
y up and z backward where the set says which way its own point. Source: BIDS 1.11, "Motion".
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.gaze.foreign import (
    axes_matrix,
    orientations_in_our_axes,
    quaternions_of_euler,
)
from visavis.analysis.gaze.text_table import TextTable, read_text_table
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import Vector, unit
from visavis.lab.sampling import sampling_of
from visavis.recording.bids_sidecar import sidecar_of
from visavis.recording.csv_file import write_csv
from visavis.recording.durable import make_folder, protect_files

ENDING: Final = "_motion.tsv"
METRES: Final[Mapping[str, float]] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "vm": 1.0}
"""vm is a metre of a virtual room."""
MAX_SPEED_M_S: Final = 13.0
"""No person's hand, foot or head is faster for long; sprinters reach 12.4 m/s."""
MAX_FAST_01: Final = 0.01
MAX_REACH_M: Final = 200.0
MIN_RATE_HZ: Final = 0.01
MAX_RATE_HZ: Final = 1e6
"""Stamps of a nominal rate are whole nanoseconds, all of them different."""
_AXIS_OF_LETTER: Final = {
    **dict.fromkeys("AF", ("forward", "+")),
    **dict.fromkeys("PB", ("forward", "-")),
    "R": ("right", "+"),
    "L": ("right", "-"),
    **dict.fromkeys("SU", ("up", "+")),
    **dict.fromkeys("ID", ("up", "-")),
}


@dataclass(frozen=True)
class TrackedPoint:
    """A point of the body or a device: `position_m` (n, 3), `orientation_wxyz` (n, 4), or None.

    NaN where it was not seen.
    """

    name: str
    position_m: Vector | None = field(repr=False)
    orientation_wxyz: Vector | None = field(repr=False)


@dataclass(frozen=True)
class ForeignMotion:
    """Motion of one tracking system: stamps (n,) and its points; `remarks` say how it was read."""

    name: str
    t_ns: npt.NDArray[np.int64] = field(repr=False)
    points: tuple[TrackedPoint, ...]
    remarks: tuple[str, ...]


def read_bids_motion(path: Path) -> ForeignMotion:
    """Read one `*_motion.tsv` by its channels and sidecars, inherited ones included.

    Without a latency channel stamps follow from the nominal rate, and that is told. Channels that
    are neither position, orientation nor latency are counted and left out.

    Raises:
        UsageError: no such file, or none of motion.
        DataError: no sample, channels that are not the table's, units or axes that are unknown.
    """
    if not path.name.endswith(ENDING):
        raise UsageError(f"{path} is no BIDS motion; give a file that ends in {ENDING}")
    channels = _channels(path)
    names = [f"{name}/{k}" for k, name in enumerate(channels.column("name"))]
    table = read_text_table(path, delimiter="\t", names=names, decimal=".")
    sidecar = sidecar_of(path)
    frames = _object(path, _object(path, sidecar_of(path, "channels"), "reference_frame"), "Levels")
    kinds = [cell.strip().upper() for cell in channels.column("type")]
    components = [cell.strip().lower() for cell in channels.column("component")]
    roles = tuple(zip(kinds, components, strict=True))
    remarks = list(table.remarks)
    t_ns = _times(path, table, names, kinds, channels, sidecar, remarks)
    points, columns_of = [], defaultdict[str, list[int]](list)
    for k, name in enumerate(channels.column("tracked_point")):
        columns_of[name].append(k)
    for name, own in columns_of.items():
        point = _point(path, name, own, (table, names, roles, channels), frames, remarks)
        if point is not None:
            points.append(point)
    other = sum(kind not in ("POS", "ORNT", "LATENCY") for kind in kinds)
    if other:
        remarks.append(f"{other} channels are neither position, orientation nor latency: left out")
    if not points:
        raise DataError(f"{path}: no position and no orientation in its channels")
    return ForeignMotion(
        path.name.removesuffix(ENDING), t_ns, tuple(points), tuple(dict.fromkeys(remarks))
    )


def _channels(path: Path) -> TextTable:
    file = path.with_name(path.name.removesuffix(ENDING) + "_channels.tsv")
    if not file.is_file():
        raise DataError(f"{path}: {file.name} is not beside it; BIDS motion needs its channels")
    channels = read_text_table(file, delimiter="\t", decimal=".")
    for name in ("name", "component", "type", "tracked_point", "units"):
        channels.column(name)
    return channels


def _object(path: Path, content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    value = content.get(name, {})
    if not isinstance(value, Mapping):
        raise DataError(f"{path}: {name} of its channels is no object; mend the sidecar")
    return value


def _times(
    path: Path,
    table: TextTable,
    names: Sequence[str],
    kinds: Sequence[str],
    channels: TextTable,
    sidecar: Mapping[str, Any],
    remarks: list[str],
) -> npt.NDArray[np.int64]:
    if "LATENCY" in kinds:
        k = kinds.index("LATENCY")
        unit_name = channels.column("units")[k].strip().lower()
        return table.stamps(names[k], {"ms": "ms", "milliseconds": "ms"}.get(unit_name, "s"))
    rate_hz = sidecar.get("SamplingFrequencyEffective") or sidecar.get("SamplingFrequency")
    if rate_hz is True or not isinstance(rate_hz, int | float):
        rate_hz = 0.0
    if not MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ:
        raise DataError(
            f"{path}: neither a latency channel nor a SamplingFrequency of {MIN_RATE_HZ:g} to "
            f"{MAX_RATE_HZ:g} Hz; add one"
        )
    remarks.append(
        f"no latency: stamps follow from {rate_hz:.6g} Hz, and nobody can tell whether samples "
        "were lost"
    )
    t_ns: npt.NDArray[np.int64] = np.rint(np.arange(len(table)) * (NS_PER_S / rate_hz)).astype(
        np.int64
    )
    return t_ns


@np.errstate(over="ignore", invalid="ignore")  # what overflows is refused, or was not seen
def _point(
    path: Path,
    name: str,
    own: Sequence[int],
    content: tuple[TextTable, Sequence[str], Sequence[tuple[str, str]], TextTable],
    frames: Mapping[str, Any],
    remarks: list[str],
) -> TrackedPoint | None:
    table, names, roles, channels = content
    column_of = {roles[k]: k for k in own}
    places = [column_of.get(("POS", axis)) for axis in "xyz"]
    angles = [column_of.get(("ORNT", axis)) for axis in "xyz"]
    turns = [column_of.get(("ORNT", f"quat_{axis}")) for axis in "wxyz"]
    if None in places and None in angles and None in turns:
        return None
    first = next(k for k in (*places, *angles, *turns) if k is not None)
    label = channels.column("reference_frame")[first] if channels.has("reference_frame") else ""
    frame = _object(path, frames, label)
    matrix = _matrix(path, str(frame.get("SpatialAxes", "")), remarks)

    def values(columns: Sequence[int | None]) -> Vector:
        return table.vectors([names[k] for k in columns if k is not None])

    position = orientation = None
    if None not in places:
        unit_name = channels.column("units")[first].strip()
        if unit_name not in METRES:
            raise DataError(f"{path}: {name} is in {unit_name or 'no unit'}; use m, cm or mm")
        position = METRES[unit_name] * values(places) @ matrix.T
        if unit_name == "vm":
            remarks.append("positions are in metres of a virtual room (vm)")
        _refuse_other_unit(path, name, position)
    if None not in turns:
        orientation = orientations_in_our_axes(unit(values(turns)), matrix)
    elif None not in angles:
        is_rad = channels.column("units")[angles[0] or 0].strip().lower().startswith("rad")
        degrees = np.degrees(values(angles)) if is_rad else values(angles)
        # A rule that is not the axes' own turns the other way.
        is_left_handed = np.linalg.det(matrix) < 0
        rule = str(frame.get("RotationRule", "left-hand" if is_left_handed else "right-hand"))
        degrees = degrees if rule.startswith("left") == is_left_handed else -degrees
        order = str(frame.get("RotationOrder", "")).lower()
        if sorted(order) != ["x", "y", "z"]:
            remarks.append(f"orientations of {name} have no RotationOrder: they were left out")
        else:
            orientation = orientations_in_our_axes(quaternions_of_euler(degrees, order), matrix)
    return TrackedPoint(name, position, orientation)


def _matrix(path: Path, axes: str, remarks: list[str]) -> Vector:
    """Return the map to our axes; as they stand, and told, where the set does not say."""
    letters = axes.strip().upper()
    if not letters:
        remarks.append("the set does not say which way its axes point: they stay as they are")
        return np.eye(3)
    signs = [_AXIS_OF_LETTER.get(letter) for letter in letters]
    if len(letters) != 3 or None in signs or len({k[0] for k in signs if k}) != 3:
        raise DataError(
            f"{path}: SpatialAxes {axes[:9]!r} are none; three letters such as ALS, FRU"
        )
    own = {k[0]: f"{k[1]}{axis}" for k, axis in zip(signs, "xyz", strict=True) if k}
    return axes_matrix(own["right"], own["up"], own["forward"])


def _refuse_other_unit(path: Path, name: str, position_m: Vector) -> None:
    whole_m = position_m[np.isfinite(position_m).all(axis=1)]
    reach = float(np.ptp(whole_m, axis=0).max()) if len(whole_m) else 0.0
    if reach > MAX_REACH_M:
        raise DataError(
            f"{path}: {name} moves over {reach:.4g} m; is the unit mm? Correct units in its "
            "channels"
        )


def quality_of_motion(motion: ForeignMotion) -> pd.DataFrame:
    """Return one row per point: rate, what is missing, and how fast it moved."""
    t_ns, rows = motion.t_ns, []
    sampling = sampling_of(t_ns) if len(t_ns) > 2 and (np.diff(t_ns) > 0).all() else None
    for point in motion.points:
        values = point.position_m if point.position_m is not None else point.orientation_wxyz
        if values is None:
            continue
        is_seen = np.isfinite(values).all(axis=1) & (values != 0).any(axis=1)
        speed = np.zeros(0)
        if point.position_m is not None and is_seen.sum() > 1:
            steps = np.linalg.norm(np.diff(point.position_m[is_seen], axis=0), axis=1)
            spans_s = np.diff(t_ns[is_seen]) / NS_PER_S
            speed = steps[spans_s > 0] / spans_s[spans_s > 0]
        rows.append(
            {
                "recording": motion.name,
                "point": point.name,
                "rows": len(t_ns),
                "rate_hz": sampling.rate_hz if sampling else np.nan,
                "lost_rows_01": sampling.lost_01 if sampling else np.nan,
                "gaps": sampling.gaps if sampling else 0,
                "unseen_01": float((~is_seen).mean()),
                "speed_median_m_s": float(np.median(speed)) if speed.size else np.nan,
                "speed_p99_m_s": float(np.percentile(speed, 99)) if speed.size else np.nan,
                "too_fast_01": float((speed > MAX_SPEED_M_S).mean()) if speed.size else np.nan,
            }
        )
    return pd.DataFrame(rows)


def motion_table(motion: ForeignMotion) -> pd.DataFrame:
    """Return one row per stamp and point, in our frame and units; missing where it was not seen."""
    tables = []
    for point in motion.points:
        columns: dict[str, Any] = {
            "t_ns": motion.t_ns,
            "t_ms": (motion.t_ns - motion.t_ns[0]) / NS_PER_MS,
            "point": point.name,
        }
        for name, values, axes in (
            ("position_{}_m", point.position_m, "xyz"),
            ("orientation_{}", point.orientation_wxyz, "wxyz"),
        ):
            for k, axis in enumerate(axes):
                columns[name.format(axis)] = np.nan if values is None else values[:, k]
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def import_motion(files: Sequence[Path], folder: Path) -> dict[str, tuple[str, ...]]:
    """Write `NAME_quality.csv` and `NAME_motion.csv` of each file; return remarks by name.

    All files are read before anything is written.

    Raises:
        UsageError: a file is already there, or two recordings bear one name.
        DataError: as `read_bids_motion`, of all files at once.
    """
    motions, problems = [], []
    for file in files:
        try:
            motions.append(read_bids_motion(file))
        except DataError as error:
            if len(files) == 1:
                raise
            problems.append(str(error))
    if problems:
        raise DataError("\n".join((f"{len(problems)} of {len(files)} files:", *problems)))
    names = [motion.name for motion in motions]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise UsageError(f"two recordings are named {twice}; import them into folders of their own")
    paths = [folder / f"{name}_{kind}.csv" for name in names for kind in ("quality", "motion")]
    if there := next((path for path in paths if path.exists()), None):
        raise UsageError(f"{there} is already there; give an empty folder")
    make_folder(folder, exist_ok=True)
    remarks = {}
    for motion, (quality_path, motion_path) in zip(
        motions, zip(paths[::2], paths[1::2], strict=True), strict=True
    ):
        quality = quality_of_motion(motion)
        write_csv(quality, quality_path)
        write_csv(motion_table(motion), motion_path)
        remarks[motion.name] = (*motion.remarks, *_remarks_on(motion, quality))
    protect_files(paths)
    return remarks


def _remarks_on(motion: ForeignMotion, quality: pd.DataFrame) -> list[str]:
    remarks = []
    if (np.diff(motion.t_ns) <= 0).any():
        remarks.append("stamps repeat or go back: nothing is said of the rate")
    for row in quality.to_dict("records"):
        if row["unseen_01"] > 0:
            remarks.append(f"{row['point']} was not seen in {row['unseen_01']:.1%} of its rows")
        if row["too_fast_01"] > MAX_FAST_01:
            remarks.append(
                f"{row['point']} is faster than {MAX_SPEED_M_S:g} m/s in {row['too_fast_01']:.1%} "
                "of its steps, which no person is: is the unit or the rate another?"
            )
    return remarks
