"""Write recordings as a data set after the Brain Imaging Data Structure, version 1.11.1.

Gaze goes to `beh/…_recording-eye<1|2|3>_physio.tsv.gz` (left, right, combined), head poses to
`motion/…_tracksys-HMD_motion.tsv`, events and trials to `…_events.tsv`. Times count in seconds
from the first sample or event of the part; every part is a run.
"""

import gzip
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from lab.clock import NS_PER_S
from lab.errors import RecordingError, UsageError
from recording.csv_file import NEUTRALISED, neutralised
from recording.durable import make_folder, replace_file
from recording.journal import as_json
from recording.reader import PART_COLUMN, Recording, require_one_kind
from recording.stream_file import Columns

BIDS_VERSION = "1.11.1"

_EYES = (
    ("eye1", "left", "left_direction_head", "left_valid", "left_pupil_mm"),
    ("eye2", "right", "right_direction_head", "right_valid", "right_pupil_mm"),
    ("eye3", "cyclopean", "direction_head", "valid", None),
)
_GAZE_NEEDS = frozenset(name for eye in _EYES for name in eye[2:] if name)
_HEAD_NEEDS = frozenset(("position_m", "orientation_wxyz", "valid"))


def export_bids(
    recordings: Sequence[Recording], target: Path, *, task: str, dataset_name: str
) -> tuple[Path, ...]:
    """Write a data set of one study to an empty folder and return the files written.

    `task` may hold only letters and digits. Participants keep their labels. Simulated and real
    recordings together are refused.
    """
    if not task.isalnum() or not task.isascii():
        raise UsageError(f"task label {task!r} may hold only letters and digits")
    if not recordings:
        raise UsageError("no recording was given; name at least one session folder")
    require_one_kind(recordings)
    if target.exists() and any(target.iterdir()):
        raise RecordingError(f"{target} is not empty; export into a new folder")
    make_folder(target, exist_ok=True)
    files = _Files(target)
    is_simulated = recordings[0].is_simulated
    files.json("dataset_description.json", _description(dataset_name, is_simulated))
    kind = "Simulated participants; no person was measured." if is_simulated else "Recorded data."
    files.text("README", f"{dataset_name}\n\n{kind}\nWritten by Visavis from session folders.\n")
    labels = sorted({r.manifest.participant for r in recordings})
    files.tsv(
        "participants.tsv",
        pd.DataFrame(
            {"participant_id": [f"sub-{p}" for p in labels], "is_simulated": is_simulated}
        ),
    )
    files.json(
        "participants.json",
        {"is_simulated": {"Description": "whether a model took the place of a person"}},
    )
    for recording in recordings:
        _session(recording, files, task)
    return tuple(files.written)


class _Files:
    """Writes below one folder and remembers what it wrote."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self.written: list[Path] = []

    def bytes(self, name: str, data: bytes) -> None:
        path = self._root / name
        make_folder(path.parent, exist_ok=True)
        replace_file(path, data)
        self.written.append(path)

    def text(self, name: str, text: str) -> None:
        self.bytes(name, text.encode())

    def json(self, name: str, value: Mapping[str, Any]) -> None:
        self.text(name, json.dumps(as_json(value), indent=1, ensure_ascii=False) + "\n")

    def tsv(self, name: str, frame: pd.DataFrame, *, header: bool = True) -> None:
        self.text(name, _tsv(frame, header=header))

    def tsv_gz(self, name: str, frame: pd.DataFrame) -> None:
        raw = io.BytesIO()
        # Without a time stamp and a name the same data give the same bytes.
        with gzip.GzipFile(filename="", mode="wb", fileobj=raw, mtime=0) as file:
            file.write(_tsv(frame, header=False).encode())
        self.bytes(name, raw.getvalue())


def _tsv(frame: pd.DataFrame, *, header: bool) -> str:
    safe, _ = neutralised(frame)
    text: str = safe.to_csv(sep="\t", index=False, header=header, na_rep="n/a", lineterminator="\n")
    return text


def _description(name: str, is_simulated: bool) -> dict[str, Any]:
    return {
        "Name": name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "Visavis", "Description": "export of session folders"}],
        "IsSimulated": is_simulated,
    }


def _session(recording: Recording, files: _Files, task: str) -> None:
    manifest = recording.manifest
    subject, session = f"sub-{manifest.participant}", f"ses-{manifest.session:03d}"
    scans = []
    for part in manifest.parts:
        stem = f"{subject}_{session}_task-{task}"
        base = f"{subject}/{session}"
        gaze = _arrays_with(recording, part.number, _GAZE_NEEDS)
        head = _arrays_with(recording, part.number, _HEAD_NEEDS)
        zero_ns = _first_ns(recording, part.number, gaze, head)
        run = f"run-{part.number}"
        events = _events(recording, part.number, zero_ns)
        files.tsv(f"{base}/beh/{stem}_{run}_events.tsv", events)
        files.json(f"{base}/beh/{stem}_{run}_events.json", _events_notes(recording, events))
        scans.append(f"beh/{stem}_{run}_events.tsv")
        if gaze is not None:
            for eye in _EYES:
                name = f"beh/{stem}_{run}_recording-{eye[0]}_physio"
                table = _eye_table(gaze, eye, zero_ns)
                files.tsv_gz(f"{base}/{name}.tsv.gz", table)
                files.json(f"{base}/{name}.json", _eye_notes(recording, table, eye[1]))
                scans.append(f"{name}.tsv.gz")
        if head is not None:
            name = f"motion/{stem}_tracksys-HMD_{run}"
            table = _head_table(head, zero_ns)
            files.tsv(f"{base}/{name}_motion.tsv", table, header=False)
            files.json(f"{base}/{name}_motion.json", _head_notes(recording, table, task))
            files.tsv(f"{base}/{name}_channels.tsv", _HEAD_CHANNELS)
            files.json(f"{base}/{name}_channels.json", _HEAD_CHANNELS_NOTES)
            scans.append(f"{name}_motion.tsv")
    files.tsv(
        f"{subject}/{session}/{subject}_{session}_scans.tsv", pd.DataFrame({"filename": scans})
    )


def _arrays_with(recording: Recording, part: int, needed: frozenset[str]) -> Columns | None:
    """Return the first stream of a part that has the needed fields and any sample."""
    for name in recording.stream_names:
        schema = recording.stream_schema(name)
        if schema is not None and needed <= {f.name for f in schema.fields}:
            arrays = recording.stream_arrays(name, part=part)
            if len(arrays[PART_COLUMN]):
                return arrays
    return None


def _first_ns(recording: Recording, part: int, *streams: Columns | None) -> int:
    firsts = [int(s["t_host_ns"][0]) for s in streams if s is not None]
    events = recording.events()
    firsts += events.loc[events[PART_COLUMN] == part, "t_ns"].head(1).astype(int).tolist()
    return min(firsts, default=0)


def _seconds(t_ns: npt.NDArray[np.int64], zero_ns: int) -> npt.NDArray[np.float64]:
    return np.asarray((t_ns - zero_ns) / NS_PER_S, dtype=np.float64)


def _eye_table(
    gaze: Columns, eye: tuple[str, str, str, str, str | None], zero_ns: int
) -> pd.DataFrame:
    _, _, direction_name, valid_name, pupil_name = eye
    valid = gaze[valid_name]
    direction = np.where(valid[:, None], gaze[direction_name].astype(np.float64), np.nan)
    x, y, z = direction.T
    columns: dict[str, Any] = {
        "timestamp": _seconds(gaze["t_host_ns"], zero_ns),
        "x_coordinate": np.degrees(np.arctan2(x, -z)),
        "y_coordinate": np.degrees(np.arctan2(y, np.hypot(x, z))),
    }
    if pupil_name is not None:
        columns["pupil_size"] = gaze[pupil_name]
    columns |= {"gaze_x": x, "gaze_y": y, "gaze_z": z}
    columns["valid"] = valid.astype(np.int64)
    columns["t_host_ns"] = gaze["t_host_ns"]
    columns["t_device_ns"] = gaze["t_device_ns"]
    return pd.DataFrame(columns)


def _rate_hz(timestamps_s: pd.Series) -> float:
    """Return the rate measured as the inverse of the median spacing; 0 below two samples."""
    spacing = timestamps_s.diff().median()
    return float(round(1.0 / spacing, 3)) if spacing > 0 else 0.0


def _device(recording: Recording, needle: str) -> Mapping[str, Any]:
    for device in recording.manifest.devices:
        if isinstance(device, Mapping) and needle in str(device.get("role", "")):
            return device
    return {}


def _eye_notes(recording: Recording, table: pd.DataFrame, eye: str) -> dict[str, Any]:
    device = _device(recording, "gaze") or _device(recording, "eye")
    head = "head frame, right-handed, x right, y up, −z forward"
    notes: dict[str, Any] = {
        "SamplingFrequency": _rate_hz(table["timestamp"]),
        "StartTime": float(table["timestamp"].iloc[0]),
        "Columns": list(table.columns),
        "PhysioType": "eyetrack",
        "RecordedEye": eye,
        "SampleCoordinateSystem": "eye-in-head",
        "IsSimulated": recording.is_simulated,
        "timestamp": {"Description": "session time from the start of the run", "Units": "s"},
        "x_coordinate": {
            "Description": f"azimuth of gaze, right positive, 0 straight ahead; {head}",
            "Units": "deg",
        },
        "y_coordinate": {"Description": f"elevation of gaze, up positive; {head}", "Units": "deg"},
        "valid": {"Description": "1 where the tracker vouches for the sample, else 0"},
        "t_host_ns": {"Description": "session clock at arrival", "Units": "ns"},
        "t_device_ns": {"Description": "the tracker's own clock, not corrected", "Units": "ns"},
    }
    for axis in "xyz":
        notes[f"gaze_{axis}"] = {
            "Description": f"unit vector of gaze, {axis}; {head}",
            "Units": "1",
        }
    if "pupil_size" in table:
        notes["pupil_size"] = {"Description": "pupil diameter", "Units": "mm"}
    for key, source in (
        ("Manufacturer", "vendor"),
        ("ManufacturersModelName", "model"),
        ("SoftwareVersions", "driver_version"),
        ("DeviceSerialNumber", "serial"),
    ):
        if device.get(source):
            notes[key] = str(device[source])
    return notes


def _head_table(head: Columns, zero_ns: int) -> pd.DataFrame:
    valid = head["valid"][:, None]
    position = np.where(valid, head["position_m"].astype(np.float64), np.nan)
    w, x, y, z = np.where(valid, head["orientation_wxyz"].astype(np.float64), np.nan).T
    return pd.DataFrame(
        {
            "head_pos_x": position[:, 0],
            "head_pos_y": position[:, 1],
            "head_pos_z": position[:, 2],
            "head_quat_x": x,
            "head_quat_y": y,
            "head_quat_z": z,
            "head_quat_w": w,
            "latency": _seconds(head["t_host_ns"], zero_ns),
        }
    )


_HEAD_CHANNELS = pd.DataFrame(
    [(f"head_pos_{c}", c, "POS", "head", "m", "world") for c in "xyz"]
    + [(f"head_quat_{c}", f"quat_{c}", "ORNT", "head", "n/a", "world") for c in "xyzw"]
    + [("latency", "n/a", "LATENCY", "n/a", "s", "n/a")],
    columns=["name", "component", "type", "tracked_point", "units", "reference_frame"],
)
_HEAD_CHANNELS_NOTES: Mapping[str, Any] = {
    "reference_frame": {
        "Description": "frame in which a channel is expressed",
        "Levels": {
            "world": {
                "SpatialAxes": "RSP",
                "RotationRule": "right-hand",
                "RotationOrder": "n/a",
                "Description": "room frame, right-handed, x right, y up, −z forward",
            }
        },
    }
}


def _head_notes(recording: Recording, table: pd.DataFrame, task: str) -> dict[str, Any]:
    rate_hz = _rate_hz(table["latency"])
    device = _device(recording, "head")
    return {
        "TaskName": task,
        "TrackingSystemName": "HMD",
        "SamplingFrequency": rate_hz,
        "SamplingFrequencyEffective": rate_hz,
        "MotionChannelCount": len(_HEAD_CHANNELS),
        "POSChannelCount": 3,
        "ORNTChannelCount": 4,
        "LATENCYChannelCount": 1,
        "TrackedPointsCount": 1,
        "RecordingDuration": float(table["latency"].iloc[-1] - table["latency"].iloc[0]),
        "MissingValues": "n/a",
        "Manufacturer": str(device.get("vendor") or "n/a"),
        "ManufacturersModelName": str(device.get("model") or "n/a"),
        "IsSimulated": recording.is_simulated,
    }


def _events(recording: Recording, part: int, zero_ns: int) -> pd.DataFrame:
    """Return events and trials, onset and duration in seconds.

    A trial lasts from its row's `t_start_ns` to `t_end_ns`; without them it is the instant of
    its writing.
    """
    rows: list[dict[str, Any]] = []
    events = recording.events()
    for event in events[events[PART_COLUMN] == part].to_dict("records"):
        rows.append(_event_row(event["name"], event["t_ns"], event["t_ns"], zero_ns))
        rows[-1] |= {k: v for k, v in event["payload"].items() if k not in rows[-1]}
    for trial in recording.trial_entries(part):
        row = trial["row"]
        start_ns, end_ns = row.get("t_start_ns"), row.get("t_end_ns")
        if start_ns is None or end_ns is None:
            start_ns = end_ns = trial["t_ns"]
        rows.append(_event_row("trial", start_ns, end_ns, zero_ns))
        rows[-1] |= {k: v for k, v in row.items() if k not in rows[-1]}
    frame = pd.DataFrame(rows, columns=None if rows else ["onset", "duration", "trial_type"])
    return frame.sort_values("onset", kind="stable").reset_index(drop=True)


def _event_row(name: str, start_ns: int, end_ns: int, zero_ns: int) -> dict[str, Any]:
    onset, duration = (start_ns - zero_ns) / NS_PER_S, (end_ns - start_ns) / NS_PER_S
    return {"onset": onset, "duration": duration, "trial_type": name}


def _events_notes(recording: Recording, events: pd.DataFrame) -> dict[str, Any]:
    notes: dict[str, Any] = {
        "onset": {"Description": "session time from the start of the run", "Units": "s"},
        "duration": {"Description": "0 for events of an instant", "Units": "s"},
        "trial_type": {
            "Description": "name of the event; trial carries a trial's factors and results"
        },
        "IsSimulated": recording.is_simulated,
    }
    _, touched = neutralised(events)
    for column in events.columns[3:]:
        note = f"; {NEUTRALISED}" if str(column) in touched else ""
        notes[str(column)] = {"Description": f"{column}, as the study recorded it{note}"}
    return notes
