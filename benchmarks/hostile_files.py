"""Give readers files that unpack to gigabytes or never end, and measure memory and time.

python -m benchmarks.hostile_files [--gigabytes 6] [--json]

Each file is read in a process of its own. Every one has to be refused with an error of ours, within
1 GB of memory and 10 s.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from visavis.lab.clock import StopWatch

MAX_MB: Final = 1000.0
MAX_S: Final = 10.0
PIECE: Final = bytes(1 << 20)
CHILD: Final = """
import resource, sys
from pathlib import Path
from visavis.lab.errors import LabError
path = Path(sys.argv[1])
{load}
try:
    {read}
    said = "taken"
except (LabError, ValueError) as error:
    said = "refused: " + str(error)[:60]
except BaseException as error:
    said = "traceback: " + type(error).__name__
print(said)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000)
"""
READERS: Final = {
    "motion.npz": (
        "from visavis.stimuli.motion.clip_file import read_clip",
        "read_clip(path)",
    ),
    "character.npz": (
        "from visavis.stimuli.characters.storage import read_character",
        "read_character(path)",
    ),
    "results.jrzip": (
        "from visavis.running.page.other_hosts.results import read_runs",
        "list(read_runs([path]))",
    ),
    "deep.json": (
        "from visavis.lab.plain_files import parse_json, read_plain",
        "parse_json(read_plain(path))",
    ),
    "aliases.yaml": (
        "from visavis.lab.yaml_lines import parse_document",
        "parse_document(path.read_text(), path)",
    ),
}


def write_hostile(path: Path, gigabytes: float) -> None:
    """Write a small file that becomes large."""
    if path.suffix == ".json":
        path.write_bytes(b"[" * 50_000_000)
    elif path.suffix == ".yaml":
        lines = ["a0: &a0 [x, x]"]
        lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
        path.write_text("\n".join(lines), "utf-8")
    else:
        inner = "positions.npy" if path.suffix == ".npz" else "study_result_1/data.txt"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            with archive.open(inner, "w", force_zip64=True) as file:
                if path.suffix == ".npz":
                    about = {"descr": "<f8", "fortran_order": False}
                    shape = (round(gigabytes * len(PIECE) * 128),)
                    np.lib.format.write_array_header_1_0(file, {**about, "shape": shape})
                for _ in range(round(gigabytes * 1024)):
                    file.write(PIECE)


def read(path: Path) -> tuple[str, float, float]:
    """Read a file in a process of its own; return what was said, the memory in MB and seconds."""
    load, act = READERS[path.name]
    watch = StopWatch()
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(load=load, read=act), str(path)],
        capture_output=True,
        text=True,
    )
    lines = done.stdout.splitlines()
    if len(lines) < 2:
        return f"died: {done.stderr[-60:]!r}", float("inf"), watch.elapsed_s()
    return " ".join(lines[:-1]), float(lines[-1]), watch.elapsed_s()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per file; 1 if one was taken, or cost too much."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--gigabytes", type=float, default=6.0, help="what archives unpack to")
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    options = parser.parse_args(arguments)
    outcomes = {}
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        for name in READERS:
            path = Path(folder) / name
            write_hostile(path, options.gigabytes)
            outcomes[name] = read(path)
    if options.json:
        print(json.dumps(outcomes))
    else:
        for name, (said, mb, seconds) in outcomes.items():
            print(f"{name:16}{mb:8.0f} MB{seconds:7.1f} s  {said}")
    costs_little = all(mb <= MAX_MB and s <= MAX_S for _, mb, s in outcomes.values())
    return 0 if costs_little and all(o[0].startswith("refused") for o in outcomes.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
