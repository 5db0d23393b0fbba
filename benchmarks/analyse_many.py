"""Analyse ever more participants and see whether time stays linear and memory flat. Linux, macOS.

python -m benchmarks.analyse_many [--participants 100] [--simulated N] [--rounds 3] [--json]
    [--keep DIR]

Short stare sessions are simulated once; a quarter, half and all of them are then analysed by the
command, one process each, from folders that share the recordings. With `--simulated` only so many
people are simulated, the others are their recordings again, under labels of their own. A line
through the first two sizes gives what the whole should take: `time_over_linear` is what it took
over that, limit 1.1. A run that compiles comes first and does not count; then every size is
analysed once a round, and its least CPU time counts: other work on the machine can only add to it,
and the line would carry that three times over. Memory is the largest the process ever had; what a
participant adds to it counts, because the tables of all of them are held.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from visavis.protocol.people.identifiers import make_label
from visavis.recording.durable import sha256_of
from visavis.recording.folder import SIMULATED_ROOT
from visavis.recording.journal import JOURNAL_NAME, encode_line
from visavis.recording.manifest import read_manifest, write_manifest
from visavis.running.sessions.study_folder import SIMULATED_PREFIX

STUDY = "stare"
SESSION = "ses-001"
SHORT = ("trial_s=1", "practice_s=1", "intertrial_s=0.2", "repetitions=1")
ALONE = ("--processes", "1")
MIN_PARTICIPANTS = 2
LIMIT_OVER_LINEAR = 1.1
LIMIT_MB_PER_PARTICIPANT = 1.0
REPOSITORY = Path(__file__).resolve().parents[1]
KIB = 1 if sys.platform == "darwin" else 1024
"""Bytes of the unit that the system gives a process's memory in."""


def visavis(*arguments: str) -> tuple[float, float]:
    """Run the command; return its CPU seconds and the most memory it had, in MB."""
    child = subprocess.Popen(
        [sys.executable, "-m", "visavis.cli.main", *arguments],
        cwd=REPOSITORY,
        stdout=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(child.pid, 0)
    if os.waitstatus_to_exitcode(status):
        raise SystemExit(f"visavis {' '.join(arguments)} failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * KIB / 1e6


def some_of(study: Path, n: int, root: Path) -> Path:
    """Return a study of the first n participants; the recordings are the same files."""
    target = root / f"of-{n}" / SIMULATED_ROOT / study.name
    target.mkdir(parents=True)
    for file in (p for p in study.iterdir() if p.is_file()):
        shutil.copy2(file, target)
    for person in sorted(study.glob("sub-*"))[:n]:
        shutil.copytree(person, target / person.name, copy_function=os.link)
    return target


def repeat(study: Path, n: int) -> None:
    """Add people until there are n: recordings of those there are, under labels of their own."""
    there = sorted(study.glob("sub-*"))
    for number in range(len(there) + 1, n + 1):
        person = there[(number - 1) % len(there)]
        old, new = person.name.removeprefix("sub-"), make_label(number, SIMULATED_PREFIX)
        copy = study / f"sub-{new}"
        shutil.copytree(person, copy, copy_function=os.link)
        manifest = read_manifest(copy / SESSION)
        parts = []
        for part in manifest.parts:
            journal = copy / SESSION / part.folder / JOURNAL_NAME
            lines = [_renamed(line, old, new) for line in journal.read_bytes().splitlines()]
            journal.unlink()  # the other one's file is linked here
            journal.write_bytes(b"".join(lines))
            kept = part.journal and replace(part.journal, sha256=sha256_of(journal))
            parts.append(replace(part, journal=kept))
        for file in (copy / SESSION).glob("manifest*.json"):
            file.unlink()
        renamed = replace(manifest, participant=new, parts=tuple(parts))
        write_manifest(copy / SESSION, renamed)


def _renamed(line: bytes, old: str, new: str) -> bytes:
    entry = json.loads(line.replace(b'"' + old.encode() + b'"', b'"' + new.encode() + b'"'))
    entry.pop("crc32")
    return encode_line(entry)


def time_over_linear(sizes: Sequence[int], cpu_s: Sequence[float]) -> float:
    """Return the last time over where a line through the first two meets the last size."""
    (small, half, whole), (small_s, half_s, whole_s) = sizes, cpu_s
    per_person_s = (half_s - small_s) / (half - small)
    return whole_s / (half_s + per_person_s * (whole - half))


def main() -> int:
    """Print time and memory of every size; exit status 1 where a limit is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--participants", type=int, default=100)
    parser.add_argument("--simulated", type=int, help="simulate so many; default: all of them")
    parser.add_argument("--rounds", type=int, default=3, help="the least time of so many counts")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--keep", type=Path, help="keep the sessions here, and use them again")
    options = parser.parse_args()
    if options.participants < 4 * MIN_PARTICIPANTS:
        parser.error("a quarter, half and all of them are analysed: eight at least")
    if options.rounds < 1:
        parser.error("--rounds: one at least")
    sizes = [options.participants // 4, options.participants // 2, options.participants]
    with tempfile.TemporaryDirectory(dir=options.keep) as scratch:
        root = options.keep or Path(scratch)
        study = root / SIMULATED_ROOT / STUDY
        simulated = options.simulated or options.participants
        if len(list(study.glob("sub-*"))) < simulated:
            settings = [f"--set={setting}" for setting in SHORT]
            visavis(
                "simulate",
                STUDY,
                "--participants",
                str(simulated),
                "--seed",
                "1",
                "--output",
                str(root),
                *settings,
            )
        repeat(study, options.participants)
        # Not counted: it compiles kernels and fills caches for those after it.
        visavis("analyse", str(some_of(study, MIN_PARTICIPANTS, Path(scratch, "first"))), *ALONE)
        runs: list[list[tuple[float, float]]] = [[] for _ in sizes]
        for number in range(options.rounds):
            for size, found_so_far in zip(sizes, runs, strict=True):
                folder = some_of(study, size, Path(scratch, f"round-{number}"))
                found_so_far.append(visavis("analyse", str(folder), *ALONE))
    cpu_s = [min(cpu_s for cpu_s, _ in of_size) for of_size in runs]
    memory_mb = [max(mb for _, mb in of_size) for of_size in runs]
    found = {
        "participants": sizes,
        "cpu_s": [round(s, 2) for s in cpu_s],
        "memory_mb": [round(mb, 1) for mb in memory_mb],
        "time_over_linear": time_over_linear(sizes, cpu_s),
        "mb_per_participant": (memory_mb[-1] - memory_mb[0]) / (sizes[-1] - sizes[0]),
    }
    if options.json:
        print(json.dumps(found))
    else:
        for name, value in found.items():
            print(f"{name:20} {value}")
    kept = (
        found["time_over_linear"] <= LIMIT_OVER_LINEAR
        and found["mb_per_participant"] <= LIMIT_MB_PER_PARTICIPANT
    )
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
