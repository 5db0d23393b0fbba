"""Read the recordings of Tobii Pro Glasses 2 and 3: one JSON object a line.

The glasses stand for the head: x to the wearer's left, y up, z forward.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.analysis.gaze.foreign import EyeSamples, GazeRecording, axes_matrix, eye_samples
from visavis.analysis.gaze.named_formats import name_of_file
from visavis.analysis.gaze.text_table import NS_PER_UNIT
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import decode_text
from visavis.lab.geometry import Vector, unit
from visavis.lab.plain_files import parse_json, read_packed, read_plain

MAX_CLOCK_S: Final = 4e9
"""No clock shows more: 126 years."""
_GLASSES_AXES = axes_matrix("-x", "+y", "+z")


def _text(path: Path) -> tuple[str, tuple[str, ...]]:
    try:
        data = read_plain(path)
        return decode_text(read_packed(path) if data.startswith(b"\x1f\x8b") else data)
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; check the path") from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read ({error}); copy it again") from error


def read_glasses2(path: Path) -> GazeRecording:
    """Read `livedata.json` or `livedata.json.gz` of Tobii Pro Glasses 2.

    Each line holds one quantity of one moment; those of a gaze sample share `gidx` and `ts` (µs). A
    status `s` other than 0 is not valid. Lines of other sensors are passed over; a last line that
    is cut is left out, and told.

    Raises:
        UsageError: no file.
        DataError: a line is no JSON, or there is no gaze.
    """
    text, remarks = _text(path)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    samples: dict[int, dict[str, dict[str, Any]]] = {}
    for number, line in lines:
        try:
            entry = parse_json(line)
            eye = entry.get("eye")
            if eye not in ("left", "right") or not ("gd" in entry or "pd" in entry):
                continue
            t_us = int(entry["ts"])
            if not abs(t_us) < MAX_CLOCK_S * 1e6:
                raise ValueError(f"{t_us} is no time")
            side = samples.setdefault(t_us, {}).setdefault(eye, {})
            if entry.get("s", 0) == 0:
                side |= {
                    "gazedirection": entry.get("gd", side.get("gazedirection")),
                    "pupildiameter": entry.get("pd", side.get("pupildiameter")),
                }
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            if number == lines[-1][0] and samples:
                remarks = (*remarks, f"line {number}, the last, is cut off; it was left out")
                break
            raise DataError(f"{path}: line {number} is none of Glasses 2 ({error})") from error
    if not samples:
        raise DataError(f"{path}: no gaze; the recording never started, leave the file out")
    times = sorted(samples)
    left, right = (
        _glasses_eye(path, [samples[t].get(eye) for t in times]) for eye in ("left", "right")
    )
    return GazeRecording(
        name=name_of_file(path.with_suffix("") if path.suffix == ".gz" else path),
        t_ns=np.array(times, np.int64) * NS_PER_UNIT["us"],
        space="head",
        left=left,
        right=right,
        notes={"format": "Tobii Pro Glasses 2"},
        remarks=remarks,
        time_unit="us",
    )


def read_glasses3(path: Path) -> GazeRecording:
    """Read `gazedata` or `gazedata.gz` of Tobii Pro Glasses 3: one JSON object a line.

    The glasses stand for the head: x to the wearer's left, y up, z forward. A last line that is cut
    is left out, and told.

    Raises:
        UsageError: no file.
        DataError: a line is no gaze, or there is none.
    """
    text, remarks = _text(path)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    entries = []
    for number, line in lines:
        try:
            entry = parse_json(line)
            t_s = float(entry["timestamp"])
            if not abs(t_s) < MAX_CLOCK_S:
                raise ValueError(f"{t_s} is no time")
            entries.append((t_s, dict(entry.get("data") or {})))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            if number == lines[-1][0] and entries:
                remarks = (*remarks, f"line {number}, the last, is cut off; it was left out")
                break
            raise DataError(f"{path}: line {number} is no gaze of Glasses 3 ({error})") from error
    if not entries:
        raise DataError(f"{path}: no gaze; the recording never started, leave the file out")
    return GazeRecording(
        name=name_of_file(path.with_suffix("") if path.suffix == ".gz" else path),
        t_ns=np.rint(np.array([t_s for t_s, _ in entries]) * NS_PER_S).astype(np.int64),
        space="head",
        left=_glasses_eye(path, [data.get("eyeleft") for _, data in entries]),
        right=_glasses_eye(path, [data.get("eyeright") for _, data in entries]),
        notes={"format": "Tobii Pro Glasses 3"},
        remarks=remarks,
        time_unit="s",
    )


def _glasses_eye(path: Path, entries: list[Any]) -> EyeSamples:
    nothing = [np.nan] * 3
    eyes = [entry if isinstance(entry, dict) else {} for entry in entries]
    try:
        rays: Vector = np.array([eye.get("gazedirection") or nothing for eye in eyes], np.float64)
        pupils = np.array([eye.get("pupildiameter") or np.nan for eye in eyes], np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"{path}: a direction or pupil that is none ({error})") from error
    if rays.shape != (len(eyes), 3) or pupils.shape != (len(eyes),):
        raise DataError(f"{path}: a direction is no list of three numbers, or a pupil is no number")
    return eye_samples(unit(rays @ _GLASSES_AXES.T), pupil_mm=pupils)
