"""Judge and import the six official BIDS examples of eye tracking and motion, filled with samples.

    python -m benchmarks.bids_examples --folder FOLDER [--json]

FOLDER is a clone of github.com/bids-standard/bids-examples. Its sidecars and channels are real, its
data files are empty or nearly so: a copy is made in which every file has made-up samples in the
columns, units and rate that its sidecars name. Each must be judged without red and be imported, and
no sample may be lost. Limit: every file of every set.
"""

import argparse
import gzip
import json
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.analysis.foreign_check import check_foreign
from visavis.analysis.foreign_motion import ENDING, quality_of_motion, read_bids_motion
from visavis.analysis.gaze.bids import TIME_UNITS, UNITS
from visavis.analysis.gaze.import_report import prepare, read_gaze
from visavis.analysis.gaze.text_table import NS_PER_UNIT, read_text_table
from visavis.analysis.session_verdict import Level
from visavis.lab.errors import LabError
from visavis.lab.screen import FlatScreen
from visavis.recording.bids_sidecar import sidecar_of

SETS: Final = (
    "eyetracking_binocular",
    "eyetracking_eeg_ds007338",
    "eyetracking_fmri",
    "motion_dualtask",
    "motion_spotrotation",
    "motion_systemvalidation",
)
N_ROWS: Final = 400
SCREEN: Final = FlatScreen(0.53, 0.30, 1920, 1080, 0.65)


def fill(data_set: Path) -> list[Path]:
    """Write samples into every data file of a copy of a set; return the files."""
    files = [*data_set.rglob("*_physio.tsv.gz"), *data_set.rglob(f"*{ENDING}")]
    for path in files:
        if path.name.endswith(ENDING):
            channels = read_text_table(
                path.with_name(path.name.replace(ENDING, "_channels.tsv")), delimiter="\t"
            )
            kinds = [cell.strip() for cell in channels.column("type")]
            rate_hz = float(sidecar_of(path)["SamplingFrequency"])
            columns = [_motion_cells(kind, k, rate_hz) for k, kind in enumerate(kinds)]
            path.write_text(_lines(columns), encoding="utf-8")
        else:
            sidecar = sidecar_of(path)
            columns = [_gaze_cells(str(name), sidecar) for name in sidecar["Columns"]]
            path.write_bytes(gzip.compress(_lines(columns).encode()))
    return sorted(files)


def _lines(columns: Sequence[Sequence[float]]) -> str:
    return "".join("\t".join(map(repr, row)) + "\n" for row in zip(*columns, strict=True))


def _motion_cells(kind: str, column: int, rate_hz: float) -> list[float]:
    t_s = np.arange(N_ROWS) / rate_hz
    if kind == "LATENCY":
        return [float(v) for v in t_s]
    return [float(v) for v in np.round(0.4 + 0.2 * np.sin(t_s * 3 + column), 6)]


def _gaze_cells(name: str, sidecar: dict[str, Any]) -> list[float]:
    about = sidecar.get(name, {})
    k = np.arange(N_ROWS)
    if name == "timestamp":
        unit = str(about.get("Units", "s"))
        per_unit = NS_PER_UNIT[TIME_UNITS.get(unit.lower(), unit)]
        step = 1e9 / float(sidecar["SamplingFrequency"]) / per_unit
        return [float(v) for v in np.round(k * step, 9)]
    unit = str(about.get("Units", "deg")).lower()
    scale = {"pixel": 200.0, "rad": 0.1}.get(UNITS.get(unit, unit), 5.0)
    middle = 500.0 if scale == 200.0 else 0.0
    return [float(v) for v in np.round(middle + scale * np.sin(k / 40 + len(name)), 4)]


def judged(path: Path, data_set: Path) -> dict[str, Any]:
    """Import one file and return what was read, with what is wrong."""
    problems, rate_hz = [], float(sidecar_of(path)["SamplingFrequency"])
    if path.name.endswith(ENDING):
        kinds = read_text_table(
            path.with_name(path.name.replace(ENDING, "_channels.tsv")), delimiter="\t"
        ).column("type")
        if not {"POS", "ORNT"} & {kind.strip() for kind in kinds}:
            try:
                read_bids_motion(path)
                problems.append("read although it has neither position nor orientation")
            except LabError as error:
                what = str(error).rpartition(": ")[2]
            return _row(path, data_set, f"refused: {what}", problems)
        quality = quality_of_motion(read_bids_motion(path))
        if quality["rows"].iloc[0] != N_ROWS or quality["unseen_01"].max() > 0:
            problems.append("rows are missing")
        if quality["lost_rows_01"].max() > 0:
            problems.append("samples are called lost")
        found_hz, what = float(quality["rate_hz"].iloc[0]), f"{len(quality)} points"
    else:
        try:
            recording = read_gaze(path, "bids")
        except LabError:  # the set does not describe its screen
            recording = read_gaze(path, "bids", screen=SCREEN)
        gaze = prepare(recording)
        if len(gaze.t_ns) != N_ROWS or not gaze.usable["combined"].all():
            problems.append("samples are lost")
        found_hz, what = gaze.rate_hz, " ".join(recording.eyes)
    if abs(found_hz / rate_hz - 1) > 0.01:
        problems.append(f"{found_hz:.1f} Hz, {rate_hz:g} stated")
    return _row(path, data_set, what, problems)


def _row(path: Path, data_set: Path, what: str, problems: list[str]) -> dict[str, Any]:
    return {"set": data_set.name, "file": path.name, "read": what, "problems": problems}


def main(argv: Sequence[str]) -> int:
    """Print a row per file; 1 where one misses a limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="a clone of bids-examples")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv)
    rows = []
    for name in SETS:
        with tempfile.TemporaryDirectory() as folder:
            data_set = Path(shutil.copytree(arguments.folder / name, Path(folder) / name))
            files = fill(data_set)
            red = {v.name: v for v in check_foreign(data_set) if v.level == Level.RED}
            for path in files:
                try:
                    row = judged(path, data_set)
                except LabError as error:
                    row = _row(path, data_set, "", [str(error)])
                verdict = red.get(path.relative_to(data_set).as_posix())
                row["problems"] += [what for what, _ in verdict.findings] if verdict else []
                rows.append(row)
                if not arguments.json:
                    text = "; ".join(row["problems"]) or "judged and imported"
                    print(f"{name:<26} {path.name[-58:]:<58} {row['read'][:24]:<24} {text}")
    n_bad = sum(bool(row["problems"]) for row in rows)
    print(
        json.dumps(rows, indent=2)
        if arguments.json
        else f"{len(rows) - n_bad} of {len(rows)} files"
    )
    return int(n_bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
