import gc
import hashlib
import json
import os
import subprocess
import sys
import threading
import tracemalloc
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from tests.recording.sessions import (
    PROBE,
    new_recorder,
    probe_batch,
    probe_manifest,
    record_session,
    record_trials,
)
from visavis.lab.clock import NS_PER_S, SimClock, SystemClock
from visavis.lab.errors import RecordingError
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.recording import durable, writer
from visavis.recording.columns import BatchEncoder
from visavis.recording.folder import create_session
from visavis.recording.journal import JOURNAL_NAME, decode_line
from visavis.recording.reader import Recording
from visavis.recording.writer import Recorder


def recorder_in(folder: Path, **options: object) -> Recorder:
    folder.mkdir(exist_ok=True)
    settings = {"threaded": False, "max_batch_ns": NS_PER_S, "is_simulated": True, **options}
    clock = SystemClock() if settings["threaded"] else SimClock()
    recorder = Recorder(folder, clock, **settings)
    recorder.declare(PROBE)
    return recorder


def test_pyarrow_alone_reads_the_file_and_finds_units(tmp_path: Path) -> None:
    path = record_session(tmp_path) / "part-01" / "probe.arrows"
    with pa.OSFile(str(path)) as source:
        table = pa.ipc.open_stream(source).read_all()
    table.validate(full=True)
    assert table.schema.names[:3] == ["seq", "t_device_ns", "t_host_ns"]
    assert table["seq"].to_pylist() == list(range(450))
    expected = probe_batch(0, 450).values
    assert (np.array(table["position_m"].to_pylist(), "f4") == expected["position_m"]).all()
    assert (np.array(table["flags"].to_pylist()) == expected["flags"]).all()
    position = table.schema.field("position_m").metadata
    assert (b"m", b"world") == (position[b"unit"], position[b"frame"])
    assert table.schema.metadata[b"is_simulated"] == b"true"


def test_files_depend_on_samples_and_not_on_how_they_were_delivered(tmp_path: Path) -> None:
    def file_of(steps: list[int]) -> bytes:
        name = "-".join(map(str, steps))
        recorder = recorder_in(tmp_path / name)
        first = 0
        while first < 450:
            n = min(steps[first % len(steps)], 450 - first)
            recorder.append(probe_batch(first, n))
            first += n
        recorder.close("complete")
        return (tmp_path / name / "probe.arrows").read_bytes()

    one_by_one = file_of([1])

    assert [one_by_one] * 3 == [file_of(steps) for steps in ([7], [3, 40, 1], [400])]


def test_trial_returns_after_its_samples_and_row_are_in_the_files(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    recorder.append(probe_batch(0, 5))
    recorder.trial({"trial_id": "T01"})
    lines = (tmp_path / "part-01" / "events.jsonl").read_bytes().splitlines()
    assert decode_line(lines[-1])["row"] == {"trial_id": "T01"}
    with pa.OSFile(str(tmp_path / "part-01" / "probe.arrows")) as source:
        reader = pa.ipc.open_stream(source)
        assert reader.read_next_batch()["seq"].to_pylist() == [0, 1, 2, 3, 4]
    recorder.close("aborted")


def test_threaded_files_hold_the_same_samples_as_inline_ones(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01", threaded=True, max_batch_ns=NS_PER_S // 100)
    for first in range(0, 900, 3):
        recorder.append(probe_batch(first, 3))
        if first % 300 == 0:
            recorder.checkpoint(10.0)
    recorder.trial({"trial_id": "T01"})
    assert recorder.stats()["probe"].rows == 900
    assert recorder.close("complete").streams[0].rows == 900
    with pa.OSFile(str(tmp_path / "part-01" / "probe.arrows")) as source:
        assert pa.ipc.open_stream(source).read_all()["seq"].to_pylist() == list(range(900))


def test_writer_rests_while_nothing_happens_and_is_woken_by_a_line_and_by_a_stream(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rests = threading.Semaphore(0)

    class SeenCondition(threading.Condition):
        def wait(self, timeout: float | None = None) -> bool:
            if timeout is None:
                rests.release()
            return super().wait(timeout)

    monkeypatch.setattr(writer, "_SYNC_EVERY_NS", 0)
    own = {"Lock": threading.Lock, "Thread": threading.Thread, "Condition": SeenCondition}
    monkeypatch.setattr(writer, "threading", SimpleNamespace(**own))
    recorder = Recorder(
        tmp_path, SystemClock(), threaded=True, max_batch_ns=NS_PER_S // 1000, is_simulated=True
    )
    assert rests.acquire(timeout=10)
    for name in ("first", "second"):
        recorder.event(name, 1)
        assert rests.acquire(timeout=10), "it rests again once the line is on the disk"
        lines = (tmp_path / JOURNAL_NAME).read_bytes().splitlines()
        assert (decode_line(lines[-1]) or {})["name"] == name
    recorder.declare(PROBE)
    recorder.append(probe_batch(0, 3))
    recorder.trial({"trial_id": "T1"})
    summary = recorder.close("complete")
    assert [stream.rows for stream in summary.streams] == [3]
    assert not rests.acquire(blocking=False), "a stream has to be written when its time has come"


def test_where_a_stream_is_declared_no_event_precedes_samples_that_came_before_it(
    tmp_path: Path,
) -> None:
    recorder = recorder_in(tmp_path / "part-01", threaded=True, max_batch_ns=60 * NS_PER_S)
    recorder.append(probe_batch(0, 5))
    recorder.event("batch_of_probe", 1)
    recorder.declare(replace(PROBE, name="other"))
    lines = (tmp_path / "part-01" / JOURNAL_NAME).read_bytes().splitlines()
    assert "batch_of_probe" in [(decode_line(line) or {}).get("name") for line in lines]
    with pa.OSFile(str(tmp_path / "part-01" / "probe.arrows")) as source:
        batches = [batch["seq"].to_pylist() for batch in pa.ipc.open_stream(source)]
    recorder.close("aborted")
    assert [[0, 1, 2, 3, 4]] == batches


def test_a_queue_that_overflows_raises_and_counts(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01", threaded=True, max_batch_ns=3600 * NS_PER_S)
    most = 16 * 2048
    for first in range(0, most, 256):
        recorder.append(probe_batch(first, 256))
    with pytest.raises(RecordingError, match=r"'probe'.*behind by 32768.*16 were dropped"):
        recorder.append(probe_batch(most, 16))
    recorder.checkpoint(10.0)
    recorder.append(probe_batch(most + 16, 16))
    summary = recorder.close("complete").streams[0]
    assert (most + 16, 16) == (summary.rows, summary.dropped)


def test_what_comes_at_once_after_a_pause_of_the_computer_is_all_recorded(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01", threaded=True, max_batch_ns=3600 * NS_PER_S)
    for first in (0, 3, 1500):
        recorder.append(probe_batch(first, 3))
    for first in range(3000, 9000, 1000):
        recorder.append(probe_batch(first, 1000))
    recorder.close("complete")
    wanted = [*range(6), *range(1500, 1503), *range(3000, 9000)]
    with pa.OSFile(str(tmp_path / "part-01" / "probe.arrows")) as source:
        assert wanted == pa.ipc.open_stream(source).read_all()["seq"].to_pylist()


def test_driver_may_reuse_its_arrays_after_append(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    batch = probe_batch(0, 2)
    recorder.append(batch)
    batch.seq[:] = 99
    batch.values["code"] = 99
    recorder.close("complete")
    with pa.OSFile(str(tmp_path / "part-01" / "probe.arrows")) as source:
        table = pa.ipc.open_stream(source).read_all()
    assert [0, 1] == table["seq"].to_pylist() == table["code"].to_pylist()


def test_columns_of_no_values_are_recorded_and_read_as_such(tmp_path: Path) -> None:
    nobody = StreamSchema(
        "scene_states",
        (
            Field("gaze_direction", "f4", "1", "world", (0, 3), "of each agent, of whom none is"),
            Field("scene", "i4", ""),
            Field("seen", "?", "", shape=(0,)),
        ),
        0.0,
    )
    clock = SimClock()
    folder = create_session(tmp_path, probe_manifest())
    recorder = new_recorder(folder, clock)
    recorder.declare(nobody)
    for first in (0, 2, 5):
        seq = np.arange(first, first + 2, dtype=np.int64)
        values = empty_values(nobody, 2)
        values["scene"] = seq
        recorder.append(SampleBatch(nobody, seq, seq, seq, values))
    folder.end_part(clock, recorder.close("complete"))
    folder.close()

    recording = Recording(folder.path)

    assert recording.verify().is_intact
    assert recording.stream_schema("scene_states") == nobody
    read = recording.stream_arrays("scene_states")
    assert ((6, 0, 3), (6, 0)) == (read["gaze_direction"].shape, read["seen"].shape)
    assert [0, 1, 2, 3, 5, 6] == read["scene"].tolist()
    own = ["seq", "t_device_ns", "t_host_ns", "scene", "recording_part"]
    assert own == list(recording.stream("scene_states"))
    with pa.OSFile(str(folder.path / "part-01" / "scene_states.arrows")) as source:
        table = pa.ipc.open_stream(source).read_all()
    table.validate(full=True)
    assert [[]] * 6 == table["gaze_direction"].to_pylist()


def test_undeclared_and_changed_streams_are_refused_by_name(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    other = StreamSchema("other", (Field("code", "u2", ""),), 1.0)
    changed = StreamSchema("probe", (Field("code", "u2", ""),), 1.0)
    stamp = np.zeros(1, np.int64)
    for schema, text in ((other, "'other' was not declared"), (changed, "other fields")):
        with pytest.raises(RecordingError, match=text):
            recorder.append(SampleBatch(schema, stamp, stamp, stamp, empty_values(schema, 1)))
    with pytest.raises(RecordingError, match="declared already"):
        recorder.declare(PROBE)
    recorder.close("complete")
    with pytest.raises(RecordingError, match="closed"):
        recorder.append(probe_batch(0, 1))


def test_stream_names_that_are_paths_are_refused(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    with pytest.raises(RecordingError, match="cannot name a file"):
        recorder.declare(StreamSchema("../gaze", (Field("code", "u2", ""),), 1.0))
    recorder.close("complete")


def test_a_batch_larger_than_the_buffer_is_kept_whole(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    recorder.append(probe_batch(0, 3))
    recorder.append(probe_batch(3, 5000))
    assert recorder.close("complete").streams[0].rows == 5003


def test_existing_files_are_never_overwritten(tmp_path: Path) -> None:
    recorder_in(tmp_path / "part-01").close("complete")
    with pytest.raises(RecordingError, match="never overwritten"):
        recorder_in(tmp_path / "part-01")


def test_sha256_of_summary_is_that_of_the_file(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    recorder.append(probe_batch(0, 400))
    summary = recorder.close("complete")
    for file, digest in ((s.file, s.sha256) for s in (*summary.streams, summary.journal)):
        data = (tmp_path / "part-01" / file).read_bytes()
        assert hashlib.sha256(data).hexdigest() == digest


def test_virtual_clock_with_a_thread_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="virtual clock"):
        Recorder(tmp_path, SimClock(), threaded=True, max_batch_ns=1, is_simulated=True)


def test_two_runs_give_identical_bytes(tmp_path: Path) -> None:
    first, second = (record_session(tmp_path / name) for name in ("a", "b"))
    files = sorted(p.relative_to(first) for p in first.rglob("*") if p.is_file())
    assert len(files) == 4
    for file in files:
        assert (first / file).read_bytes() == (second / file).read_bytes()


@pytest.mark.parametrize("threaded", [False, True])
def test_full_disk_is_told_once_and_keeps_what_was_acknowledged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, threaded: bool
) -> None:
    recorder = recorder_in(tmp_path / "part-01", threaded=threaded)
    recorder.append(probe_batch(0, 50))
    recorder.trial({"trial_id": "T01"})
    whole_write = os.write

    def half_write(fd: int, data: memoryview) -> int:
        if len(data) > 100:
            return whole_write(fd, data[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(durable.os, "write", half_write)
    recorder.append(probe_batch(50, 50))
    with pytest.raises(RecordingError, match=r"probe\.arrows.*No space.*free some space"):
        recorder.trial({"trial_id": "T02"})
    with pytest.raises(RecordingError, match="free some space"):
        recorder.append(probe_batch(100, 50))
    monkeypatch.undo()
    summary = recorder.close("complete")
    assert ("aborted", False) == (summary.status, summary.streams[0].closed_cleanly)
    assert "free some space" in summary.failure
    lines = (tmp_path / "part-01" / "events.jsonl").read_bytes().splitlines()
    assert [{"trial_id": "T01"}] == [
        e["row"] for e in map(decode_line, lines) if e and e["kind"] == "trial"
    ]


def test_failure_found_only_while_closing_is_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    recorder.append(probe_batch(0, 5))

    def no_write(fd: int, data: memoryview) -> int:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(durable.os, "write", no_write)
    with pytest.raises(RecordingError, match="record on another disk"):
        recorder.close("complete")


def test_file_deleted_while_recording_is_noticed_at_the_next_trial(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    recorder.append(probe_batch(0, 5))
    (tmp_path / "part-01" / "probe.arrows").unlink()
    with pytest.raises(RecordingError, match=r"probe\.arrows: it was deleted.*folder is gone"):
        recorder.trial({"trial_id": "T01"})
    recorder.close("aborted")


@pytest.mark.parametrize(("awaits_disk", "of_a_trial"), [(True, 2), (False, 0)])
def test_a_session_that_can_be_made_again_waits_for_the_disk_at_its_end_only(
    awaits_disk: bool, of_a_trial: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    recorder = recorder_in(tmp_path / "part-01", awaits_disk=awaits_disk)
    monkeypatch.setattr(durable, "_sync_data", synced.append)
    recorder.append(probe_batch(0, 5))
    recorder.trial({"trial_id": "T01"})
    assert of_a_trial == len(synced)
    lines = (tmp_path / "part-01" / "events.jsonl").read_bytes().splitlines()
    assert ["T01"] == [e["row"]["trial_id"] for e in map(decode_line, lines) if e and "row" in e]
    recorder.close("complete")
    assert 2 <= len(synced) - of_a_trial


def test_missing_and_nan_become_null_and_other_objects_are_refused(tmp_path: Path) -> None:
    recorder = recorder_in(tmp_path / "part-01")
    recorder.trial({"a": float("nan"), "b": np.float32("nan"), "c": None, "d": np.int16(3)})
    with pytest.raises(RecordingError, match="object cannot be written"):
        recorder.event("odd", 0, what=object())
    recorder.close("complete")
    lines = (tmp_path / "part-01" / "events.jsonl").read_bytes().splitlines()
    assert decode_line(lines[2])["row"] == {"a": None, "b": None, "c": None, "d": 3}
    assert all(json.loads(line) for line in lines)


LIMITED = """
import resource, signal, sys
from pathlib import Path
from visavis.lab.clock import SimClock
from visavis.lab.errors import RecordingError
from visavis.recording.columns import BatchEncoder
from visavis.recording.folder import create_session
from tests.recording.sessions import new_recorder, probe_manifest, record_trials
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
clock = SimClock()
with create_session(Path(sys.argv[1]), probe_manifest()) as folder:
    recorder = new_recorder(folder, clock)
    try:
        record_trials(recorder, clock, range(100))
    except RecordingError as error:
        sys.stdout.write(str(error))
        folder.end_part(clock, recorder.close("aborted"))
"""


def test_real_limit_of_the_disk_leaves_every_acknowledged_trial(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert "probe.arrows" in done.stdout
    recording = Recording(tmp_path / "simulated" / "probe" / "sub-P01" / "ses-001")
    assert recording.status == "crashed"
    n_trials = len(recording.trials())
    assert 0 < n_trials < 100
    assert len(recording.stream_arrays("probe")["seq"]) >= 150 * n_trials
    assert "raise the limit" in recording.manifest.parts[0].reason


LOCALE = """
import locale, sys
from pathlib import Path
for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE.utf8"):
    try:
        locale.setlocale(locale.LC_ALL, name)
        break
    except locale.Error:
        continue
else:
    locale.localeconv = lambda: {"decimal_point": ",", "thousands_sep": "."}
from visavis.recording.export import export_session
from tests.recording.sessions import record_session
path = record_session(Path(sys.argv[1]))
export_session(path, "parquet", Path(sys.argv[1]) / "out")
"""


def test_decimal_comma_locale_changes_no_byte(tmp_path: Path) -> None:
    here = tmp_path / "ici, là"
    subprocess.run([sys.executable, "-c", LOCALE, str(here)], check=True)
    plain = record_session(tmp_path / "plain")
    other = here / plain.relative_to(tmp_path / "plain")
    for file in (p.relative_to(plain) for p in plain.rglob("*") if p.is_file()):
        assert (plain / file).read_bytes() == (other / file).read_bytes()
    assert b"T01,1.5," in (here / "out" / "trials.csv").read_bytes()


def test_part_numbers_of_rows_tell_the_resumption(tmp_path: Path) -> None:
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        for trials in (range(1), range(1, 3)):
            recorder = new_recorder(folder, clock)
            record_trials(recorder, clock, trials)
            folder.end_part(clock, recorder.close("aborted"), reason="participant rested")
        path = folder.path
    recording = Recording(path)
    assert [1, 2, 2] == recording.trials()["recording_part"].tolist()
    assert list(range(450)) == recording.stream_arrays("probe")["seq"].tolist()
    assert "participant rested" == recording.manifest.parts[0].reason


def test_the_layouts_an_encoder_keeps_do_not_grow_with_the_session() -> None:
    encoder = BatchEncoder(PROBE, is_simulated=True)
    rows = probe_batch(0, 400)
    stamps = np.stack([rows.seq, rows.t_device_ns, rows.t_host_ns])

    def held_bytes(lengths: range) -> int:
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for n in lengths:
            encoder.encode(stamps[:, :n], rows.values[:n], 0)
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - before

    tracemalloc.start()
    try:
        held_bytes(range(200, 300))
        assert 0 == pytest.approx(held_bytes(range(300, 320)), abs=100_000)
    finally:
        tracemalloc.stop()


def test_an_encoder_keeps_the_layouts_used_last() -> None:
    encoder = BatchEncoder(PROBE, is_simulated=True)
    rows = probe_batch(0, 700)
    stamps = np.stack([rows.seq, rows.t_device_ns, rows.t_host_ns])
    usual = encoder.encode(stamps[:, :10], rows.values[:10], 0)
    for n in range(100, 700):
        encoder.encode(stamps[:, :n], rows.values[:n], 0)
        assert encoder.encode(stamps[:, :10], rows.values[:10], 0) is usual
