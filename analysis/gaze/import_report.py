"""Turn an imported recording into a quality report and fixations: tables, and a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.gaze.bids import read_bids
from visavis.analysis.gaze.event_kernels import speeds_deg_s
from visavis.analysis.gaze.events import (
    IDT_HEADSET,
    IVT_HEADSET,
    IVT_MOVING_HEAD,
    IVT_SCREEN,
    Fixations,
    IdtParameters,
    IvtParameters,
    detect_idt,
    detect_ivt,
)
from visavis.analysis.gaze.eyelink_asc import read_eyelink
from visavis.analysis.gaze.foreign import EyeSamples, GazeRecording, rows_of_eye
from visavis.analysis.gaze.foreign_times import (
    checked_times,
    recorded_times,
    recordings_of,
    sampling_remarks,
)
from visavis.analysis.gaze.implausible import plausible_samples
from visavis.analysis.gaze.import_figure import draw_import
from visavis.analysis.gaze.loss import (
    DEFAULT_LOSS,
    LossParameters,
    combined_direction,
    loss,
    usable_samples,
)
from visavis.analysis.gaze.mapped_csv import GazeMapping, read_csv
from visavis.analysis.gaze.movements.detect import DETECTOR_NAMES, detect_movements
from visavis.analysis.gaze.movements.kinds import Movement, Movements, fixations_of
from visavis.analysis.gaze.movements.parameters import AUTO
from visavis.analysis.gaze.named_formats import MAPPED, read_named, read_smi
from visavis.analysis.gaze.pupil_blinks import PUPIL_BLINKS, SOURCE, pupil_blinks
from visavis.analysis.gaze.quality import moving_precision_deg
from visavis.analysis.gaze.readers import read_pupil, read_vive
from visavis.analysis.gaze.stamps import Order, Times, order_of, typical_step_ns
from visavis.analysis.gaze.tobii_glasses import read_glasses2, read_glasses3
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import Vector, rotate, unit, yaw_pitch_deg_of
from visavis.lab.sampling import Sampling, sampling_of
from visavis.lab.screen import FlatScreen
from visavis.recording.csv_file import write_csv
from visavis.recording.durable import make_folder, protect_files

Format = Literal[
    "vive",
    "bids",
    "pupil",
    "csv",
    "eyelink",
    "tobii",
    "glasses2",
    "glasses3",
    "neon",
    "smi",
    "gazepoint",
    "varjo",
    "gazebase",
]
FORMATS: tuple[Format, ...] = get_args(Format)

DETECTORS: Mapping[str, IvtParameters | IdtParameters] = {
    "I-VT 30°/s": IVT_SCREEN,
    "I-VT 30°/s headset": IVT_HEADSET,
    "I-VT 100°/s": IVT_MOVING_HEAD,
    "I-DT 1.0° 250 ms": IDT_HEADSET,
}
"""Detectors of the report, run in head and, with a head pose, in world, with parameters."""

BLINK_COLUMNS = (
    "recording",
    "eye",
    "onset_ms",
    "duration_ms",
    "without_pupil_ms",
    "is_of_both_eyes",
    "onset_ns",
    "source",
)
ADAPTIVE = "adaptive"
"""Runs as well, with the detector that suits rate and noise; `chosen` and `why` name it."""


@dataclass(frozen=True)
class PreparedGaze:
    """A recording in time order, one row per stamp, with what may be used of it.

    `sampling` is how its rows lie in time (None below three), `remarks` what is odd about them.
    `t_recorded_ns` are its stamps with the recorder's pauses closed up, by which loss is counted.
    `direction` maps "head" and "world" to (n, 3) combined gaze, NaN when lost; `usable` maps an
    eye to (n,); `eyes_used` (n,) has bit 0 left, bit 1 right (all bits for a combined ray).
    """

    recording: GazeRecording
    order: Order
    t_ns: Times
    t_recorded_ns: Times
    rate_hz: float
    eyes: Mapping[str, EyeSamples]
    usable: Mapping[str, npt.NDArray[np.bool_]]
    direction: Mapping[str, Vector]
    eyes_used: npt.NDArray[np.uint8]
    sampling: Sampling | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class ImportReport:
    """The tables and files of a report about an imported recording.

    `quality` has one row per eye, `detectors` one per detector and frame, `fixations` one per
    fixation, `movements` one per fixation, saccade, oscillation, pursuit and blink found by
    adaptive thresholds, `blinks` one per blink of each eye's pupil, `parameters` every threshold
    used and what is odd about the recording, as `remarks` say it. `files` are the files written.
    """

    name: str
    quality: pd.DataFrame
    detectors: pd.DataFrame
    fixations: pd.DataFrame
    movements: pd.DataFrame
    blinks: pd.DataFrame
    parameters: pd.DataFrame
    files: tuple[Path, ...]
    remarks: tuple[str, ...] = ()


def read_gaze(
    path: Path,
    format_: Format,
    mapping: GazeMapping | None = None,
    screen: FlatScreen | None = None,
) -> GazeRecording:
    """Read one file; `screen` is what was looked at, where the file does not say.

    Raises UsageError for `csv` without a mapping, DataError for bad data.
    """
    if format_ == "csv":
        if mapping is None:
            raise UsageError(f"{path}: plain CSV needs a mapping of its columns (--mapping)")
        return read_csv(path, mapping)
    if format_ in MAPPED:
        return read_named(path, format_, screen)
    with_screen = {"bids": read_bids, "eyelink": read_eyelink, "smi": read_smi}
    if format_ in with_screen:
        return with_screen[format_](path, screen)
    readers = {
        "vive": read_vive,
        "pupil": read_pupil,
        "glasses2": read_glasses2,
        "glasses3": read_glasses3,
    }
    if format_ not in readers:
        raise UsageError(f"format {format_!r} is unknown; choose one of {', '.join(FORMATS)}")
    return readers[format_](path)


def prepare(
    recording: GazeRecording,
    *,
    params: LossParameters = DEFAULT_LOSS,
    backward: Literal["error", "sort"] = "sort",
    conflicts: Literal["error", "keep_first"] = "keep_first",
) -> PreparedGaze:
    """Order the rows, decide which may be used, join the eyes, turn gaze into world.

    Rows that came late or contradict another are sorted and dropped by default, because the
    report counts them; samples that share stamps by the dozen are spread over them.

    Raises:
        DataError: no sample or eye, most gaze behind the head, stamps that show no time, a rate
            that no tracker has, or time that begins anew.
    """
    if not len(recording):
        raise DataError(f"{recording.name}: no samples")
    if not recording.eyes:
        raise DataError(f"{recording.name}: no eye; map at least one")
    recording, value_remarks = plausible_samples(recording)
    values = np.column_stack([eye.direction for eye in recording.eyes.values()])
    stamps, remarks = checked_times(recording, values)
    order = order_of(stamps, values, backward=backward, conflicts=conflicts, what=recording.name)
    rows = np.arange(len(recording)) if order.rows is None else order.rows
    t_ns = stamps[rows]
    eyes = {name: rows_of_eye(eye, rows) for name, eye in recording.eyes.items()}
    usable = {
        name: usable_samples(
            t_ns,
            eye.direction,
            valid=eye.valid,
            openness_01=eye.openness_01,
            confidence_01=eye.confidence_01,
            params=params,
        )
        for name, eye in eyes.items()
    }
    gaze, eyes_used = _combined_ray(eyes, usable)
    usable["combined"] = np.isfinite(gaze[:, 0])
    direction = {recording.space: gaze}
    pose = recording.head_orientation_wxyz
    if recording.space == "head" and pose is not None:
        direction["world"] = rotate(pose[rows], gaze)
    t_recorded_ns = recorded_times(t_ns, recording.resumed_ns)
    rate_hz = recording.rate_hz or NS_PER_S / typical_step_ns(t_recorded_ns)
    sampling = sampling_of(t_recorded_ns) if len(t_ns) > 2 else None
    if order.backward:
        remarks = (*remarks, f"{order.backward} rows came late and were sorted in")
    if sampling is not None:
        remarks = (*remarks, *sampling_remarks(sampling, recording.rate_hz))
    return PreparedGaze(
        recording,
        order,
        t_ns,
        t_recorded_ns,
        rate_hz,
        eyes,
        usable,
        direction,
        eyes_used,
        sampling,
        (*recording.remarks, *value_remarks, *remarks),
    )


def _combined_ray(
    eyes: Mapping[str, EyeSamples], usable: Mapping[str, npt.NDArray[np.bool_]]
) -> tuple[Vector, npt.NDArray[np.uint8]]:
    if "combined" in eyes:
        is_usable = usable["combined"]
        ray = np.where(is_usable[:, None], unit(eyes["combined"].direction), np.nan)
        return ray, np.where(is_usable, 3, 0).astype(np.uint8)
    if len(eyes) == 1:
        (name, eye), code = next(iter(eyes.items())), 1 if "left" in eyes else 2
        ray = np.where(usable[name][:, None], unit(eye.direction), np.nan)
        return ray, np.where(usable[name], code, 0).astype(np.uint8)
    return combined_direction(
        eyes["left"].direction, eyes["right"].direction, usable["left"], usable["right"]
    )


def quality_table(gaze: PreparedGaze, params: LossParameters = DEFAULT_LOSS) -> pd.DataFrame:
    """Return one row per eye: loss, rate, gaps, repeats, precision in free viewing."""
    rays = {name: eye.direction for name, eye in gaze.eyes.items()}
    rays["combined"] = gaze.direction[gaze.recording.space]
    device = gaze.recording.t_device_ns
    repeats = None if device is None else int((np.diff(device) == 0).sum())
    head_median, head_p95 = _head_speeds_deg_s(gaze)
    sampling = gaze.sampling
    if sampling is not None and sampling.is_even and len(sampling.rates_hz) < 2:
        sampling = None  # one rate, evenly: it says what is due
    rows = []
    for name, ray in rays.items():
        is_usable = gaze.usable[name]
        losses = loss(
            gaze.t_recorded_ns,
            ray,
            is_usable,
            nominal_rate_hz=gaze.rate_hz,
            frozen_ms=params.frozen_ms,
            sampling=sampling,
        )
        middle, calmest = moving_precision_deg(gaze.t_ns, np.where(is_usable[:, None], ray, np.nan))
        both = float((gaze.eyes_used == 3).mean())
        rows.append(
            {
                "recording": gaze.recording.name,
                "eye": name,
                **asdict(losses),
                "file_rows": len(gaze.recording),
                "repeated_stamps": gaze.order.repeated,
                "conflicting_stamps": gaze.order.conflicting,
                "backward_stamps": gaze.order.backward,
                "repeated_device_stamps": repeats,
                "nominal_rate_hz": gaze.rate_hz,
                "both_eyes_01": both if name == "combined" else None,
                "rms_s2s_median_deg": middle,
                "rms_s2s_calmest_deg": calmest,
                "head_speed_median_deg_s": head_median,
                "head_speed_p95_deg_s": head_p95,
            }
        )
    return pd.DataFrame(rows)


def _head_deg_s(gaze: PreparedGaze) -> Vector | None:
    """Return (n,) speed of the head's front over about 80 ms; None without a head pose."""
    pose = gaze.recording.head_orientation_wxyz
    if pose is None or len(gaze.t_ns) < 2:
        return None
    rows = slice(None) if gaze.order.rows is None else gaze.order.rows
    front = rotate(pose[rows], np.broadcast_to([0.0, 0.0, -1.0], (len(gaze.t_ns), 3)))
    speed = np.empty(len(gaze.t_ns))
    stretch = np.where(np.isfinite(front[:, 0]), 0, -1)
    half = max(1, round(0.04 * gaze.rate_hz))
    speeds_deg_s(gaze.t_ns, np.ascontiguousarray(front), stretch, half, speed)
    return speed


def _head_speeds_deg_s(gaze: PreparedGaze) -> tuple[float, float]:
    """Return median and 95th percentile speed of the head's front; NaN when unknown."""
    speed = _head_deg_s(gaze)
    finite_speed = np.empty(0) if speed is None else speed[np.isfinite(speed)]
    if not finite_speed.size:
        return np.nan, np.nan
    return float(np.median(finite_speed)), float(np.percentile(finite_speed, 95))


def detect_fixations(gaze: PreparedGaze) -> dict[tuple[str, str], Fixations]:
    """Run every detector of fixations in every frame; keys are detector and frame."""
    return {
        (name, space): detect_ivt(gaze.t_ns, ray, params)
        if isinstance(params, IvtParameters)
        else detect_idt(gaze.t_ns, ray, params)
        for name, params in DETECTORS.items()
        for space, ray in gaze.direction.items()
    }


def movements_of(gaze: PreparedGaze) -> dict[str, Movements]:
    """Find eye movements in every frame; in world together with the eye in the head, if known."""
    head = _head_deg_s(gaze)
    return {
        space: detect_movements(
            gaze.t_ns,
            ray,
            in_head=gaze.direction.get("head") if space == "world" else None,
            head_deg_s=head,
        )
        for space, ray in gaze.direction.items()
    }


def blink_table(gaze: PreparedGaze) -> pd.DataFrame:
    """Return one row per blink of each eye's pupil signal, with the edges that the lid covers."""
    found = {
        name: pupil_blinks(gaze.t_ns, size)
        for name, eye in gaze.eyes.items()
        for size in (eye.pupil_mm if eye.pupil_size is None else eye.pupil_size,)
        if np.isfinite(size).any()
    }
    rows = []
    for name, blinks in found.items():
        for onset_ns, offset_ns, duration_ms, loss_ms in zip(
            blinks.onset_ns.tolist(),
            blinks.offset_ns.tolist(),
            blinks.duration_ms.tolist(),
            blinks.loss_ms.tolist(),
            strict=True,
        ):
            rows.append(
                {
                    "recording": gaze.recording.name,
                    "eye": name,
                    "onset_ms": (onset_ns - int(gaze.t_ns[0])) / NS_PER_MS,
                    "duration_ms": duration_ms,
                    "without_pupil_ms": loss_ms,
                    "is_of_both_eyes": any(
                        bool(((b.onset_ns < offset_ns) & (b.offset_ns > onset_ns)).any())
                        for other, b in found.items()
                        if other != name
                    ),
                    "onset_ns": onset_ns,
                    "source": SOURCE,
                }
            )
    return pd.DataFrame(rows, columns=BLINK_COLUMNS)


def _detector_settings() -> list[tuple[str, dict[str, object]]]:
    return [
        *((name, asdict(params)) for name, params in DETECTORS.items()),
        (ADAPTIVE, AUTO.by_name()),
    ]


def _fixation_table(gaze: PreparedGaze, name: str, space: str, f: Fixations) -> pd.DataFrame:
    yaw, pitch = yaw_pitch_deg_of(f.direction)
    return pd.DataFrame(
        {
            "recording": gaze.recording.name,
            "detector": name,
            "frame": space,
            "onset_ms": (f.onset_ns - gaze.t_ns[0]) / NS_PER_MS,
            "duration_ms": f.duration_ns / NS_PER_MS,
            "azimuth_right_deg": -yaw,
            "elevation_up_deg": pitch,
            "onset_ns": f.onset_ns,
        }
    )


def _movement_table(gaze: PreparedGaze, space: str, m: Movements) -> pd.DataFrame:
    yaw, pitch = yaw_pitch_deg_of(m.direction)
    return pd.DataFrame(
        {
            "recording": gaze.recording.name,
            "frame": space,
            "movement": [Movement(kind).name.lower() for kind in m.kind],
            "onset_ms": (m.onset_ns - gaze.t_ns[0]) / NS_PER_MS,
            "duration_ms": m.duration_ns / NS_PER_MS,
            "amplitude_deg": m.amplitude_deg,
            "peak_deg_s": m.peak_deg_s,
            "head_deg_s": m.head_deg_s,
            "eye_deg_s": m.eye_deg_s,
            "azimuth_right_deg": -yaw,
            "elevation_up_deg": pitch,
            "onset_ns": m.onset_ns,
        }
    )


def report(
    recording: GazeRecording, folder: Path, *, params: LossParameters = DEFAULT_LOSS
) -> ImportReport:
    """Write quality, detector and fixation tables (CSV) and a figure (PNG) under `folder`.

    Files are named after the recording; a report that is already there is refused.
    """
    refuse_files_there([recording.name], folder)
    # Fixations by every fixed detector, and by the adaptive one that suits rate and noise.
    gaze = prepare(recording, params=params)
    movements = movements_of(gaze)
    fixations = detect_fixations(gaze) | {
        (ADAPTIVE, space): fixations_of(m) for space, m in movements.items()
    }
    t_ns = gaze.t_recorded_ns
    recording_ns = int(t_ns[-1] - t_ns[0]) + typical_step_ns(t_ns)
    summary = pd.DataFrame(
        [
            {
                "recording": recording.name,
                "detector": name,
                "frame": space,
                "fixations": len(f),
                "share_of_time_01": float(f.duration_ns.sum()) / recording_ns,
                "median_duration_ms": float(np.median(f.duration_ns)) / NS_PER_MS
                if len(f)
                else np.nan,
                "window_ms": f.window_ms,
                "chosen": DETECTOR_NAMES[movements[space].detector] if name == ADAPTIVE else "",
                "why": movements[space].why if name == ADAPTIVE else "",
            }
            for (name, space), f in fixations.items()
        ]
    )
    # One CSV per table; `parameters` makes the report repeatable.
    tables = {
        "quality": quality_table(gaze, params),
        "detectors": summary,
        "fixations": pd.concat(
            [_fixation_table(gaze, name, space, f) for (name, space), f in fixations.items()],
            ignore_index=True,
        ),
        "movements": pd.concat(
            [_movement_table(gaze, space, m) for space, m in movements.items()],
            ignore_index=True,
        ),
        "blinks": blink_table(gaze),
        "parameters": pd.DataFrame(
            [
                {"of": of, "parameter": key, "value": str(value)}
                for of, settings in (
                    ("loss", asdict(params)),
                    ("pupil blinks", asdict(PUPIL_BLINKS)),
                    *_detector_settings(),
                )
                for key, value in settings.items()
            ]
            + [{"of": "reading", "parameter": "remark", "value": text} for text in gaze.remarks]
        ),
    }
    files = _write(recording.name, folder, tables)
    # The figure shows gaze in world where there is a head pose: only there is rest a fixation.
    space = "world" if "world" in gaze.direction else recording.space
    figure = folder / f"{recording.name}_gaze.png"
    draw_import(
        figure,
        title=recording.name,
        t_ns=gaze.t_ns,
        direction=gaze.direction[space],
        frame=space,
        fixations=fixations[ADAPTIVE, space],
        detector=DETECTOR_NAMES[movements[space].detector],
        usable=gaze.usable,
        pupil_mm={name: eye.pupil_mm for name, eye in gaze.eyes.items()},
        lost_01=float(tables["quality"].iloc[-1]["lost_01"]),
        rate_hz=float(tables["quality"].iloc[-1]["rate_hz"]),
    )
    protect_files([*files, figure])
    return ImportReport(recording.name, **tables, files=(*files, figure), remarks=gaze.remarks)


def report_files(name: str, folder: Path) -> tuple[Path, ...]:
    """Return the files that a report on a recording of this name is written to, the figure last."""
    kinds = ("quality", "detectors", "fixations", "movements", "blinks", "parameters")
    return (*(folder / f"{name}_{kind}.csv" for kind in kinds), folder / f"{name}_gaze.png")


def read_recordings(
    files: Sequence[Path],
    format_: Format,
    mapping: GazeMapping | None = None,
    screen: FlatScreen | None = None,
) -> tuple[GazeRecording, ...]:
    """Read and check several files before anything is written of any; each has its own name.

    Files of one name are named from their folders as well.

    Raises:
        DataError: files that cannot be read or judged, all of them at once.
        UsageError: a file is given twice.
    """
    names = names_of(files)
    recordings: list[GazeRecording] = []
    problems = []
    for file, name in zip(files, names, strict=True):
        try:
            read = read_gaze(file, format_, mapping, screen)
            own = replace(read, name=read.name.replace(file.stem, name) if name else read.name)
            parts = recordings_of(own)
            for part in parts:
                prepare(part)
        except DataError as error:
            if len(files) == 1:
                raise
            problems.append(str(error))
        else:
            recordings += parts
    if problems:
        raise DataError("\n".join((f"{len(problems)} of {len(files)} files:", *problems)))
    own_names = [r.name for r in recordings]
    if twice := next((name for name in own_names if own_names.count(name) > 1), ""):
        raise UsageError(f"two recordings are named {twice}; import them into folders of their own")
    return tuple(recordings)


def names_of(files: Sequence[Path]) -> tuple[str, ...]:
    """Return a name per file that tells it from the others: its folder's where files share one.

    "" where the file's own name does. Raises UsageError when a file is given twice.
    """
    paths = [file.resolve() for file in files]
    for path in paths:
        if paths.count(path) > 1:
            raise UsageError(f"{path} is given twice")
    stems = [path.stem for path in paths]
    names = []
    for path in paths:
        if stems.count(path.stem) == 1:
            names.append("")
            continue
        depth = 1
        others = [p for p in paths if p != path and p.stem == path.stem]
        while any(p.parent.parts[-depth:] == path.parent.parts[-depth:] for p in others):
            depth += 1
        names.append("_".join((*path.parent.parts[-depth:], path.stem)))
    return tuple(names)


def _write(name: str, folder: Path, tables: Mapping[str, pd.DataFrame]) -> tuple[Path, ...]:
    make_folder(folder, exist_ok=True)
    paths = dict(zip(tables, report_files(name, folder)[:-1], strict=True))
    for kind, path in paths.items():
        write_csv(tables[kind], path)
    return tuple(paths.values())


def refuse_files_there(names: Sequence[str], folder: Path) -> None:
    """Raise UsageError when a file of these recordings' reports is there already."""
    for name in names:
        for path in report_files(name, folder):
            if path.exists():
                raise UsageError(f"{path} is already there; give an empty folder")
