"""Cut a recording computer's power at many moments, and count acknowledged trials that are gone.

python -m benchmarks.power_loss [--cuts 1000] [--seed 1] [--json]

One session is recorded while every write and sync of its files is logged. For each cut the log is
replayed to a random moment as a disk may be left there: what was synced is there; of the blocks
written since, any may be lost, later ones kept while earlier ones are gone (a hole of zeros), and
the file may end anywhere behind what was synced. `lost trials` were acknowledged (the call that
writes their row had returned) and cannot be read; `lost samples` stood before an acknowledged
trial; `changed` rows or samples are read as something that was not written.
"""

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from visavis.lab.clock import NS_PER_MS, SimClock
from visavis.lab.errors import LabError
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.recording.durable import AppendOnlyFile
from visavis.recording.folder import create_session
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.recovery import recover
from visavis.recording.writer import Recorder

BLOCK_BYTES = 512
TRIALS, SAMPLES_PER_TRIAL, BATCH = 40, 120, 12
SAMPLE_NS = 10 * NS_PER_MS
COUNTED = StreamSchema("counted", (Field("value_m", "f8", "m", "world", (3,)),), 100.0)


@dataclass(frozen=True)
class Step:
    """One thing that happened: `kind` is write, sync or trial (acknowledged)."""

    kind: str
    path: Path | None = None
    data: bytes = b""


@dataclass
class Outcome:
    """What the cuts cost; everything but `cuts` and `trials` should be 0."""

    cuts: int = 0
    trials: int = 0
    lost_trials: int = 0
    lost_samples: int = 0
    changed: int = 0
    unreadable: int = 0


@contextmanager
def logged(log: list[Step]) -> Iterator[None]:
    """Log every write and sync of append-only files."""
    write, sync = AppendOnlyFile.write, AppendOnlyFile.sync

    def noted_write(self: AppendOnlyFile, data: bytes | bytearray | memoryview) -> None:
        write(self, data)
        log.append(Step("write", self.path, bytes(data)))

    def noted_sync(self: AppendOnlyFile) -> None:
        sync(self)
        log.append(Step("sync", self.path))

    AppendOnlyFile.write, AppendOnlyFile.sync = noted_write, noted_sync  # type: ignore[method-assign]  # put back below
    try:
        yield
    finally:
        AppendOnlyFile.write, AppendOnlyFile.sync = write, sync  # type: ignore[method-assign]  # as it was


def record(root: Path, log: list[Step]) -> Path:
    """Record a session of counted samples and trials; return its folder, its part still open."""
    clock = SimClock()
    manifest = Manifest(
        study="power",
        participant="P01",
        session=1,
        is_simulated=True,
        plan={},
        seed=1,
        configuration={},
        devices=(),
        consent_version="1",
        created_wall_iso=clock.wall_iso(),
        provenance=provenance(),
    )
    with create_session(root, manifest) as folder, logged(log):
        recorder = Recorder(
            folder.begin_part(clock),
            clock,
            threaded=False,
            max_batch_ns=100 * NS_PER_MS,
            is_simulated=True,
        )
        recorder.declare(COUNTED)
        for trial in range(TRIALS):
            for first in range(0, SAMPLES_PER_TRIAL, BATCH):
                seq = np.arange(BATCH) + trial * SAMPLES_PER_TRIAL + first
                clock.sleep_until_ns(int(seq[-1]) * SAMPLE_NS)
                values = empty_values(COUNTED, BATCH)
                values["value_m"] = seq[:, None] + np.array([0.1, 0.2, 0.3])
                recorder.append(SampleBatch(COUNTED, seq, seq * SAMPLE_NS, seq * SAMPLE_NS, values))
            recorder.trial({"trial_id": f"T{trial:03d}", "status": "complete", "number": trial})
            log.append(Step("trial"))
        return folder.path


def replay(log: Sequence[Step], until: int, rng: np.random.Generator) -> dict[Path, bytes]:
    """Return what a disk may hold of each file when the power fails after so many steps."""
    written: dict[Path, bytearray] = {}
    synced: dict[Path, int] = {}
    for step in log[:until]:
        if step.path is not None:
            content = written.setdefault(step.path, bytearray())
            content += step.data
            if step.kind == "sync":
                synced[step.path] = len(content)
    left = {}
    for path, content in written.items():
        safe = synced.get(path, 0)
        end = int(rng.integers(safe, len(content) + 1))
        kept = bytearray(content[:end])
        for start in range(safe, end, BLOCK_BYTES):
            if rng.random() < 0.5:
                stop = min(start + BLOCK_BYTES, end)
                kept[start:stop] = bytes(stop - start)
        left[path] = bytes(kept)
    return left


def cut(log: Sequence[Step], session: Path, root: Path, seed: int, outcome: Outcome) -> None:
    """Cut the power at one moment, read what is left, and add up what it cost."""
    rng = np.random.default_rng([seed, outcome.cuts])
    until = int(rng.integers(1, len(log) + 1))
    acknowledged = sum(step.kind == "trial" for step in log[:until])
    outcome.cuts += 1
    outcome.trials += acknowledged
    there = root / session.relative_to(session.parents[1])
    shutil.rmtree(root, ignore_errors=True)
    (there / "part-01").mkdir(parents=True)
    for name in ("manifest.json", "manifest.copy.json"):
        shutil.copyfile(session / name, there / name)
    for path, data in replay(log, until, rng).items():
        (there / "part-01" / path.name).write_bytes(data)
    try:
        recover(there)
        recording = Recording(there)
        rows = {str(r["trial_id"]): int(r["number"]) for r in recording.trials().to_dict("records")}
        samples = recording.stream_arrays("counted") if "counted" in recording.stream_names else {}
    except LabError:
        outcome.unreadable += 1
        return
    expected = {f"T{i:03d}": i for i in range(TRIALS)}
    outcome.lost_trials += sum(f"T{i:03d}" not in rows for i in range(acknowledged))
    outcome.changed += sum(expected.get(name) != number for name, number in rows.items())
    seq = np.asarray(samples.get("seq", np.zeros(0, np.int64)))
    outcome.lost_samples += acknowledged * SAMPLES_PER_TRIAL - int(
        np.isin(np.arange(acknowledged * SAMPLES_PER_TRIAL), seq).sum()
    )
    if len(seq):
        wanted = seq[:, None] + np.array([0.1, 0.2, 0.3])
        outcome.changed += int((samples["value_m"] != wanted).any(axis=1).sum())


def measure(cuts: int, seed: int, root: Path) -> Outcome:
    """Record once, cut so often; return what it cost."""
    log: list[Step] = []
    session = record(root / "whole", log)
    outcome = Outcome()
    for _ in range(cuts):
        cut(log, session, root / "left", seed, outcome)
    return outcome


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the outcome; exit status 1 when anything acknowledged is gone or changed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cuts", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as root:
        outcome = measure(options.cuts, options.seed, Path(root))
    found = asdict(outcome)
    if options.json:
        sys.stdout.write(json.dumps(found) + "\n")
    else:
        for name, value in found.items():
            limit = "" if name in ("cuts", "trials") else "limit 0"
            sys.stdout.write(f"{name.replace('_', ' '):16} {value:8} {limit}\n")
    bad = outcome.lost_trials + outcome.lost_samples + outcome.changed + outcome.unreadable
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
