"""Let eye2bids and mne-bids convert real EyeLink recordings, and import what they wrote.

    python -m benchmarks.bids_writers --folder FOLDER --python PYTHON [--json]

FOLDER holds the files that `benchmarks.tracker_files --fetch` downloads; PYTHON is an interpreter
of an environment of its own that has eye2bids (github.com/bids-standard/eye2bids) and mne-bids.
EyeLink's own `edf2asc`, which eye2bids asks for samples and events, is not everybody's: a stand-in
hands it the lines of the `.asc` file, which came from there. Screens are those of `tracker_files`.

What a program wrote is judged (`visavis check`) and imported (`visavis import gaze --format bids`).
Limits: nothing red but in excerpts; every eye, as many rows, the same points on the screen and the
same share lost (excerpts aside) as in the `.asc` file, read by our own reader. A recording that a
program does not convert is named, and is no miss of ours.
"""

import argparse
import json
import os
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.tracker_files import SCREEN_M, TrackerFile, fetched, tracker_files
from visavis.analysis.foreign_check import check_foreign
from visavis.analysis.gaze.bids import read_bids
from visavis.analysis.gaze.foreign import GazeRecording
from visavis.analysis.gaze.import_report import prepare, quality_table, read_recordings
from visavis.analysis.session_verdict import Level
from visavis.lab.errors import LabError
from visavis.lab.geometry import angle_deg
from visavis.lab.plain_files import read_packed

MAX_OFF_DEG: Final = 1e-3
MAX_LOSS_OFF_01: Final = 1e-3
MAX_RATE_OF_MNE_HZ: Final = 1000
STAND_IN: Final = """#!{python}
import sys
arguments = sys.argv[1:]
if arguments:
    source, target = arguments[2], arguments[4]
    is_samples = "-s" in arguments
    with open(source) as lines, open(target + ".asc", "w") as out:
        out.writelines(line for line in lines if line[:1].isdigit() == is_samples)
"""
METADATA: Final = """Units: pixel
SampleCoordinateSystem: gaze-on-screen
EnvironmentCoordinates: top-left
ScreenDistance: {distance}
ScreenOrigin: [top, left]
ScreenRefreshRate: 60
ScreenSize: [{width}, {height}]
"""
OF_MNE: Final = """
import sys
import mne
from mne.preprocessing.eyetracking import Calibration
from mne_bids import BIDSPath, write_raw_bids

source, root, width, height, *size = sys.argv[1:]
raw = mne.io.read_raw_eyelink(source, verbose="error")
eyes = {name.split("_")[1] for name in raw.ch_names if name.startswith("xpos_")}
calibrations = [
    Calibration(
        onset=0.0, model="HV9", eye=eye, avg_error=0.4, max_error=0.9, positions=None,
        offsets=None, gaze=None, screen_size=[float(v) for v in size[:2]],
        screen_distance=float(size[2]), screen_resolution=[int(width), int(height)],
    )
    for eye in sorted(eyes)
]
for calibration in calibrations:
    calibration["screen_origin"] = ["top", "left"]
raw.pick(["eyegaze", "pupil"])
path = BIDSPath(
    subject="01", task="view", root=root, datatype="beh", recording="eye1", suffix="physio",
    extension=".tsv.gz",
)
write_raw_bids(
    raw, path, allow_preload=True, format="auto", eyetrack_calibration=calibrations,
    verbose="error",
)
"""


def by_eye2bids(asc: Path, file: TrackerFile, root: Path, python: Path) -> Path:
    """Convert a recording by eye2bids; return the first eye's file."""
    programs = root / "programs"
    programs.mkdir()
    stand_in = programs / "edf2asc"
    stand_in.write_text(STAND_IN.format(python=sys.executable), encoding="utf-8")
    stand_in.chmod(stand_in.stat().st_mode | stat.S_IXUSR)
    edf = root / "sub-01_task-view.edf"
    edf.write_bytes(asc.read_bytes())
    width, height, distance = SCREEN_M
    metadata = root / "metadata.yml"
    metadata.write_text(METADATA.format(width=width, height=height, distance=distance))
    out = root / "set"
    code = "import sys; from eye2bids._cli import cli; cli(sys.argv)"
    options = ["--input_file", edf, "--metadata_file", metadata, "--output_dir", out]
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    _run([python, "-c", code, *options], {**os.environ, "PATH": path})
    (out / "dataset_description.json").write_text('{"Name": "x", "BIDSVersion": "1.11.1"}')
    return out / f"{edf.stem}_recording-eye1_physio.tsv.gz"


def by_mne_bids(asc: Path, file: TrackerFile, root: Path, python: Path) -> Path:
    """Convert a recording by mne-bids; return the first eye's file."""
    out = root / "set"
    if file.rate_hz > MAX_RATE_OF_MNE_HZ:
        raise NotConvertedError("mne reads every second sample of 2000 Hz")
    _run([python, "-c", OF_MNE, asc, out, *file.screen_px.split("x"), *SCREEN_M], os.environ)
    return out / "sub-01" / "beh" / "sub-01_task-view_recording-eye1_physio.tsv.gz"


WRITERS: Final[dict[str, Callable[[Path, TrackerFile, Path, Path], Path]]] = {
    "eye2bids": by_eye2bids,
    "mne-bids": by_mne_bids,
}


class NotConvertedError(LabError):
    """A program did not convert a recording; its last line says why."""


def _run(command: Sequence[Any], environment: Any) -> None:
    done = subprocess.run(
        list(map(str, command)), env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise NotConvertedError((done.stderr.strip() or done.stdout.strip()).splitlines()[-1])


def judged(writer: str, file: TrackerFile, asc: Path, python: Path) -> dict[str, Any]:
    """Convert one recording, import it, and hold it against the `.asc` file."""
    row: dict[str, Any] = {"writer": writer, "file": Path(file.path).name, "problems": []}
    with tempfile.TemporaryDirectory() as folder:
        try:
            path = WRITERS[writer](asc, file, Path(folder), python)
            if not path.exists():
                raise NotConvertedError(f"wrote no {path.name}")
        except NotConvertedError as error:
            return row | {"not_converted": str(error)}
        row["problems"] += [
            what
            for verdict in check_foreign(Path(folder) / "set")
            if verdict.level == Level.RED and file.rate_hz  # an excerpt has gaps
            for what, _ in verdict.findings
        ]
        recording = read_bids(path)
        gaze = prepare(recording)
    row |= {"rows": len(recording), "eyes": " ".join(recording.eyes), "rate_hz": gaze.rate_hz}
    blocks = read_recordings([asc], "eyelink", None, file.screen)
    row["problems"] += _differences(recording, blocks)
    lost_01 = [
        float(quality_table(each)["lost_01"].iloc[-1]) for each in (gaze, prepare(blocks[0]))
    ]
    if file.rate_hz and len(blocks) == 1 and abs(lost_01[0] - lost_01[1]) > MAX_LOSS_OFF_01:
        row["problems"].append(f"{lost_01[0]:.4f} lost, {lost_01[1]:.4f} in the file")
    return row | {"lost_01": lost_01[0]}


def _differences(recording: GazeRecording, blocks: Sequence[GazeRecording]) -> list[str]:
    """Return in what a recording differs from the blocks of the file it was made from."""
    problems = []
    n_rows = sum(len(block) for block in blocks)
    if set(recording.eyes) != set(blocks[0].eyes):
        problems.append(f"{' '.join(recording.eyes)} instead of {' '.join(blocks[0].eyes)}")
    for name in set(recording.eyes) & set(blocks[0].eyes):
        ours = np.concatenate([block.eyes[name].direction for block in blocks])
        theirs = recording.eyes[name].direction
        ours, theirs = (d[np.isfinite(d).all(axis=1)] for d in (ours, theirs))
        if len(ours) != len(theirs):
            problems.append(f"{name}: {len(theirs)} of {len(ours)} samples with gaze")
            continue
        off = float(np.max(angle_deg(ours, theirs), initial=0.0))
        if off > MAX_OFF_DEG:
            problems.append(f"{name}: {off:.3g} deg off")
    if len(recording) != n_rows:
        problems.append(f"{len(recording)} of {n_rows} rows")
    return problems


def main(argv: Sequence[str]) -> int:
    """Print a row per file and program; 1 where one misses a limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="files of tracker_files")
    parser.add_argument("--python", type=Path, required=True, help="has eye2bids and mne-bids")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv)
    rows = []
    for file in tracker_files():
        if file.format != "eyelink":
            continue
        with tempfile.TemporaryDirectory() as folder:
            asc = fetched(file, arguments.folder, may_fetch=False)
            if asc.suffix == ".gz":
                asc = Path(folder) / asc.stem
                asc.write_bytes(read_packed(fetched(file, arguments.folder, may_fetch=False)))
            for writer in WRITERS:
                try:
                    row = judged(writer, file, asc, arguments.python)
                except LabError as error:
                    row = {"writer": writer, "file": asc.name, "problems": [str(error)]}
                rows.append(row)
                if not arguments.json:
                    text = "; ".join(row["problems"]) or row.get("not_converted", "")
                    text = f"not converted: {text}" if "not_converted" in row else text
                    figures = f"{row['rows']:6d} rows {row['eyes']}" if "rows" in row else ""
                    print(f"{writer:<9} {asc.name:<38} {figures:<24} {text or 'as in the file'}")
    n_bad = sum(bool(row["problems"]) for row in rows)
    n_made = sum("not_converted" not in row for row in rows)
    if arguments.json:
        print(json.dumps(rows, indent=2))
    else:
        print(f"{n_made - n_bad} of {n_made} converted recordings as in their files")
    return int(n_bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
