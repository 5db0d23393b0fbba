"""Write and read gaze as BIDS eye tracking (1.11): one `recording-eyeN_physio` pair per eye.

eye1 is the left, eye2 the right eye, eye3 both combined. Time stamps are integers in
nanoseconds and numbers are written in full, so a round trip loses nothing; missing is `n/a`.
"""

import gzip
import io
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from visavis.analysis.gaze.bids_pauses import Pauses, pauses_in_set
from visavis.analysis.gaze.foreign import EyeSamples, GazeRecording, eye_samples, rows_of
from visavis.analysis.gaze.implausible import without_lost_points
from visavis.analysis.gaze.stamps import typical_step_ns
from visavis.analysis.gaze.text_table import NS_PER_UNIT, TextTable, read_text_table
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import decode_text
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg, yaw_pitch_deg_of
from visavis.lab.plain_files import read_packed
from visavis.lab.screen import FlatScreen
from visavis.recording.bids_sidecar import screen_in_set, sidecar_of
from visavis.recording.durable import make_folder, protect_files

BIDS_VERSION = "1.11.1"
_EYES = {"left": ("eye1", "left"), "right": ("eye2", "right"), "combined": ("eye3", "cyclopean")}
TIME_UNITS = {"seconds": "s", "sec": "s", "milliseconds": "ms", "msec": "ms", "µs": "us"}
UNITS = {"pixels": "pixel", "px": "pixel", "degree": "deg", "degrees": "deg", "radian": "rad"}
"""Words of data sets for the units that BIDS names otherwise."""
_SPACES = {"head": "eye-in-head", "world": "gaze-in-world"}
_GAZE = ("gaze_x", "gaze_y", "gaze_z")
_HEAD_POSITION = ("head_x_m", "head_y_m", "head_z_m")
_HEAD_ORIENTATION = ("head_quat_w", "head_quat_x", "head_quat_y", "head_quat_z")
_AXES = "right-handed; x right, y up, z backward; gaze along −z is straight ahead"
_DESCRIPTIONS: Mapping[str, Mapping[str, str]] = {
    "timestamp": {"Description": "Stamp of the sample", "Units": "ns"},
    "x_coordinate": {"Description": "Azimuth of gaze, positive to the right", "Units": "deg"},
    "y_coordinate": {"Description": "Elevation of gaze, positive upwards", "Units": "deg"},
    "pupil_size": {"Description": "Pupil diameter", "Units": "mm"},
    "openness": {"Description": "Eye openness, 0 closed to 1 open", "Units": "arbitrary"},
    "confidence": {"Description": "The tracker's confidence, 0 to 1", "Units": "arbitrary"},
    "valid": {"Description": "1 when the tracker calls the sample usable"},
    "device_timestamp": {"Description": "The tracker's own stamp", "Units": "ns"},
    **{n: {"Description": f"Gaze unit vector, {_AXES}", "Units": "arbitrary"} for n in _GAZE},
    **{n: {"Description": f"Head position, {_AXES}", "Units": "m"} for n in _HEAD_POSITION},
    **{
        n: {"Description": f"Head orientation in world, {_AXES}", "Units": "arbitrary"}
        for n in _HEAD_ORIENTATION
    },
}


def write_bids(
    recording: GazeRecording, root: Path, *, subject: str, task: str, run: int = 1
) -> tuple[Path, ...]:
    """Write each eye under `root/sub-<subject>/beh`; return the `.tsv.gz` paths.

    Raises UsageError when a label is not letters and digits, or a file is already there.
    """
    for what, label in (("subject", subject), ("task", task)):
        if not (label.isascii() and label.isalnum()):
            raise UsageError(f"{what} {label!r}: BIDS labels are letters and digits only")
    folder = root / f"sub-{subject}" / "beh"
    make_folder(folder, exist_ok=True)
    paths = []
    for name, eye in recording.eyes.items():
        stem = f"sub-{subject}_task-{task}_run-{run}_recording-{_EYES[name][0]}_physio"
        path = folder / f"{stem}.tsv.gz"
        if path.exists():
            raise UsageError(f"{path} is already there; nothing is overwritten, choose another run")
        columns = _columns_of(recording, eye)
        lines = io.StringIO()
        for row in zip(*columns.values(), strict=True):
            lines.write("\t".join(row) + "\n")
        # A fixed mtime: the same data give the same bytes.
        path.write_bytes(gzip.compress(lines.getvalue().encode(), mtime=0))
        description = json.dumps(_sidecar(recording, name, tuple(columns)), indent=2)
        sidecar_path = folder / f"{stem}.json"
        sidecar_path.write_text(description + "\n", encoding="utf-8")
        protect_files([path, sidecar_path])
        paths.append(path)
    return tuple(paths)


def _columns_of(recording: GazeRecording, eye: EyeSamples) -> dict[str, list[str]]:
    yaw, pitch = yaw_pitch_deg_of(eye.direction)
    columns = {
        "timestamp": [str(t) for t in recording.t_ns.tolist()],
        "x_coordinate": _numbers(-yaw),
        "y_coordinate": _numbers(pitch),
        "pupil_size": _numbers(eye.pupil_mm),
        **{n: _numbers(eye.direction[:, k]) for k, n in enumerate(_GAZE)},
        "valid": [str(int(v)) for v in eye.valid.tolist()],
        "openness": _numbers(eye.openness_01),
        "confidence": _numbers(eye.confidence_01),
    }
    if recording.t_device_ns is not None:
        columns["device_timestamp"] = [str(t) for t in recording.t_device_ns.tolist()]
    for names, values in (
        (_HEAD_POSITION, recording.head_position_m),
        (_HEAD_ORIENTATION, recording.head_orientation_wxyz),
    ):
        if values is not None:
            columns |= {n: _numbers(values[:, k]) for k, n in enumerate(names)}
    return columns


def _numbers(values: Vector) -> list[str]:
    return ["n/a" if v != v else repr(v) for v in values.tolist()]


def _sidecar(recording: GazeRecording, eye: str, columns: tuple[str, ...]) -> dict[str, Any]:
    rate_hz = recording.rate_hz
    if rate_hz is None:
        rate_hz = NS_PER_S / typical_step_ns(np.unique(recording.t_ns))
    return {
        "BIDSVersion": BIDS_VERSION,
        "PhysioType": "eyetrack",
        "RecordedEye": _EYES[eye][1],
        "SampleCoordinateSystem": _SPACES[recording.space],
        "SamplingFrequency": rate_hz,
        "SamplingFrequencyStated": recording.rate_hz is not None,
        "StartTime": 0,
        "Columns": list(columns),
        **{name: dict(_DESCRIPTIONS[name]) for name in columns},
        "Notes": dict(recording.notes),
    }


# ---- reading ------------------------------------------------------------------------------


def read_bids(path: Path, screen: FlatScreen | None = None) -> GazeRecording:
    """Read one `*_physio.tsv.gz` of eye tracking together with the other eyes of its run.

    Gaze comes from `gaze_x/y/z` where those are, else from azimuth and elevation in degrees or
    radians, else from pixels of `screen`, or of the screen that the data set describes. Sidecars
    are inherited. Raises DataError for gaze on a screen nobody describes, eyes whose stamps
    differ, or a sidecar that is missing or incomplete.
    """
    head, mark, _ = path.name.partition("_recording-")
    paths = sorted(path.parent.glob(f"{head}{mark}*_physio.tsv.gz")) if mark else [path]
    if path not in paths:
        raise DataError(f"{path}: no such *_physio.tsv.gz file; check the path")
    eyes: dict[str, EyeSamples] = {}
    remarks: list[str] = []
    first: tuple[TextTable, dict[str, Any]] | None = None
    t_ns = np.zeros(0, np.int64)
    for each in paths:
        sidecar = _read_sidecar(each)
        if sidecar.get("PhysioType") != "eyetrack":
            continue
        table = _read_rows(each, sidecar)
        remarks += table.remarks
        stamps = table.stamps("timestamp", _time_unit(each, sidecar))
        if first is None:
            first, t_ns = (table, sidecar), stamps
        elif not np.array_equal(t_ns, stamps):
            raise DataError(
                f"{each}: its stamps differ from those of {first[0].path.name}; import the eyes "
                "one by one from separate folders"
            )
        name = _eye_name(each, sidecar)
        eyes[name] = _read_eye(each, table, sidecar, screen, remarks)
        if table.has("pupil_size") and _pupil_scale(sidecar) is None:
            units = sidecar.get("pupil_size", {}).get("Units", "no unit")
            remarks.append(f"pupil size of {name} is in {units}, not in mm: it was left out")
    if first is None:
        raise DataError(f"{path}: its sidecar does not say PhysioType eyetrack; not eye tracking")
    table, sidecar = first
    space = sidecar["SampleCoordinateSystem"]
    unit = str(sidecar.get("device_timestamp", {}).get("Units", "ns"))
    rate_is_stated = sidecar.get("SamplingFrequencyStated", True)
    recording = GazeRecording(
        name=head or path.stem,
        t_ns=t_ns,
        space="world" if space == "gaze-in-world" else "head",
        left=eyes.get("left"),
        right=eyes.get("right"),
        combined=eyes.get("combined"),
        t_device_ns=table.stamps("device_timestamp", unit)
        if table.has("device_timestamp")
        else None,
        head_position_m=table.vectors(_HEAD_POSITION) if table.has(*_HEAD_POSITION) else None,
        head_orientation_wxyz=table.vectors(_HEAD_ORIENTATION)
        if table.has(*_HEAD_ORIENTATION)
        else None,
        rate_hz=float(sidecar["SamplingFrequency"]) if rate_is_stated else None,
        notes=sidecar.get("Notes", {"format": "BIDS"}),
        remarks=tuple(dict.fromkeys(remarks)),
        time_unit=_time_unit(path, sidecar),
    )
    per_s = NS_PER_S / NS_PER_UNIT[recording.time_unit]
    return _without_pauses(recording, pauses_in_set(path, per_s))


def _without_pauses(recording: GazeRecording, pauses: Pauses) -> GazeRecording:
    """Return a recording that knows where it was paused, without rows that only fill a pause."""
    per_unit = NS_PER_UNIT[recording.time_unit]
    edges_ns = [(round(a * per_unit), round(b * per_unit)) for a, b in pauses]
    fills = np.zeros(len(recording), bool)
    has_gaze = np.zeros(len(recording), bool)
    for eye in recording.eyes.values():
        has_gaze |= np.isfinite(eye.direction).all(axis=1)
    for begin_ns, end_ns in edges_ns:
        fills |= (recording.t_ns >= begin_ns) & (recording.t_ns < end_ns) & ~has_gaze
    own = rows_of(recording, np.flatnonzero(~fills)) if fills.any() else recording
    # No row lies in the middle of a pause; at its edges stamps are rounded.
    first = np.searchsorted(own.t_ns, [(a + b) // 2 for a, b in edges_ns])
    resumed_ns = tuple(int(own.t_ns[row]) for row in first if 0 < row < len(own))
    if not resumed_ns:
        return own
    what = f"the recorder was paused {len(resumed_ns)} times; pauses are no loss"
    if fills.any():
        what += f", and {int(fills.sum())} rows that fill them were left out"
    return replace(own, resumed_ns=resumed_ns, remarks=(*own.remarks, what))


def _read_sidecar(path: Path) -> dict[str, Any]:
    content = sidecar_of(path)
    if not content:
        raise DataError(f"{path}: no sidecar (.json) beside or above it; every table needs one")
    required_keys = ["Columns", "SamplingFrequency"]
    if content.get("PhysioType") == "eyetrack":
        required_keys += ["RecordedEye", "SampleCoordinateSystem"]
    missing = [key for key in required_keys if key not in content]
    if missing:
        raise DataError(
            f"{path}: {', '.join(missing)} missing in its sidecars; add what BIDS requires"
        )
    return content


def _read_rows(path: Path, sidecar: Mapping[str, Any]) -> TextTable:
    try:
        text, _ = decode_text(read_packed(path))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: not a whole gzip text ({error}); copy it again") from error
    names = [str(c) for c in sidecar["Columns"]]
    return read_text_table(path, delimiter="\t", text=text, names=names, decimal=".")


def _time_unit(path: Path, sidecar: Mapping[str, Any]) -> str:
    unit = str(sidecar.get("timestamp", {}).get("Units", "s"))
    unit = TIME_UNITS.get(unit.strip().lower(), unit)
    if unit not in NS_PER_UNIT:
        raise DataError(f"{path}: timestamp Units {unit!r} unknown; use ns, us, ms or s")
    return unit


def _eye_name(path: Path, sidecar: Mapping[str, Any]) -> str:
    names = {"left": "left", "right": "right", "cyclopean": "combined"}
    recorded_eye = str(sidecar["RecordedEye"]).lower()
    if recorded_eye not in names:
        raise DataError(f"{path}: RecordedEye {recorded_eye!r}; use left, right or cyclopean")
    return names[recorded_eye]


def _pupil_scale(sidecar: Mapping[str, Any]) -> float | None:
    """Return millimetres per unit of pupil size; None for arbitrary units and areas."""
    unit = str(sidecar.get("pupil_size", {}).get("Units", "")).strip().lower()
    return {"mm": 1.0, "m": 1e3, "cm": 10.0, "um": 1e-3, "µm": 1e-3}.get(unit)


def _read_eye(
    path: Path,
    table: TextTable,
    sidecar: Mapping[str, Any],
    screen: FlatScreen | None,
    remarks: list[str],
) -> EyeSamples:
    if table.has(*_GAZE):
        direction = table.vectors(_GAZE)
    else:
        direction = _direction_of_coordinates(path, table, sidecar, screen, remarks)

    def optional(name: str) -> Vector | None:
        return table.numbers(name) if table.has(name) else None

    scale, pupil = _pupil_scale(sidecar), optional("pupil_size")
    return eye_samples(
        direction,
        valid=table.flags("valid") if table.has("valid") else None,
        pupil_mm=None if pupil is None or scale is None else scale * pupil,
        openness_01=optional("openness"),
        confidence_01=optional("confidence"),
        pupil_size=pupil if scale is None else None,
    )


def _direction_of_coordinates(
    path: Path,
    table: TextTable,
    sidecar: Mapping[str, Any],
    screen: FlatScreen | None,
    remarks: list[str],
) -> Vector:
    system = sidecar["SampleCoordinateSystem"]
    unit = str(sidecar.get("x_coordinate", {}).get("Units", "deg")).strip().lower()
    unit = UNITS.get(unit, unit)
    points = table.vectors(["x_coordinate", "y_coordinate"])
    if system in _SPACES.values() and unit in ("deg", "rad"):
        angles = np.degrees(points) if unit == "rad" else points
        return direction_from_yaw_pitch_deg(-angles[:, 0], angles[:, 1])
    if system != "gaze-on-screen" or unit != "pixel":
        raise DataError(
            f"{path}: gaze is {system} in {unit}; eye-in-head and gaze-in-world in deg or rad, and "
            "gaze-on-screen in pixel can be placed in 3-D; convert it to angles first"
        )
    points, lost_remarks = without_lost_points(points)
    remarks += lost_remarks
    from_right, from_bottom = False, False
    if screen is None:
        geometry = screen_in_set(path)
        if geometry is None:
            raise DataError(
                f"{path}: gaze is in pixels of a screen, and the set does not describe it "
                "(StimulusPresentation: ScreenDistance, ScreenSize, ScreenResolution in its events "
                "JSON); add it, give --screen, or convert it to angles first"
            )
        screen, (from_right, from_bottom) = geometry.screen, geometry.from_right_and_bottom
        remarks += geometry.remarks
    if from_right:
        points[:, 0] = screen.width_px - points[:, 0]
    if from_bottom:
        points[:, 1] = screen.height_px - points[:, 1]
    return screen.directions_of(points)
