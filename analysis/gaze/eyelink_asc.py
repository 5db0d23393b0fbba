"""Read EyeLink's .asc files as edf2asc writes them: one eye or both, blinks, pauses, any locale.

Rows of samples hold time, x, y and pupil of each recorded eye; `.` is missing. What EyeLink calls a
blink (SBLINK to EBLINK) is not valid: gaze beside it is an artefact of the lid.
"""

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.foreign import EyeSamples, GazeRecording, eye_samples
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import decode_text
from visavis.lab.geometry import Vector
from visavis.lab.plain_files import MAX_UNPACKED_BYTES, read_plain
from visavis.lab.screen import FlatScreen

_COORDS = re.compile(r"(?:GAZE_COORDS|DISPLAY_COORDS)[ =]+([\d.,\s-]+)")
_NUMBER = re.compile(r"\d+([.,]\d+)?")


def read_eyelink(path: Path, screen: FlatScreen | None) -> GazeRecording:
    """Read samples in gaze coordinates; `screen` says how large the pixels are and how far.

    Pupils, which EyeLink has in arbitrary units, tell of blinks alone, and that is told.

    Raises:
        UsageError: no file, or no screen is given.
        DataError: no samples, samples that are no gaze, a line that cannot be read, or a screen
            of other pixels than the file's.
    """
    lines, remarks = _lines(path)
    if screen is None:
        raise UsageError(
            f"{path}: EyeLink writes pixels; say how large and far the screen was: --screen "
            "1920x1080,0.53x0.30,0.65"
        )
    eyes, rate_hz, has_rows = "", None, False
    times: list[float] = []
    rows: list[list[float]] = []
    recorded: list[str] = []
    resumed_at: list[int] = []  # the number of samples before each pause
    blinks: dict[str, list[tuple[float, float]]] = {"L": [], "R": []}
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        if words[0] == "SAMPLES":
            _refuse_other_samples(path, number, words)
            rate_hz = _rate(words) or rate_hz
        elif words[0] == "START":
            eyes = "".join(side[0] for side in ("LEFT", "RIGHT") if side in words)
            resumed_at.append(len(times))
        elif words[0] == "EBLINK" and _is_blink(words):
            blinks[words[1]].append((_value(words[2]), _value(words[3])))
        elif words[0] == "MSG":
            _refuse_other_screen(path, line, screen)
        elif _NUMBER.fullmatch(words[0]) and eyes:
            has_rows = True
            cells = words[1 : 1 + 3 * len(eyes)]
            try:
                values = [_value(cell) for cell in cells]
            except ValueError as error:
                raise DataError(f"{path}: line {number}: {error}; mend or remove it") from error
            if len(values) < 3 * len(eyes):
                if number == len(lines):
                    remarks = (*remarks, f"line {number}, the last, is cut off; it was left out")
                    continue
                raise DataError(
                    f"{path}: line {number} has {len(cells)} values of {3 * len(eyes)}; was it cut?"
                )
            times.append(_value(words[0]))
            rows.append(values if eyes != "R" else [np.nan] * 3 + values)
            rows[-1] += [np.nan] * (6 - len(rows[-1]))
            recorded += [eye for eye in eyes if eye not in recorded]
    if not has_rows or not rows:
        raise DataError(f"{path}: no samples; convert the EDF file anew with samples (edf2asc)")
    t_ms, values_px = np.array(times), np.array(rows)
    t_ns = np.rint(t_ms * NS_PER_MS).astype(np.int64)
    resumed_ns = tuple(int(t_ns[k]) for k in dict.fromkeys(resumed_at) if 0 < k < len(times))
    if resumed_ns:
        remarks = (*remarks, f"the recorder was paused {len(resumed_ns)} times; pauses are no loss")
    left, right = (
        _eye(t_ms, values_px[:, 3 * k : 3 * k + 3], blinks[eye], screen)
        if eye in recorded
        else None
        for k, eye in enumerate("LR")
    )
    return GazeRecording(
        name=path.stem,
        t_ns=t_ns,
        space="head",
        left=left,
        right=right,
        rate_hz=rate_hz,
        notes={"format": "EyeLink ASC"},
        remarks=(
            *remarks,
            "pupils are in EyeLink's arbitrary units, not in mm: only blinks are taken from them",
        ),
        time_unit="ms",
        resumed_ns=resumed_ns,
    )


def _lines(path: Path) -> tuple[list[str], tuple[str, ...]]:
    try:
        text, remarks = decode_text(read_plain(path, max_bytes=MAX_UNPACKED_BYTES))
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; check the path") from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read as text ({error})") from error
    lines = text.splitlines()
    if lines and lines[-1][:1].isdigit() and not text.endswith(("\n", "\r")):
        # A sample may be cut within its last number.
        return lines[:-1], (*remarks, f"line {len(lines)}, the last, has no end: it was left out")
    return lines, remarks


def _value(cell: str) -> float:
    """Return a number of EyeLink's, NaN for its dot; edf2asc heeds the locale's decimal comma."""
    return np.nan if cell == "." else float(cell.replace(",", "."))


def _is_blink(words: list[str]) -> bool:
    """Say whether a line EBLINK names an eye and two times, as all do but damaged ones."""
    return len(words) > 3 and words[1] in "LR" and all(map(_NUMBER.fullmatch, words[2:4]))


def _rate(words: list[str]) -> float | None:
    at = words.index("RATE") if "RATE" in words else -1
    text = words[at + 1] if 0 <= at < len(words) - 1 else ""
    return _value(text) if _NUMBER.fullmatch(text) else None


def _refuse_other_samples(path: Path, number: int, words: list[str]) -> None:
    if len(words) > 1 and words[1] != "GAZE":
        raise DataError(
            f"{path}: line {number}: samples are {words[1]}, not GAZE; convert the EDF file anew "
            "with gaze coordinates"
        )


def _refuse_other_screen(path: Path, line: str, screen: FlatScreen) -> None:
    match = _COORDS.search(line)
    if match is None:
        return
    try:
        numbers = [float(word) for word in match[1].replace(",", " ").split()[:4]]
    except ValueError:
        return  # a message of the study's that only looks like it
    if len(numbers) < 4:
        return
    size = (round(numbers[2] - numbers[0]), round(numbers[3] - numbers[1]))
    screen_px = (screen.width_px, screen.height_px)
    if any(abs(a - b) > 1 for a, b in zip(size, screen_px, strict=True)):
        raise DataError(
            f"{path}: its screen has {size[0] + 1} by {size[1] + 1} pixels, --screen says "
            f"{screen_px[0]} by {screen_px[1]}"
        )


def _eye(
    t_ms: npt.NDArray[np.float64],
    values: Vector,
    blinks: list[tuple[float, float]],
    screen: FlatScreen,
) -> EyeSamples:
    in_blink = np.zeros(len(t_ms), bool)
    for start_ms, end_ms in blinks:
        in_blink |= (t_ms >= start_ms) & (t_ms <= end_ms)
    return eye_samples(
        screen.directions_of(values[:, :2]), valid=~in_blink, pupil_size=values[:, 2]
    )
