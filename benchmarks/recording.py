"""Measure what recording costs per sample and batch, and how fast a session loads.

    python -m benchmarks.recording [--json]

The streams are a gaze tracker's ten columns at 120 Hz and a scene of 60 numbers at 90 Hz; one
session is 170 000 samples of the latter. "Ratio" is limit / value: 1 or more is within the limit.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from visavis.lab.clock import NS_PER_S, SimClock, StopWatch, SystemClock
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.recording.columns import BatchEncoder
from visavis.recording.folder import create_session
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.writer import REAL_TIME_BATCH_NS, VIRTUAL_TIME_BATCH_NS, Recorder

GAZE = StreamSchema(
    "gaze",
    tuple(Field(f"column_{i}_deg", "f4", "deg") for i in range(10)),
    120.0,
)
SCENE = StreamSchema(
    "scene",
    (
        Field("angle_deg", "f4", "deg", shape=(11,)),
        Field("radius_deg", "f4", "deg", shape=(11,)),
        Field("head_m", "f4", "m", "world", (11, 3)),
        Field("hit", "i2", ""),
        Field("valid", "?", ""),
    ),
    90.0,
)
SESSION_ROWS = 170_000


def batches_of(schema: StreamSchema, n: int, rows: int) -> list[SampleBatch]:
    """Return n batches of `rows` samples at the stream's rate."""
    values = empty_values(schema, rows)
    spacing_ns = int(NS_PER_S / schema.nominal_rate_hz)
    stamps = np.arange(n * rows, dtype=np.int64)
    t_ns = stamps * spacing_ns
    cuts = [slice(i, i + rows) for i in range(0, n * rows, rows)]
    return [SampleBatch(schema, stamps[c], t_ns[c], t_ns[c], values) for c in cuts]


def microseconds(call: Callable[[], object], times: int) -> float:
    """Return the least mean of five rounds."""
    call()
    rounds = []
    for _ in range(5):
        watch = StopWatch()
        for _ in range(times):
            call()
        rounds.append(watch.elapsed_s() / times * 1e6)
    return min(rounds)


def recorder_in(folder: Path, *, threaded: bool) -> Recorder:
    """Return a recorder in a new folder with the gaze stream declared."""
    folder.mkdir()
    clock = SystemClock() if threaded else SimClock()
    recorder = Recorder(
        folder,
        clock,
        threaded=threaded,
        max_batch_ns=REAL_TIME_BATCH_NS if threaded else VIRTUAL_TIME_BATCH_NS,
        is_simulated=True,
    )
    recorder.declare(GAZE)
    return recorder


def append_us(folder: Path, rows: int, *, threaded: bool) -> float:
    """Return the mean cost of one `append`, inline writing included."""
    recorder = recorder_in(folder, threaded=threaded)
    batches = batches_of(GAZE, 500 if threaded else 20_000, rows)
    rounds = []
    for _ in range(5):
        watch = StopWatch()
        for batch in batches:
            recorder.append(batch)
        rounds.append(watch.elapsed_s() / len(batches) * 1e6)
        recorder.checkpoint()
    recorder.close("complete")
    return min(rounds)


def trial_ms(folder: Path) -> float:
    """Return the median time until a trial of 16 s is on the disk."""
    recorder = recorder_in(folder, threaded=False)
    times = []
    for _ in range(20):
        for batch in batches_of(GAZE, 960, 2):
            recorder.append(batch)
        watch = StopWatch()
        recorder.trial({"trial_id": "T", "dwell_ms": 1.0})
        times.append(watch.elapsed_s() * 1e3)
    recorder.close("complete")
    return float(np.median(times))


def session_figures(root: Path) -> tuple[float, float, float]:
    """Return bytes per row of a long stream, raw bytes per row, and milliseconds to load it."""
    clock = SimClock()
    manifest = Manifest(
        study="benchmark",
        participant="P01",
        session=1,
        is_simulated=True,
        plan={},
        seed=0,
        configuration={},
        devices=(),
        consent_version="",
        created_wall_iso=clock.wall_iso(),
        provenance=provenance(),
    )
    with create_session(root, manifest) as folder:
        recorder = Recorder(
            folder.begin_part(clock),
            clock,
            threaded=False,
            max_batch_ns=VIRTUAL_TIME_BATCH_NS,
            is_simulated=True,
        )
        recorder.declare(SCENE)
        for batch in batches_of(SCENE, SESSION_ROWS // 10, 10):
            recorder.append(batch)
        summary = recorder.close("complete")
        folder.end_part(clock, summary)
    load_us = microseconds(lambda: Recording(folder.path).stream_arrays("scene"), 1)
    return summary.streams[0].bytes / SESSION_ROWS, SCENE.dtype.itemsize + 24.0, load_us / 1e3


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    encoder = BatchEncoder(GAZE, is_simulated=True)
    stamps, values = np.zeros((3, 12), np.int64), empty_values(GAZE, 12)
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        bytes_per_row, raw_bytes, load_ms = session_figures(root)
        figures: list[tuple[str, float, str, float | None]] = [
            ("append, 1 sample, inline", append_us(root / "a", 1, threaded=False), "us", 5.0),
            ("append, 3 samples, inline", append_us(root / "b", 3, threaded=False), "us", 5.0),
            ("append, 2 samples, threaded", append_us(root / "c", 2, threaded=True), "us", 5.0),
            (
                "encode a batch of 12 x 13 columns",
                microseconds(lambda: encoder.encode(stamps, values, 0), 2000),
                "us",
                150.0,
            ),
            ("trial of 16 s to disk, median", trial_ms(root / "d"), "ms", 30.0),
            ("bytes per row, 60 numbers, 1 s batches", bytes_per_row, "B", 1.05 * raw_bytes),
            ("load 170 000 rows with checks", load_ms, "ms", 100.0),
        ]
    rows = [
        {
            "name": name,
            "value": round(value, 3),
            "unit": unit,
            "limit": None if limit is None else round(limit, 3),
            "ratio": None if limit is None else round(limit / value, 2),
        }
        for name, value, unit, limit in figures
    ]
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        for row in rows:
            print(
                f"{row['name']:<42}{row['value']:>10} {row['unit']:<3}"
                f" limit {row['limit']:>8}  ratio {row['ratio']}"
            )
    return 0 if all(limit is None or limit >= value for _, value, _, limit in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
