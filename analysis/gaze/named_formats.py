"""Read gaze of trackers by name: tables by the mapping of their program, and SMI's."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.analysis.gaze.foreign import GazeRecording
from visavis.analysis.gaze.foreign_times import LIKELY_HZ
from visavis.analysis.gaze.mapped_csv import GazeMapping, Screen, mapping_of, recording_of_table
from visavis.analysis.gaze.text_table import NS_PER_UNIT, TextTable, read_text_table
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.foreign_text import decode_text
from visavis.lab.plain_files import read_plain
from visavis.lab.sampling import step_ns_of
from visavis.lab.screen import FlatScreen
from visavis.lab.yaml_lines import read_document

MAPPED: Final = ("tobii", "neon", "gazepoint", "varjo", "gazebase")
"""Programs whose tables a mapping in `formats` describes."""
FORMATS_FOLDER = Path(__file__).with_name("formats")
_SMI_HEADER = re.compile(r"##\s*([^:\t]+):\s*(.+)")
_SMI_COLUMNS = {"left": "L", "right": "R"}


def read_named(path: Path, name: str, screen: FlatScreen | None) -> GazeRecording:
    """Read a table that the program `name` of `MAPPED` wrote; its eyes are those it has.

    Raises:
        UsageError: no file, or gaze on a screen of which nothing is known.
        DataError: a column that the program writes is missing, or a line is wrong.
    """
    text, remarks = _text(path)
    if name == "tobii":
        text = _without_preamble(text)
    table = replace(read_text_table(path, delimiter=None, text=text), remarks=remarks)
    mapping = _mapping_for(table, name, screen)
    recording = recording_of_table(table, mapping)
    notes: dict[str, str] = {"format": name}
    return replace(recording, name=name_of_file(path), notes=notes)


def _text(path: Path) -> tuple[str, tuple[str, ...]]:
    try:
        return decode_text(read_plain(path))
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; check the path") from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read as text ({error})") from error


def _without_preamble(text: str) -> str:
    """Return a text whose lines before the table, as Tobii Studio 2 writes them, are empty."""
    head, mark, table = text.partition("\nTimestamp\t")
    if not mark or not head.startswith("System Properties"):
        return text
    return "\n" * head.count("\n") + mark + table


def name_of_file(path: Path) -> str:
    """Return a name that tells recordings apart where a program calls all files alike."""
    is_alike = path.stem in ("gaze", "gazedata", "livedata")
    return f"{path.parent.name}_{path.stem}" if is_alike else path.stem


def _mapping_for(table: TextTable, name: str, screen: FlatScreen | None) -> GazeMapping:
    # Of a program that named its columns otherwise once there is a second file: tobii_studio.
    contents = [dict(read_document(p).data) for p in sorted(FORMATS_FOLDER.glob(f"{name}*.yaml"))]
    times = [c["time"]["column"] for c in contents]
    content: dict[str, Any] | None = next(
        (c for c, time in zip(contents, times, strict=True) if table.has(time)), None
    )
    if content is None:
        raise DataError(f"{table.path}: no column {' or '.join(map(repr, times))}: not of {name}")
    content["where"] = [each for each in content.get("where", []) if table.has(each["column"])]
    eyes = {}
    for eye in ("left", "right", "combined"):
        own = content.pop(eye, None)
        if own is not None and table.has(*_gaze_columns(own)):
            eyes[eye] = _with_columns_there(own, table)
    if not eyes:
        raise DataError(
            f"{table.path}: no gaze of {name} in its columns ({', '.join(table.cells)}); export it "
            "again with gaze"
        )
    if len(eyes) == 3:
        del eyes["combined"]  # the two eyes say more
    if any("pixels" in own for own in eyes.values()):
        if screen is None:
            raise UsageError(
                f"{table.path}: {name} writes places on the screen; say how large and far it was: "
                "--screen 1920x1080,0.53x0.30,0.65"
            )
        content["screen"] = Screen.of(screen)
    mapping = mapping_of({**content, **eyes}, source=name)
    return _with_likely_unit(table, mapping) if name == "tobii" and mapping.where else mapping


def _gaze_columns(eye: dict[str, Any]) -> list[str]:
    if "direction" in eye:
        return list(eye["direction"])
    if "angles" in eye:
        return [eye["angles"]["azimuth"], eye["angles"]["elevation"]]
    return [eye["pixels"]["x"], eye["pixels"]["y"]]


def _with_columns_there(eye: dict[str, Any], table: TextTable) -> dict[str, Any]:
    """Return an eye without the columns for validity and pupil that the export lacks."""
    out = dict(eye)
    for key in ("valid", "pupil"):
        column = out[key]["column"] if isinstance(out.get(key), dict) else out.get(key)
        if column is not None and not table.has(column):
            del out[key]
    return out


def _with_likely_unit(table: TextTable, mapping: GazeMapping) -> GazeMapping:
    """Tobii wrote milliseconds up to some version and microseconds since; the rate tells."""
    rows = table
    for each in mapping.where:
        rows = rows.where(each.column, each.is_)
    t_ns = np.unique(rows.stamps(mapping.time.column, "us"))
    if len(t_ns) < 3:
        return mapping
    for unit_name in ("us", "ms"):
        rate_hz = NS_PER_S / step_ns_of(t_ns) * NS_PER_UNIT["us"] / NS_PER_UNIT[unit_name]
        if LIKELY_HZ[0] <= rate_hz <= LIKELY_HZ[1]:
            time = mapping.time.model_copy(update={"unit": unit_name})
            return mapping.model_copy(update={"time": time})
    return mapping


# ---- SMI -----------------------------------------------------------------------------------------


def read_smi(path: Path, screen: FlatScreen | None) -> GazeRecording:
    """Read raw data as SMI's IDF converter writes them; the file itself describes its screen.

    Raises:
        UsageError: no file, or the screen is neither in the file nor given.
        DataError: no samples (SMP), or a line is wrong.
    """
    text, remarks = _text(path)
    lines = text.splitlines()
    head = {m[1]: m[2] for line in lines if (m := _SMI_HEADER.match(line))}
    # Messages stand between samples, with cells of their own.
    rows = [line for line in lines if not line.startswith("##") and "\tMSG\t" not in line]
    if not any(line.startswith("Time\t") for line in rows):
        raise DataError(
            f"{path}: no samples of SMI (a line Time, Type, Trial, …); events alone are no gaze: "
            "convert the recording with samples"
        )
    end = "\n" if text.endswith(("\n", "\r")) else ""
    table = read_text_table(path, delimiter="\t", text="\n".join(rows) + end)
    screen = screen or _smi_screen(head)
    if screen is None:
        raise UsageError(f"{path}: it does not describe its screen; give --screen")
    eyes = {
        eye: {
            "pixels": {"x": f"{side} POR X*", "y": f"{side} POR Y*"},
            **(
                {"pupil": {"column": f"{side} Mapped Diameter*", "unit": "mm"}}
                if table.has(f"{side} Mapped Diameter*")
                else {}
            ),
        }
        for eye, side in _SMI_COLUMNS.items()
        if table.has(f"{side} POR X*", f"{side} POR Y*")
    }
    rate = head.get("Sample Rate", "").strip()
    content = {
        "time": {"column": "Time", "unit": "us"},
        "space": "head",
        "screen": Screen.of(screen),
        "rate_hz": float(rate) if re.fullmatch(r"[1-9][0-9]{0,4}", rate) else None,
        **eyes,
    }
    recording = recording_of_table(table, mapping_of(content, source=f"{path}: SMI"))
    # SMI writes 0, 0 where it lost the eye.
    lost = {
        name: replace(
            eye, direction=np.where(_at_origin(table, side)[:, None], np.nan, eye.direction)
        )
        for name, eye in recording.eyes.items()
        for side in (_SMI_COLUMNS[name],)
    }
    return replace(
        recording,
        left=lost.get("left"),
        right=lost.get("right"),
        notes={"format": "SMI"},
        remarks=(*remarks, *recording.remarks),
    )


def _at_origin(table: TextTable, side: str) -> Any:
    points = table.vectors([f"{side} POR X*", f"{side} POR Y*"])
    return (points == 0).all(axis=1)


def _smi_screen(head: dict[str, str]) -> FlatScreen | None:
    try:
        width_px, height_px = (int(v) for v in head["Calibration Area"].split()[:2])
        key = "Stimulus Dimension [mm]"
        width_mm, height_mm = (float(v) for v in head[key].split()[:2])
        distance_mm = float(head["Head Distance [mm]"].split()[0])
    except (KeyError, ValueError, IndexError):
        return None
    return FlatScreen(width_mm / 1e3, height_mm / 1e3, width_px, height_px, distance_mm / 1e3)
