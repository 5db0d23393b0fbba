"""Damage a small study in every way a disk, a copy or a hand can, and see whether it is named.

python -m benchmarks.damage [--changes 10000] [--analysed 500] [--json] [--seed 1] [--keep DIR]

Two people of a short waving study are simulated and analysed. Every change hits one file of the
study's folder, drawn anew: a flipped bit, a cut, bytes overwritten with zeros, two blocks of the
file exchanged, its content exchanged with that of another file of its kind, or the file removed.
After each, settings, ledger, lists, register, derived files and the sessions that were touched are
verified as `visavis check STUDY` does, and the folder is put back.

`unnamed` counts changes after which nothing was said; `tracebacks` those that ended in an error
that is none of ours; `repaired` how many of the changes to files with a copy `visavis recover`
undid byte for byte. After the first `--analysed` changes of a session's files the session is also
taken in as `visavis analyse` does: `stopped` counts those it refused, `same_numbers` those it
measured as before (a damaged copy), `other_numbers` those whose trial rows differ without a word.
"""

import argparse
import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from visavis.cli.main import main as visavis
from visavis.lab.clock import StopWatch
from visavis.lab.errors import LabError
from visavis.recording.reader import Recording
from visavis.recording.sealed import copy_path
from visavis.results.opened_study import find_study
from visavis.running.sessions.damage import require_intact
from visavis.running.sessions.folder_check import repair_study, session_problems, study_problems

STUDY = "waving"
SHORT = (
    "clerk=[clerk_left]",
    "increment=0.1",
    "before_s=0.3",
    "wave_s=0.6",
    "after_s=0.1",
    "blocks=1",
)
"""Parameters that make sessions short."""

BLOCK_BYTES = 64

Change = Callable[[bytes, np.random.Generator], bytes]


def flip(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip one bit."""
    at, bit = int(rng.integers(len(data))), 1 << int(rng.integers(8))
    return data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :]


def cut(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut the file anywhere."""
    return data[: int(rng.integers(len(data)))]


def zeros(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrite up to a block with zeros."""
    at = int(rng.integers(len(data)))
    n = min(int(rng.integers(1, BLOCK_BYTES)), len(data) - at)
    return data[:at] + bytes(n) + data[at + n :]


def exchange(data: bytes, rng: np.random.Generator) -> bytes:
    """Exchange two blocks."""
    if len(data) < 2 * BLOCK_BYTES:
        return data[::-1]
    a, b = sorted(rng.choice(len(data) // BLOCK_BYTES, 2, replace=False) * BLOCK_BYTES)
    blocks = data[a : a + BLOCK_BYTES], data[b : b + BLOCK_BYTES]
    return data[:a] + blocks[1] + data[a + BLOCK_BYTES : b] + blocks[0] + data[b + BLOCK_BYTES :]


CHANGES: dict[str, Change] = {"flip": flip, "cut": cut, "zeros": zeros, "exchange": exchange}
KINDS = (*CHANGES, "swap", "remove")
SHARES = (0.5, 0.15, 0.1, 0.1, 0.1, 0.05)


class DamagedStudy:
    """A study whose files are changed one at a time and put back."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        paths = [p for p in sorted(folder.rglob("*")) if p.is_file() and p.stat().st_size]
        self.content = {p: p.read_bytes() for p in paths}
        for path in paths:
            path.chmod(0o600)
        self.rows = {session: _rows_of(session) for session in folder.glob("sub-*/ses-*")}

    def change(self, kind: str, rng: np.random.Generator) -> tuple[Path, ...]:
        """Damage one file and return those that differ now; none where chance changed nothing."""
        path = list(self.content)[int(rng.integers(len(self.content)))]
        data = self.content[path]
        if kind in CHANGES:
            changed = CHANGES[kind](data, rng)
            path.write_bytes(changed)
            return (path,) if changed != data else ()
        if kind == "remove":
            path.unlink()
            return (path,)
        others = [
            p for p in self.content if p.name == path.name and p != path and self.content[p] != data
        ]
        if not others:
            return ()
        other = others[int(rng.integers(len(others)))]
        path.write_bytes(self.content[other])
        other.write_bytes(data)
        return path, other

    def put_back(self, changed: tuple[Path, ...]) -> None:
        """Make the changed files, and those that recovery touched, what they were."""
        small = [p for p in self.content if copy_path(p) in self.content or ".copy." in p.name]
        for path in {*changed, *small}:
            if not path.exists() or path.read_bytes() != self.content[path]:
                path.write_bytes(self.content[path])
                path.chmod(0o600)
        for path in self.folder.rglob("*.damaged"):
            path.unlink()

    def judge(self, kind: str, changed: tuple[Path, ...]) -> str:
        """Return "named", "unnamed" or "traceback" for what was changed."""
        touched = {p for path in changed for p in path.parents if p.name.startswith("ses-")}

        def problems_of(session: Path) -> tuple[str, ...]:
            return session_problems(session) if session in touched else ()

        try:
            return "named" if study_problems(self.folder, problems_of) else "unnamed"
        except LabError:
            return "named"
        except Exception as error:  # the benchmark counts what should never come
            names = ", ".join(p.name for p in changed)
            print(f"{kind} of {names}: {error!r}", file=sys.stderr)
            return "traceback"

    def numbers_after(self, changed: tuple[Path, ...]) -> str:
        """Return "stopped", "same_numbers" or "other_numbers" for the sessions that changed."""
        sessions = sorted({p for c in changed for p in c.parents if p.name.startswith("ses-")})
        try:
            require_intact(sessions, accept=False)
            same = all(self.rows[s].equals(_rows_of(s)) for s in sessions)
        except LabError:
            return "stopped"
        return "same_numbers" if same else "other_numbers"

    def is_repaired(self, changed: tuple[Path, ...]) -> bool | None:
        """Recover and tell whether the changed files are whole again; None without a copy."""
        if not all(copy_path(p) in self.content for p in changed):
            return None
        try:
            repair_study(self.folder)
        except LabError:
            return False
        return all(p.exists() and p.read_bytes() == self.content[p] for p in changed)


def _rows_of(session: Path) -> pd.DataFrame:
    rows: pd.DataFrame = find_study(STUDY).measure(Recording(session)).rows
    return rows


def simulated_study(root: Path) -> Path:
    """Simulate and analyse a small study; return its folder."""
    options = [text for setting in SHORT for text in ("--set", setting)]
    arguments = ["simulate", STUDY, "--participants", "2", "--seed", "1", "--processes", "1"]
    folder = root / "simulated" / STUDY
    for command in (
        [*arguments, "--output", str(root), *options],
        ["analyse", str(folder), "--processes", "1"],
    ):
        try:
            visavis(command)
        except SystemExit as end:
            if end.code:
                raise
    return folder


def measure(folder: Path, changes: int, seed: int, analysed: int) -> dict[str, object]:
    """Damage a study so many times; return the counts."""
    study = DamagedStudy(folder)
    if problems := study_problems(folder):
        raise SystemExit(f"the study is not intact to begin with: {problems[0]}")
    rng = np.random.default_rng(seed)
    counts: Counter[tuple[str, str]] = Counter()
    repaired: Counter[bool] = Counter()
    numbers: Counter[str] = Counter()
    places: dict[str, list[str]] = {"unnamed": [], "not repaired": []}
    watch = StopWatch()
    done = 0
    while done < changes:
        kind = str(rng.choice(KINDS, p=SHARES))
        changed: tuple[Path, ...] = tuple(study.content)  # until it is known which
        try:
            changed = study.change(kind, rng)
            if changed:
                done += 1
                outcome = study.judge(kind, changed)
                counts[kind, outcome] += 1
                in_session = any(p.name.startswith("ses-") for c in changed for p in c.parents)
                if in_session and numbers.total() < analysed:
                    numbers[study.numbers_after(changed)] += 1
                if outcome == "unnamed":
                    places["unnamed"].append(_said(kind, changed, folder))
                whole = study.is_repaired(changed) if outcome == "named" else None
                if whole is not None:
                    repaired[whole] += 1
                if whole is False:
                    places["not repaired"].append(_said(kind, changed, folder))
        finally:
            study.put_back(changed)
    return {
        "changes": done,
        "files": len(study.content),
        "bytes": sum(map(len, study.content.values())),
        "by_kind": {
            kind: sum(counts[kind, o] for o in ("named", "unnamed", "traceback")) for kind in KINDS
        },
        "unnamed": sum(n for (_, outcome), n in counts.items() if outcome == "unnamed"),
        "tracebacks": sum(n for (_, outcome), n in counts.items() if outcome == "traceback"),
        "analysed": numbers.total(),
        **{what: numbers[what] for what in ("stopped", "same_numbers", "other_numbers")},
        "with_a_copy": sum(repaired.values()),
        "repaired": repaired[True],
        "where": {what: found[:20] for what, found in places.items()},
        "seconds": round(watch.elapsed_s(), 1),
    }


def _said(kind: str, changed: tuple[Path, ...], folder: Path) -> str:
    return f"{kind}: {', '.join(str(p.relative_to(folder)) for p in changed)}"


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--changes", type=int, default=10_000)
    parser.add_argument("--analysed", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--keep", type=Path, help="keep the study here, and use it again")
    options = parser.parse_args()
    root = options.keep or Path(tempfile.mkdtemp(prefix="damage-"))
    folder = root / "simulated" / STUDY
    if not (folder / "exports.jsonl").exists():
        folder = simulated_study(root)
    try:
        found = measure(folder, options.changes, options.seed, options.analysed)
    finally:
        if options.keep is None:
            shutil.rmtree(root, ignore_errors=True)
    if options.json:
        print(json.dumps(found))
        return
    for name, value in found.items():
        print(f"{name:<16} {value}")


if __name__ == "__main__":
    main()
