"""Write recordings as a data set after the Brain Imaging Data Structure, version 1.11.1.

Gaze goes to `beh/…_recording-eye<1|2|3>_physio.tsv.gz` (left, right, combined), head poses to
`motion/…_tracksys-HMD_motion.tsv` (before a screen `tracksys-eyetracker`, or nothing where the head
rests), tracked bodies to `motion/…_tracksys-<stream>_motion.tsv`, other
streams of devices to `beh/…_recording-<name>_physio.tsv.gz` (those without a rate to the events),
events and trials to `…_events.tsv` beside both, and who and what stood where to `stimuli/`, one
file for every arrangement, named by `stim_file` of the events. Times count in seconds from the
first sample or event of the part; every part is a run.
"""

import gzip
import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import RecordingError, UsageError
from visavis.lab.sampling import step_ns_of
from visavis.lab.schema import StreamSchema
from visavis.lab.version import version
from visavis.recording.bids_about import DatasetAbout
from visavis.recording.blurring import segments_of
from visavis.recording.csv_file import ESCAPE_NOTE, escape_formulas
from visavis.recording.durable import make_folder, replace_file
from visavis.recording.journal import as_json
from visavis.recording.number_table import holds_numbers, tsv_of_numbers
from visavis.recording.reader import (
    PART_COLUMN,
    Recording,
    component_names,
    flat_components,
    require_one_kind,
)
from visavis.recording.stream_file import Columns

BIDS_VERSION = "1.11.1"
NO_TIME = -(2**63)
"""Value of an unknown time in a stream: `visavis.devices.streams.NO_DEVICE_TIME`."""
NOTHING_SAID = DatasetAbout()
MISSING = "n/a"
GZIP_LEVEL = 1
"""Recorded numbers hardly shrink further: 5 % for twice the time."""

_EYES = (
    ("eye1", "left", "left_direction_head", "left_valid", "left_pupil_mm"),
    ("eye2", "right", "right_direction_head", "right_valid", "right_pupil_mm"),
    ("eye3", "cyclopean", "direction_head", "valid", None),
)
HEAD_MEASURED = "head_measured"
MAX_FORESEEN_NS = NS_PER_S
"""A pose is foreseen for a later time on the session's clock; farther away it is another clock."""
BOOKKEEPING = frozenset(
    (
        "frames",
        "frame_timing",
        "scene_states",
        "gaze_targets",
        "gaze_window",
        "drawn",
        "drawn_gpu",
        "drawn_views",
        "pointer",
    )
)
"""Streams about the session itself (what was shown and when), which mean nothing without it."""

_ARRANGEMENTS: Mapping[str, str] = {"scene": "agents", "crowd": "people"}
"""Events that describe an arrangement of people, and the key that holds it."""

FILES: Mapping[str, str] = {
    "beh/*_recording-eye1_physio.tsv.gz": "gaze of the left eye (eye2: right, eye3: combined)",
    "beh/*_physio.tsv.gz": "other streams of devices, with the units of every column",
    "beh/*_events.tsv": "events, trials with their results, presses (the same beside motion)",
    "stimuli/*.json": "who and what stood where, as `stim_file` of the events names it",
    "motion/*_tracksys-HMD_motion.tsv": "poses of the head in the room",
    "motion/*_tracksys-body_motion.tsv": "poses of the body's segments in the room",
}
_GAZE_NEEDS = frozenset(name for eye in _EYES for name in eye[2:] if name)
_HEAD_NEEDS = frozenset(("position_m", "orientation_wxyz", "valid"))


def export_bids(
    recordings: Sequence[Recording],
    target: Path,
    *,
    task: str,
    dataset_name: str,
    about: DatasetAbout = NOTHING_SAID,
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
    files.json("dataset_description.json", _description(dataset_name, is_simulated, about))
    files.text("README.md", about.readme(dataset_name, is_simulated=is_simulated, streams=FILES))
    people = _people(recordings)
    files.tsv("participants.tsv", people)
    files.json("participants.json", {c: _PEOPLE[c] for c in people.columns[1:]})
    for recording in recordings:
        _session(recording, files, task, about)
    return tuple(files.paths)


_PEOPLE: Mapping[str, Mapping[str, Any]] = {
    "is_simulated": {"Description": "whether a model took the place of a person"},
    "age": {"Description": "age as told, at the first session", "Units": "years"},
    "age_band": {"Description": "the ten years in which the age lies, at the first session"},
    "gender": {"Description": "gender as told"},
}


def _people(recordings: Sequence[Recording]) -> pd.DataFrame:
    """Return a row per participant with the answers to demographic questions."""
    rows: dict[str, dict[str, Any]] = {}
    for recording in recordings:
        label = f"sub-{recording.manifest.participant}"
        row = {"participant_id": label, "is_simulated": recording.is_simulated}
        events = recording.events()
        for payload in events.loc[events["name"] == "answer", "payload"]:
            question, answer = payload.get("question"), payload.get("answer")
            if question == "age" and answer is not None:
                row["age_band" if "-" in str(answer) else "age"] = answer
            elif question == "gender" and answer is not None:
                row["gender"] = str(payload.get("label") or answer)
        rows.setdefault(label, row)
    table = pd.DataFrame([rows[label] for label in sorted(rows)])
    return table[["participant_id", *(c for c in _PEOPLE if c in table)]]


class _Files:
    """Writes below one folder and remembers what it wrote."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self.paths: list[Path] = []

    def bytes(self, name: str, data: bytes) -> None:
        path = self._root / name
        make_folder(path.parent, exist_ok=True)
        replace_file(path, data)
        self.paths.append(path)

    def text(self, name: str, text: str) -> None:
        self.bytes(name, text.encode())

    def json(self, name: str, value: Mapping[str, Any]) -> None:
        self.text(name, json.dumps(as_json(value), indent=1, ensure_ascii=False) + "\n")

    def stimulus(self, name: str, content: Mapping[str, Any]) -> str:
        """Write an arrangement once, however often it was shown; return its name in `stimuli`."""
        text = json.dumps(as_json(content), indent=1, ensure_ascii=False) + "\n"
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        label = _label(str(content.get("scene_name") or name))
        file = f"{label}_{digest}.json"
        if self._root / "stimuli" / file not in self.paths:
            self.text(f"stimuli/{file}", text)
        return file

    def tsv(self, name: str, frame: pd.DataFrame, *, header: bool = True) -> None:
        self.bytes(name, _tsv(frame, header=header))

    def tsv_gz(self, name: str, frame: pd.DataFrame) -> None:
        raw = io.BytesIO()
        # Without a time stamp and a name the same data give the same bytes.
        with gzip.GzipFile("", "wb", GZIP_LEVEL, raw, mtime=0) as file:
            file.write(_tsv(frame, header=False))
        self.bytes(name, raw.getvalue())


def _tsv(frame: pd.DataFrame, *, header: bool) -> bytes:
    if not header and holds_numbers(frame):
        return tsv_of_numbers(frame, na_rep=MISSING)
    safe, _ = escape_formulas(frame)
    text: str = safe.to_csv(
        sep="\t", index=False, header=header, na_rep=MISSING, lineterminator="\n"
    )
    return text.encode()


def _description(name: str, is_simulated: bool, about: DatasetAbout) -> dict[str, Any]:
    return {
        **about.description_fields(),
        "Name": name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [
            {
                "Name": "Visavis",
                "Version": version(),
                "Description": "export of session folders",
            }
        ],
        "IsSimulated": is_simulated,
    }


def _session(recording: Recording, files: _Files, task: str, about: DatasetAbout) -> None:
    manifest = recording.manifest
    common_fields = {"TaskName": task, **_task_fields(recording, about), **about.place_fields()}
    subject, session = f"sub-{manifest.participant}", f"ses-{manifest.session:03d}"
    scans = []
    for part in manifest.parts:
        stem = f"{subject}_{session}_task-{task}"
        base = f"{subject}/{session}"
        gaze = _arrays_with(recording, part.number, _GAZE_NEEDS)
        head = _head_poses(recording, part.number)
        zero_ns = _first_ns(recording, part.number, gaze, head)
        run = f"run-{part.number}"
        events = _with_stimuli(_events(recording, part.number, zero_ns), files)
        bodies = _bodies(recording, part.number)
        head = head if _head_system(recording) else None
        notes = {**_events_notes(recording, events), **common_fields}
        # BIDS wants events beside every kind of data; both copies are the same.
        for kind in ("beh", *(["motion"] if head is not None or bodies else [])):
            files.tsv(f"{base}/{kind}/{stem}_{run}_events.tsv", events)
            files.json(f"{base}/{kind}/{stem}_{run}_events.json", notes)
            scans.append(f"{kind}/{stem}_{run}_events.tsv")
        if gaze is not None:
            for eye in _EYES:
                name = f"beh/{stem}_{run}_recording-{eye[0]}_physio"
                table = _eye_table(gaze, eye, zero_ns)
                files.tsv_gz(f"{base}/{name}.tsv.gz", table)
                files.json(
                    f"{base}/{name}.json",
                    _eye_notes(recording, table, eye[1], rate_hz(gaze)) | common_fields,
                )
                scans.append(f"{name}.tsv.gz")
        for stream in _others(recording):
            schema = recording.stream_schema(stream)
            arrays = recording.stream_arrays(stream, part=part.number)
            if schema is None or not schema.nominal_rate_hz or not len(arrays[PART_COLUMN]):
                continue
            name = f"beh/{stem}_{run}_recording-{_label(stream)}_physio"
            table = _stream_table(arrays, zero_ns)
            files.tsv_gz(f"{base}/{name}.tsv.gz", table)
            files.json(
                f"{base}/{name}.json",
                _stream_notes(recording, schema, table, rate_hz(arrays)) | common_fields,
            )
            scans.append(f"{name}.tsv.gz")
        for system, poses, points in ((_head_system(recording), head, ("head",)), *bodies):
            if poses is None:
                continue
            name = f"motion/{stem}_tracksys-{system}_{run}"
            table = _motion_table(poses, points, zero_ns)
            notes = _motion_notes(recording, table, points, system, rate_hz(poses))
            files.tsv(f"{base}/{name}_motion.tsv", table, header=False)
            files.json(f"{base}/{name}_motion.json", notes | common_fields)
            files.tsv(f"{base}/{name}_channels.tsv", _channels(points))
            files.json(f"{base}/{name}_channels.json", _HEAD_CHANNELS_NOTES)
            scans.append(f"{name}_motion.tsv")
    files.tsv(
        f"{subject}/{session}/{subject}_{session}_scans.tsv", pd.DataFrame({"filename": scans})
    )


def _bodies(recording: Recording, part: int) -> list[tuple[str, Columns, tuple[str, ...]]]:
    """Return the bodies tracked in a part: name of the stream, poses, names of its segments."""
    bodies = []
    for name in recording.stream_names:
        schema = recording.stream_schema(name)
        if schema is not None and name not in BOOKKEEPING and _is_body(schema):
            arrays = recording.stream_arrays(name, part=part)
            if len(arrays[PART_COLUMN]):
                bodies.append((_label(name), arrays, segments_of(schema)))
    return bodies


def _arrays_with(recording: Recording, part: int, fields: frozenset[str]) -> Columns | None:
    """Return the first stream of a part that has the needed fields, one pose and any sample."""
    for name in recording.stream_names:
        schema = recording.stream_schema(name)
        if schema is None or name in BOOKKEEPING or _is_body(schema):
            continue
        if fields <= {f.name for f in schema.fields}:
            arrays = recording.stream_arrays(name, part=part)
            if len(arrays[PART_COLUMN]):
                return arrays
    return None


def _head_poses(recording: Recording, part: int) -> Columns | None:
    """Return the head's poses of a part, dated by the time that they describe.

    Measured poses where there are any; a foreseen one describes the time of its light.
    """
    if HEAD_MEASURED in recording.stream_names:
        measured = recording.stream_arrays(HEAD_MEASURED, part=part)
        if len(measured[PART_COLUMN]):
            return {**measured, "t_host_ns": measured["t_device_ns"]}
    head = _arrays_with(recording, part, _HEAD_NEEDS)
    if head is None:
        return None
    is_foreseen = np.abs(head["t_device_ns"] - head["t_host_ns"]) <= MAX_FORESEEN_NS
    return {**head, "t_host_ns": head["t_device_ns"]} if is_foreseen.all() else head


def _is_body(schema: StreamSchema) -> bool:
    return any(f.name == "position_m" and len(f.shape) == 2 for f in schema.fields)


def _others(recording: Recording) -> list[str]:
    """Return the streams of devices that are neither gaze nor poses."""
    names = []
    for name in recording.stream_names:
        schema = recording.stream_schema(name)
        fields = set() if schema is None else {f.name for f in schema.fields}
        if schema is not None and name not in BOOKKEEPING:
            if not _GAZE_NEEDS <= fields and not _HEAD_NEEDS <= fields:
                names.append(name)
    return names


def _label(name: str) -> str:
    return "".join(c for c in name if c.isascii() and c.isalnum())


def _task_fields(recording: Recording, about: DatasetAbout) -> dict[str, Any]:
    """Return the task's description and instructions."""
    plan = recording.manifest.plan
    blocks = plan.get("blocks", ()) if isinstance(plan, Mapping) else ()
    instructions = [str(b.get("instruction", "")) for b in blocks if b.get("instruction")]
    fields = {
        "TaskDescription": about.description or f"the study {recording.manifest.study}",
        "Instructions": "\n\n".join(dict.fromkeys(instructions)) or "n/a",
    }
    return {key: value for key, value in fields.items() if value}


def _screen(recording: Recording) -> Mapping[str, Any]:
    """Return the settings of the screen; empty when there was none."""
    configuration = recording.manifest.configuration
    screen = configuration.get("screen") if isinstance(configuration, Mapping) else None
    return screen if isinstance(screen, Mapping) else {}


def _screen_fields(recording: Recording) -> dict[str, Any]:
    """Return the fields about the screen: distance and size in metres, pixels right and down."""
    screen = _screen(recording)
    if not screen:
        return {}
    return {
        "ScreenDistance": screen["distance_m"],
        "ScreenOrigin": ["top", "left"],
        "ScreenRefreshRate": screen["rate_hz"],
        "ScreenResolution": [screen["width_px"], screen["height_px"]],
        "ScreenSize": [screen["width_m"], screen["height_m"]],
        "HeadStabilization": "chin-rest" if screen["head"] == "fixed" else "none",
    }


def _head_system(recording: Recording) -> str:
    """Return the name of the head tracker; empty when the head rests in a chin rest."""
    head = _screen(recording).get("head")
    return {None: "HMD", "tracked": "eyetracker"}.get(head, "")


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


def rate_hz(samples: Columns) -> float:
    """Return a stream's rate, gaps left out; 0 below two samples.

    It comes from the device's own stamps, which may be coarse (whole milliseconds) but do not come
    in bunches as samples arrive; where it has no clock, from arrivals.
    """
    stamps_ns = samples["t_device_ns"]
    if len(stamps_ns) < 2 or np.median(np.diff(stamps_ns)) <= 0:
        stamps_ns = samples["t_host_ns"]
    if not len(stamps_ns):
        return 0.0
    highest = np.maximum.accumulate(stamps_ns)
    distinct = stamps_ns[np.append(True, np.diff(highest) > 0)]  # one that goes back is left out
    if len(distinct) < 2:
        return 0.0
    step_ns = step_ns_of(distinct) if len(distinct) > 2 else float(distinct[1] - distinct[0])
    return float(round(NS_PER_S / step_ns, 3))


def _device(recording: Recording, needle: str) -> Mapping[str, Any]:
    for device in recording.manifest.devices:
        if isinstance(device, Mapping) and needle in str(device.get("role", "")):
            return device
    return {}


def _eye_notes(
    recording: Recording, table: pd.DataFrame, eye: str, measured_hz: float
) -> dict[str, Any]:
    device = _device(recording, "gaze") or _device(recording, "eye")
    head = "head frame, right-handed, x right, y up, −z forward"
    notes: dict[str, Any] = {
        "SamplingFrequency": measured_hz,
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
    return notes | _device_fields(device)


def _device_fields(device: Mapping[str, Any]) -> dict[str, str]:
    return {
        key: str(device.get(source) or "n/a")
        for key, source in (
            ("Manufacturer", "vendor"),
            ("ManufacturersModelName", "model"),
            ("SoftwareVersions", "driver_version"),
            ("DeviceSerialNumber", "serial"),
        )
    }


def _stream_table(arrays: Columns, zero_ns: int) -> pd.DataFrame:
    """Return any stream's samples, a column for every component of a field."""
    columns: dict[str, Any] = {"timestamp": _seconds(arrays["t_host_ns"], zero_ns)}
    for field, values in arrays.items():
        if field not in ("seq", PART_COLUMN):
            for name, column in flat_components(field, values):
                columns[name] = column.astype(np.int64) if column.dtype == bool else column
    return pd.DataFrame(columns)


def _stream_notes(
    recording: Recording, schema: StreamSchema, table: pd.DataFrame, measured_hz: float
) -> dict[str, Any]:
    notes: dict[str, Any] = {
        "SamplingFrequency": measured_hz or float(schema.nominal_rate_hz),
        "StartTime": float(table["timestamp"].iloc[0]),
        "Columns": list(table.columns),
        "PhysioType": "generic",
        "IsSimulated": recording.is_simulated,
        "timestamp": {"Description": "session time from the start of the run", "Units": "s"},
        "t_host_ns": {"Description": "session clock at arrival", "Units": "ns"},
        "t_device_ns": {"Description": "the device's own clock, not corrected", "Units": "ns"},
    }
    for field in schema.fields:
        size = int(np.prod(field.shape)) if field.shape else 1
        for name in component_names(field.name, size) if field.shape else [field.name]:
            frame = f"; {field.frame} frame" if field.frame else ""
            description = field.description or field.name.replace("_", " ")
            notes[name] = {"Description": f"{description}{frame}", "Units": field.unit or "n/a"}
    return notes | _device_fields(_device(recording, schema.name.partition("_")[0]))


def _motion_table(poses: Columns, points: Sequence[str], zero_ns: int) -> pd.DataFrame:
    n, m = len(poses["t_host_ns"]), len(points)
    valid = poses["valid"].reshape(n, m, 1)
    position = poses["position_m"].astype(np.float64).reshape(n, m, 3)
    turn = poses["orientation_wxyz"].astype(np.float64).reshape(n, m, 4)
    position, turn = np.where(valid, position, np.nan), np.where(valid, turn, np.nan)
    columns: dict[str, Any] = {}
    for i, point in enumerate(points):
        columns |= {f"{point}_pos_{c}": position[:, i, k] for k, c in enumerate("xyz")}
        columns |= {
            f"{point}_quat_{c}": turn[:, i, k] for c, k in zip("xyzw", (1, 2, 3, 0), strict=True)
        }
    columns["latency"] = _seconds(poses["t_host_ns"], zero_ns)
    return pd.DataFrame(columns)


def _channels(points: Sequence[str]) -> pd.DataFrame:
    rows = []
    for p in points:
        rows += [(f"{p}_pos_{c}", c, "POS", p, "m", "world") for c in "xyz"]
        rows += [(f"{p}_quat_{c}", f"quat_{c}", "ORNT", p, "n/a", "world") for c in "xyzw"]
    return pd.DataFrame(
        [*rows, ("latency", "n/a", "LATENCY", "n/a", "s", "n/a")],
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


_NO_CHANNELS = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "MAGN", "MISC", "VEL")
"""Kinds of channels of motion that no tracker here has."""


def _motion_notes(
    recording: Recording,
    table: pd.DataFrame,
    points: Sequence[str],
    system: str,
    measured_hz: float,
) -> dict[str, Any]:
    role = {"HMD": "head", "eyetracker": "eye"}.get(system, system)
    device = _device(recording, role)
    return {
        "TrackingSystemName": system,
        "SamplingFrequency": measured_hz,
        "SamplingFrequencyEffective": measured_hz,
        "MotionChannelCount": len(table.columns),
        "POSChannelCount": 3 * len(points),
        "ORNTChannelCount": 4 * len(points),
        "LATENCYChannelCount": 1,
        **{f"{kind}ChannelCount": 0 for kind in _NO_CHANNELS},
        "TrackedPointsCount": len(points),
        "SubjectArtefactDescription": "n/a",
        "RecordingDuration": float(table["latency"].iloc[-1] - table["latency"].iloc[0]),
        "MissingValues": "n/a",
        **_device_fields(device),
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
    for name in _others(recording):
        schema = recording.stream_schema(name)
        if schema is not None and not schema.nominal_rate_hz:
            rows += _event_rows(name, recording.stream_arrays(name, part=part), zero_ns)
    frame = pd.DataFrame(rows, columns=None if rows else ["onset", "duration", "trial_type"])
    return frame.sort_values("onset", kind="stable").reset_index(drop=True)


def _with_stimuli(events: pd.DataFrame, files: _Files) -> pd.DataFrame:
    """Move each arrangement out of the events into its own file, and put the file's name there."""
    names: dict[Any, str] = {}
    for name, key in _ARRANGEMENTS.items():
        if key not in events:
            continue
        arrangements = events[
            (events["trial_type"] == name) & events[key].map(bool) & events[key].notna()
        ]
        for at, row in arrangements.to_dict("index").items():
            content = json.loads(row[key]) if isinstance(row[key], str) else row[key]
            labels: dict[str, Any] = {
                column: row[column]
                for column in ("scene_name", "brightness_01")
                if column in row and row[column] == row[column]
            }
            names[at] = files.stimulus(name, {**labels, key: content})
        events.loc[events["trial_type"] == name, key] = None
        if events[key].isna().all():
            events = events.drop(columns=key)
    if names:
        events.insert(3, "stim_file", pd.Series(names, dtype=object).reindex(events.index))
    return events


def _event_rows(name: str, arrays: Columns, zero_ns: int) -> list[dict[str, Any]]:
    """Return the samples of a stream without a rate as events, such as presses."""
    table = _stream_table(arrays, zero_ns).drop(columns=["timestamp"])
    return [
        {
            **_event_row(name, row["t_host_ns"], row["t_host_ns"], zero_ns),
            **{
                f"{name}_{key}": None if value == NO_TIME else value
                for key, value in row.items()
                if key != "t_host_ns"
            },
        }
        for row in table.to_dict("records")
    ]


def _event_row(name: str, start_ns: int, end_ns: int, zero_ns: int) -> dict[str, Any]:
    onset, duration = (start_ns - zero_ns) / NS_PER_S, (end_ns - start_ns) / NS_PER_S
    return {"onset": onset, "duration": duration, "trial_type": name}


def _events_notes(recording: Recording, events: pd.DataFrame) -> dict[str, Any]:
    notes: dict[str, Any] = {
        "onset": {"Description": "session time from the start of the run", "Units": "s"},
        "duration": {"Description": "0 for events of an instant", "Units": "s"},
        "trial_type": {
            "Description": "name of the event; trial carries a trial's factors and results and "
            "lasts from its first scene to its last scene's end or answer, while trial_start is "
            "the instant at which its first step began, with darkness before the scene"
        },
        "IsSimulated": recording.is_simulated,
        "StimulusPresentation": {
            "SoftwareName": "Visavis",
            "SoftwareVersion": recording.manifest.provenance.packages.get("visavis", "n/a"),
            "Code": recording.manifest.provenance.code_revision or "n/a",
            **_screen_fields(recording),
        },
    }
    _, escaped_columns = escape_formulas(events)
    for column in events.columns[3:]:
        note = f"; {ESCAPE_NOTE}" if str(column) in escaped_columns else ""
        notes[str(column)] = {"Description": f"{column}, as the study recorded it{note}"}
    if "stim_file" in notes:
        notes["stim_file"] = {"Description": "file in stimuli/ that says who and what stood where"}
    return notes
