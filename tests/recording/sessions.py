"""Small sessions to test with; run as a module to write the stored sample anew.

python -m tests.recording.sessions tests/recording/data
"""

import shutil
import sys
from pathlib import Path

import numpy as np

from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.recording.folder import SessionFolder, create_session
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import Provenance
from visavis.recording.writer import Recorder

PROBE = StreamSchema(
    name="probe",
    nominal_rate_hz=100.0,
    fields=(
        Field("position_m", "f4", "m", "world", (3,), "somewhere"),
        Field("orientation_wxyz", "f8", "1", "world", (4,)),
        Field("valid", "?", ""),
        Field("flags", "?", "", shape=(3,)),
        Field("angle_deg", "f8", "deg", description="NaN if lost"),
        Field("code", "u2", ""),
    ),
)


def probe_batch(first: int, n: int) -> SampleBatch:
    """Return samples first..first+n-1 of a stream whose every value follows from its number."""
    seq = np.arange(first, first + n, dtype=np.int64)
    values = empty_values(PROBE, n)
    values["position_m"] = seq[:, None] + np.array([0.25, 0.5, 0.75])
    values["orientation_wxyz"] = [1.0, 0.0, 0.0, 0.0]
    values["valid"] = seq % 3 == 0
    values["flags"] = (seq[:, None] + np.arange(3)) % 2 == 0
    values["angle_deg"] = np.where(seq % 7 == 0, np.nan, seq / 3)
    values["code"] = seq % 1000
    t_ns = seq * 10 * NS_PER_MS
    return SampleBatch(PROBE, seq, t_ns + 5, t_ns, values)


def probe_manifest(
    participant: str = "P01", session: int = 1, *, is_simulated: bool = True
) -> Manifest:
    """Return a manifest that depends on nothing outside this file."""
    return Manifest(
        study="probe",
        participant=participant,
        session=session,
        is_simulated=is_simulated,
        plan={"trials": ["T01", "T02", "T03"]},
        seed=7,
        configuration={"rooms": {"name": "ségur"}},
        devices=[{"role": "gaze", "capabilities": frozenset({"b", "a"})}],
        consent_version="1",
        created_wall_iso="2000-01-01T00:00:00+00:00",
        provenance=Provenance("3.11", {"numpy": "2"}, ""),
    )


def new_recorder(folder: SessionFolder, clock: SimClock, *, is_simulated: bool = True) -> Recorder:
    """Begin a part and return its recorder, the probe stream declared."""
    recorder = Recorder(
        folder.begin_part(clock),
        clock,
        threaded=False,
        max_batch_ns=NS_PER_S,
        is_simulated=is_simulated,
    )
    recorder.declare(PROBE)
    return recorder


def record_trials(recorder: Recorder, clock: SimClock, trials: range, rows: int = 150) -> None:
    """Record trials of `rows` samples each, ten samples a batch."""
    for trial in trials:
        for first in range(trial * rows, (trial + 1) * rows, 10):
            recorder.append(probe_batch(first, 10))
        clock.sleep_until_ns((trial + 1) * rows * 10 * NS_PER_MS)
        recorder.event("trial_end", clock.now_ns(), trial_id=f"T{trial:02d}", note="é")
        recorder.trial({"trial_id": f"T{trial:02d}", "dwell_ms": 1.5 * trial, "first_ms": None})


def record_session(
    data_root: Path,
    n_trials: int = 3,
    *,
    participant: str = "P01",
    is_simulated: bool = True,
    rows: int = 150,
) -> Path:
    """Record a complete session of one part and return its folder."""
    clock = SimClock()
    manifest = probe_manifest(participant, is_simulated=is_simulated)
    with create_session(data_root, manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=is_simulated)
        record_trials(recorder, clock, range(n_trials), rows)
        folder.end_part(clock, recorder.close("complete"))
        return folder.path


if __name__ == "__main__":
    target = Path(sys.argv[1]) / "format_2"
    shutil.rmtree(target, ignore_errors=True)
    record_session(target, 2)
