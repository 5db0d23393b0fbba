"""Read real recordings of eye trackers that are public, and hold them against counts of their rows.

    python -m benchmarks.tracker_files --folder FOLDER [--fetch] [--only NAME] [--reports] [--json]

`tracker_files.csv` beside this names each file: its public place, the bytes it must have (SHA-256),
its licence, and what stands in it, counted without our readers. `--fetch` downloads what FOLDER
lacks; nothing of it belongs into this repository. Screens are made up where a file does not say how
large its screen was, so only files of headsets and glasses have true angles.

EyeLink files are read by mne as well, where it is installed: every point on the screen must be the
same. Every blink that EyeLink's own parser found must be among those found in the pupil, and no
other. `--reports` writes the whole report of each file's longest recording as well, and forgets it.
Limits: all bytes as named, all files read, rows as counted, rates within 2 %.
"""

import argparse
import csv
import hashlib
import json
import re
import sys
import tempfile
import urllib.parse
import urllib.request
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from visavis.analysis.gaze.foreign import GazeRecording
from visavis.analysis.gaze.import_report import (
    Format,
    PreparedGaze,
    blink_table,
    prepare,
    quality_table,
    read_recordings,
    report,
)
from visavis.analysis.gaze.mapped_csv import GazeMapping, mapping_of
from visavis.analysis.gaze.pupil_blinks import PUPIL_BLINKS
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import LabError
from visavis.lab.geometry import Vector
from visavis.lab.plain_files import read_packed
from visavis.lab.screen import FlatScreen

PLACE: Final = "https://raw.githubusercontent.com/{}/{}/{}"
LIST: Final = Path(__file__).with_suffix(".csv")
MAX_RATE_OFF_01: Final = 0.02
MAX_PX_OFF: Final = 1e-3
SCREEN_M: Final = (0.53, 0.30, 0.65)
MAPPINGS: Final = {
    "TX300": {
        "time": {"column": "time", "unit": "ms"},
        "space": "head",
        "delimiter": "\t",
        "screen": {
            "width_px": 1920,
            "height_px": 1080,
            "width_m": 0.509,
            "height_m": 0.286,
            "distance_m": 0.65,
        },
        "combined": {"pixels": {"x": "x", "y": "y"}},
    }
}
"""Mappings of files that no program of the list of formats wrote, by tracker."""


@dataclass(frozen=True)
class TrackerFile:
    """A public file: tracker, format, place, bytes, licence, and what was counted in it.

    `rows` are its samples and `rate_hz` its rate as its maker or header says, 0 for an excerpt and
    for two eye cameras that interleave; `screen_px` is the width and height of its picture, ""
    where gaze is not on a screen.
    """

    tracker: str
    format: str
    repository: str
    commit: str
    path: str
    sha256: str
    licence: str
    rows: int
    rate_hz: float
    screen_px: str

    @property
    def address(self) -> str:
        """Where a lab gets it."""
        return PLACE.format(self.repository, self.commit, urllib.parse.quote(self.path))

    def stored_in(self, folder: Path) -> Path:
        """Return its own place in a folder."""
        return folder / self.repository.replace("/", "+") / self.path

    @property
    def screen(self) -> FlatScreen | None:
        """A screen of its pixels, of a size that is made up."""
        if not self.screen_px:
            return None
        width, height = (int(v) for v in self.screen_px.split("x"))
        return FlatScreen(SCREEN_M[0], SCREEN_M[1], width, height, SCREEN_M[2])

    @property
    def mapping(self) -> GazeMapping | None:
        """The mapping of its columns where it has none of its own."""
        return mapping_of(MAPPINGS[self.tracker]) if self.format == "csv" else None


def tracker_files() -> tuple[TrackerFile, ...]:
    """Return the files of the list."""
    with LIST.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    kinds = {field.name: field.type for field in fields(TrackerFile)}
    makers: dict[Any, Any] = {int: int, float: float, str: str}
    return tuple(TrackerFile(**{k: makers[kinds[k]](v) for k, v in row.items()}) for row in rows)


def fetched(file: TrackerFile, folder: Path, *, may_fetch: bool) -> Path:
    """Return a file's place in a folder; its bytes are those of the list.

    Raises:
        LabError: it is not there, or has other bytes.
    """
    path = file.stored_in(folder)
    if not path.exists():
        if not may_fetch:
            raise LabError(f"{path} is not there; --fetch gets it from {file.address}")
        path.parent.mkdir(parents=True, exist_ok=True)
        with urllib.request.urlopen(file.address, timeout=60) as answer:  # noqa: S310 - https only
            path.write_bytes(answer.read())
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if digest != file.sha256:
        raise LabError(f"{path} has SHA-256 {digest}, the list says {file.sha256}")
    return path


def judged(file: TrackerFile, path: Path, *, has_report: bool = False) -> dict[str, Any]:
    """Read a file and return what was read, with every limit that it misses."""
    if file.format == "eyelink" and path.suffix == ".gz":
        with tempfile.TemporaryDirectory() as folder:
            unpacked = Path(folder) / path.stem
            unpacked.write_bytes(read_packed(path))
            return judged(file, unpacked, has_report=has_report)
    recordings = read_recordings([path], cast(Format, file.format), file.mapping, file.screen)
    gaze = [prepare(recording) for recording in recordings]
    quality = [quality_table(each).iloc[-1] for each in gaze]
    first = int(np.argmax([len(r) for r in recordings]))
    longest, sampling = quality[first], gaze[first].sampling
    rate_hz = float(longest["rate_hz"] if sampling is None else sampling.rate_hz)
    n_rows = sum(len(recording) for recording in recordings)
    problems = []
    if n_rows != file.rows:
        problems.append(f"{n_rows} rows, {file.rows} counted")
    if file.rate_hz and abs(rate_hz / file.rate_hz - 1) > MAX_RATE_OFF_01:
        problems.append(f"{rate_hz:.1f} Hz, {file.rate_hz:g} stated")
    # Of 2000 Hz mne reads every second sample.
    off = None
    if file.format == "eyelink" and file.rate_hz <= 1000:
        off = _off_mne_px(path, recordings[0], file.screen)
    if off is not None and off > MAX_PX_OFF:
        problems.append(f"{off:.3g} px off mne")
    blinks = _blinks(path, gaze[first]) if file.format == "eyelink" and file.rate_hz else None
    if blinks is not None and blinks[0] != blinks[1]:
        problems.append(f"{blinks[0]} of EyeLink's {blinks[1]} blinks")
    if has_report:
        with tempfile.TemporaryDirectory() as folder:
            report(recordings[first], Path(folder))
    return {
        "tracker": file.tracker,
        "file": f"{file.repository}/{file.path}",
        "recordings": len(recordings),
        "rows": n_rows,
        "eyes": " ".join(recordings[0].eyes),
        "rate_hz": round(rate_hz, 1),
        "lost_01": round(float(longest["lost_01"]), 4),
        "off_mne_px": off,
        "blinks": blinks,
        "remarks": list(gaze[0].remarks),
        "problems": problems,
    }


def _blinks(path: Path, gaze: PreparedGaze) -> tuple[int, int]:
    """Return how many of EyeLink's blinks the pupil shows as well, less those of ours alone."""
    table = blink_table(gaze)
    shared = theirs = 0
    for eye, name in (("L", "left"), ("R", "right")):
        ours = table[table["eye"] == name]
        begin = ours["onset_ns"].to_numpy(np.int64)
        end = begin + (ours["duration_ms"].to_numpy() * NS_PER_MS).astype(np.int64)
        events = re.findall(
            rf"^EBLINK {eye}\s+(\d+)\s+(\d+)", path.read_text("utf-8", "replace"), re.MULTILINE
        )
        spans = [(int(a) * NS_PER_MS, int(b) * NS_PER_MS) for a, b in events]
        short = [(a, b) for a, b in spans if b - a <= PUPIL_BLINKS.max_loss_ms * NS_PER_MS]
        theirs += len(short)
        shared += sum(bool(((begin <= b) & (end >= a)).any()) for a, b in short)
        shared -= sum(
            not any(a <= y and b >= x for a, b in spans) for x, y in zip(begin, end, strict=True)
        )
    return shared, theirs


def _off_mne_px(path: Path, recording: GazeRecording, screen: FlatScreen | None) -> float | None:
    """Return the largest distance to what mne reads of the same samples; None without mne."""
    if find_spec("mne") is None or screen is None:
        return None
    from mne.io import read_raw_eyelink  # deferred: a tenth of a gigabyte that few need

    try:
        raw = read_raw_eyelink(path, create_annotations=False, verbose="error")
    except Exception:  # mne refuses some of them
        return None
    worst = 0.0
    for name, eye in recording.eyes.items():
        columns = [f"{axis}pos_{name}" for axis in "xy"]
        if not set(columns) <= set(raw.ch_names):
            return None
        theirs = raw.get_data(picks=columns).T
        theirs = theirs[np.isfinite(theirs).all(axis=1)]
        ours = _pixels(screen, eye.direction)
        ours = ours[np.isfinite(ours).all(axis=1)]
        if len(ours) != len(theirs):
            return float("inf")
        worst = max(worst, float(np.abs(ours - theirs).max(initial=0.0)))
    return worst


def _pixels(screen: FlatScreen, direction: Vector) -> Vector:
    """Return where directions from the viewing place meet a screen, in pixels."""
    reach = -screen.distance_m / direction[:, 2]
    return screen.pixels_of(reach[:, None] * direction)


def main(argv: Sequence[str]) -> int:
    """Print a row per file; 1 where one misses a limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where the files are, or go")
    parser.add_argument("--fetch", action="store_true", help="download what is not there")
    parser.add_argument("--only", default="", help="trackers whose name holds this")
    parser.add_argument("--reports", action="store_true", help="detectors and figures, too")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv)
    rows = []
    for file in tracker_files():
        if arguments.only.lower() not in file.tracker.lower():
            continue
        try:
            path = fetched(file, arguments.folder, may_fetch=arguments.fetch)
            row = judged(file, path, has_report=arguments.reports)
        except (LabError, OSError) as error:
            row = {"tracker": file.tracker, "file": file.path, "problems": [str(error)]}
        rows.append(row)
        if not arguments.json:
            text = "; ".join(row["problems"]) or "read"
            figures = (
                f"{row['rows']:6d} rows {row['rate_hz']:7.1f} Hz lost {row['lost_01']:.4f}"
                if "rows" in row
                else ""
            )
            print(f"{file.tracker:<24} {Path(file.path).name:<44.44} {figures}  {text}")
    n_bad = sum(bool(row["problems"]) for row in rows)
    if arguments.json:
        print(json.dumps(rows, indent=2))
    else:
        trackers = {row["tracker"] for row in rows if not row["problems"]}
        print(f"{len(rows) - n_bad} of {len(rows)} files of {len(trackers)} trackers read")
    return int(n_bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
