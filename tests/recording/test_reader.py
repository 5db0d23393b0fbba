import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.recording.sessions import (
    PROBE,
    new_recorder,
    probe_batch,
    probe_manifest,
    record_session,
    record_trials,
)
from visavis.lab.clock import NS_PER_MS, SimClock
from visavis.lab.errors import RecordingError, UsageError
from visavis.lab.schema import Field, StreamSchema
from visavis.recording import stream_file
from visavis.recording.columns import arrow_schema, stream_schema
from visavis.recording.folder import create_session
from visavis.recording.journal import decode_line, encode_line
from visavis.recording.journal_file import read_journal
from visavis.recording.manifest import read_manifest, write_manifest
from visavis.recording.reader import Recording, component_names, require_one_kind
from visavis.recording.stream_file import read_stream_file

STORED = Path(__file__).parent / "data" / "format_1/simulated/probe/sub-P01/ses-001"
STORED_2 = Path(__file__).parent / "data" / "format_2/simulated/probe/sub-P01/ses-001"
STORED_TODAY = Path(__file__).parent / "data" / "today/simulated/probe/sub-P01/ses-001"
"""As format 2, but where batches of a stream end depends on the samples alone."""
"""Its manifest has a checksum and a copy; streams and journal are as in format 1."""


def batch_ends(path: Path) -> list[int]:
    """Return the file offsets behind the header and behind every batch, asked of pyarrow."""
    with pa.OSFile(str(path)) as source:
        pa.ipc.read_schema(source)
        ends = [source.tell()]
        while True:
            try:
                pa.ipc.read_message(source)
            except EOFError:
                return ends
            ends.append(source.tell())


def rows_read(path: Path) -> list[int]:
    content = read_stream_file(path)
    return content.columns["seq"].tolist() if content.schema else []


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a part with five batches of 1, 2, 3, 4 and 5 rows."""
    clock = SimClock()
    with create_session(tmp_path_factory.mktemp("small"), probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        first = 0
        for n in (1, 2, 3, 4, 5):
            recorder.append(probe_batch(first, n))
            recorder.trial({"trial_id": f"T{n}"})
            first += n
        folder.end_part(clock, recorder.close("complete"))
        return folder.path / "part-01"


def test_samples_come_back_bit_for_bit(tmp_path: Path) -> None:
    recording = Recording(record_session(tmp_path))
    expected = probe_batch(0, 450)
    arrays = recording.stream_arrays("probe")
    assert expected.seq.tobytes() == arrays["seq"].tobytes()
    assert expected.t_device_ns.tobytes() == arrays["t_device_ns"].tobytes()
    for field in PROBE.fields:
        assert np.dtype(field.dtype) == arrays[field.name].dtype
        assert expected.values[field.name].tobytes() == arrays[field.name].tobytes()
    assert recording.stream_schema("probe") == PROBE
    assert recording.status == "complete"
    assert recording.verify().is_intact


def test_time_slice_takes_start_and_leaves_end(tmp_path: Path) -> None:
    recording = Recording(record_session(tmp_path))
    arrays = recording.stream_arrays(
        "probe", part=1, t_start_ns=100 * NS_PER_MS, t_end_ns=130 * NS_PER_MS
    )
    assert [10, 11, 12] == arrays["seq"].tolist()


def test_table_names_components_before_the_unit(tmp_path: Path) -> None:
    frame = Recording(record_session(tmp_path)).stream("probe")
    assert [
        "seq",
        "t_device_ns",
        "t_host_ns",
        "position_x_m",
        "position_y_m",
        "position_z_m",
        "orientation_w",
        "orientation_x",
        "orientation_y",
        "orientation_z",
        "valid",
        "flags_x",
        "flags_y",
        "flags_z",
        "angle_deg",
        "code",
        "recording_part",
    ] == list(frame.columns)
    assert ["angle_0_deg", "angle_1_deg"] == component_names("angle_deg", 2)


def test_events_and_trials_keep_order_and_missing_values(tmp_path: Path) -> None:
    recording = Recording(record_session(tmp_path))
    assert ["T00", "T01", "T02"] == recording.trials()["trial_id"].tolist()
    assert recording.trials()["first_ms"].isna().all()
    events = recording.events()
    assert {"trial_id": "T01", "note": "é"} == events["payload"][1]
    assert 3 * 10**9 == events["t_ns"][1]


def test_cut_anywhere_gives_every_whole_batch_and_never_raises(small: Path, tmp_path: Path) -> None:
    data = (small / "probe.arrows").read_bytes()
    header = read_journal(small / "events.jsonl").headers["probe"]
    ends = batch_ends(small / "probe.arrows")
    assert len(header) == ends[0]
    rows_at = np.cumsum([0, 1, 2, 3, 4, 5])
    path = tmp_path / "probe.arrows"
    for cut in range(len(data) + 1):
        path.write_bytes(data[:cut])
        whole = int(rows_at[sum(end <= cut for end in ends[1:])])
        content = read_stream_file(path, header)
        assert list(range(whole)) == content.columns["seq"].tolist()
        assert (cut == len(data)) == content.is_ended
        if cut % 5 == 0:
            assert list(range(whole)) == rows_read(path)


@pytest.mark.parametrize("zeros", [1, 7, 8, 64, 4096])
def test_zero_filled_tail_invents_nothing(small: Path, tmp_path: Path, zeros: int) -> None:
    data = (small / "probe.arrows").read_bytes()
    ends = batch_ends(small / "probe.arrows")
    path = tmp_path / "probe.arrows"
    for cut, rows in ((ends[3], 6), (ends[3] + 100, 6), (ends[5], 15)):
        path.write_bytes(data[:cut] + bytes(zeros))
        content = read_stream_file(path)
        assert list(range(rows)) == content.columns["seq"].tolist()
        assert not content.is_ended
        assert content.problems


def test_flipped_byte_costs_its_own_batch_at_most(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = (small / "probe.arrows").read_bytes()
    header = read_journal(small / "events.jsonl").headers["probe"]
    ends = batch_ends(small / "probe.arrows")
    rows_at = np.cumsum([0, 1, 2, 3, 4, 5])
    whole = read_stream_file(small / "probe.arrows").columns
    lost_batches = 0
    for at in range(0, ends[5]):
        for flip in (0x01, 0x80):
            flipped = data[:at] + bytes([data[at] ^ flip]) + data[at + 1 :]
            # Thousands of files would be written otherwise; how one is opened is tested elsewhere.
            monkeypatch.setattr(stream_file, "_bytes_of", lambda _, flipped=flipped: flipped)
            content = read_stream_file(Path("probe.arrows"), header)
            struck = next(i for i, end in enumerate(ends) if at < end)
            spared = set(range(15))
            if struck > 0:
                spared -= set(range(rows_at[struck - 1], rows_at[struck]))
            got = content.columns["seq"].tolist()
            assert got == sorted(got)
            assert spared <= set(got) <= set(range(15))
            for name, column in content.columns.items():
                assert column.tobytes() == whole[name][got].tobytes()
            if len(got) < 15:
                lost_batches += 1
                assert content.problems
    assert lost_batches > 1000


def test_damaged_batch_is_named_with_its_rows(small: Path, tmp_path: Path) -> None:
    session = tmp_path / "ses-001"
    shutil.copytree(small.parent, session)
    path = session / "part-01" / "probe.arrows"
    data = bytearray(path.read_bytes())
    ends = batch_ends(path)
    data[ends[3] - 9] ^= 0xFF
    path.chmod(0o644)
    path.write_bytes(data)
    recording = Recording(session)
    problems = "\n".join(recording.verify().problems)
    assert f"bytes {ends[2]} to {ends[3]} are damaged (the checksum disagrees)" in problems
    assert "rows 3 to 5 are lost" in problems
    assert "SHA-256 differs" in problems
    assert recording.status == "crashed"
    assert [0, 1, 2, *range(6, 15)] == recording.stream_arrays("probe")["seq"].tolist()


@pytest.mark.parametrize("file", ["probe.arrows", "events.jsonl"])
def test_file_cut_on_a_boundary_is_not_complete(small: Path, tmp_path: Path, file: str) -> None:
    session = tmp_path / "ses-001"
    shutil.copytree(small.parent, session)
    path = session / "part-01" / file
    data = path.read_bytes()
    cut = data[:-8] if file == "probe.arrows" else b"".join(data.splitlines(True)[:-1])
    path.chmod(0o644)
    path.write_bytes(cut)
    recording = Recording(session)
    assert recording.status == "crashed"
    assert 15 == len(recording.stream_arrays("probe")["seq"])
    assert 5 == len(recording.trials())


def test_batch_taken_out_of_the_middle_is_noticed(small: Path, tmp_path: Path) -> None:
    data = (small / "probe.arrows").read_bytes()
    ends = batch_ends(small / "probe.arrows")
    path = tmp_path / "probe.arrows"
    path.write_bytes(data[: ends[2]] + data[ends[3] :])
    content = read_stream_file(path)
    assert content.is_ended
    assert "begins with row 6, row 3 was due" in content.problems[0]


def test_journal_cut_anywhere_gives_every_whole_line(small: Path, tmp_path: Path) -> None:
    data = (small / "events.jsonl").read_bytes()
    path = tmp_path / "events.jsonl"
    trials = [e for e in map(decode_line, data.splitlines()) if e and e["kind"] == "trial"]
    for cut in range(len(data)):
        path.write_bytes(data[:cut])
        whole = [t for t in trials if data.index(encode_line(t)) + len(encode_line(t)) - 1 <= cut]
        content = read_journal(path)
        assert whole == list(content.trials)
        path.write_bytes(data[:cut] + bytes(100))
        assert len(whole) - 1 <= len(read_journal(path).trials) <= len(whole)


def test_changed_digit_of_a_trial_row_is_noticed(small: Path, tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_bytes((small / "events.jsonl").read_bytes().replace(b'"T3"', b'"T8"'))
    content = read_journal(path)
    assert ["T1", "T2", "T4", "T5"] == [t["row"]["trial_id"] for t in content.trials]
    assert "is damaged" in content.problems[0]


@given(
    st.dictionaries(
        st.text(max_size=5),
        st.none()
        | st.booleans()
        | st.integers()
        | st.text(max_size=20)
        | st.floats(allow_nan=False, allow_infinity=False),
        max_size=4,
    )
)
@settings(max_examples=100)
def test_journal_lines_come_back_as_written(row: dict[str, object]) -> None:
    line = encode_line({"kind": "trial", "row": row})
    assert line.count(b"\n") == 1
    assert {"kind": "trial", "row": row} == decode_line(line[:-1])


@pytest.mark.parametrize("stored", [STORED, STORED_2, STORED_TODAY])
def test_stored_files_of_every_version_still_read(stored: Path) -> None:
    recording = Recording(stored)
    assert recording.status == "complete"
    assert recording.verify().is_intact
    assert list(range(300)) == recording.stream_arrays("probe")["seq"].tolist()
    assert ["T00", "T01"] == recording.trials()["trial_id"].tolist()
    assert "ségur" == recording.manifest.configuration["rooms"]["name"]


def test_stored_files_are_what_we_write_today(tmp_path: Path) -> None:
    fresh = record_session(tmp_path, 2)
    names = [file.relative_to(fresh) for file in fresh.rglob("*") if file.is_file()]
    assert {Path("part-01/probe.arrows"), Path("part-01/events.jsonl")} < set(names)
    for name in names:
        assert (STORED_TODAY / name).read_bytes() == (fresh / name).read_bytes(), name


def test_newer_format_is_refused_with_the_way_out(tmp_path: Path) -> None:
    session = record_session(tmp_path)
    path = session / "manifest.json"
    raw = json.loads(path.read_bytes())
    path.write_text(json.dumps({**raw, "format_version": 3}), "utf-8")
    with pytest.raises(RecordingError, match=r"format version 3.*install a newer Visavis"):
        Recording(session)
    schema = arrow_schema(PROBE, is_simulated=True)
    newer = schema.with_metadata({**schema.metadata, b"visavis_format": b"2"})
    stream = tmp_path / "probe.arrows"
    stream.write_bytes(newer.serialize().to_pybytes())
    with pytest.raises(RecordingError, match="install a newer Visavis"):
        read_stream_file(stream)
    journal = tmp_path / "events.jsonl"
    journal.write_bytes(encode_line({"kind": "header", "format": 2, "is_simulated": True}))
    with pytest.raises(RecordingError, match="install a newer Visavis"):
        read_journal(journal)


def test_stream_version_travels_with_the_file(tmp_path: Path) -> None:
    second = replace(PROBE, version=2)
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        recorder.close("aborted")
        path = folder.path / "part-01" / "other.arrows"
        path.write_bytes(arrow_schema(second, is_simulated=True).serialize().to_pybytes())
    assert second == read_stream_file(path).schema


def test_simulated_and_real_have_roots_apart_and_never_mix(tmp_path: Path) -> None:
    simulated = record_session(tmp_path, is_simulated=True)
    real = record_session(tmp_path, is_simulated=False)
    assert ("simulated", "real") == tuple(
        p.relative_to(tmp_path).parts[0] for p in (simulated, real)
    )
    both = [Recording(simulated), Recording(real)]
    with pytest.raises(RecordingError, match="analyse them separately"):
        require_one_kind(both)
    require_one_kind(both, allow_mixture=True)
    shutil.copy(simulated / "part-01" / "probe.arrows", real / "part-01" / "strange.arrows")
    assert "mixes simulated and real" in "\n".join(Recording(real).verify().problems)


def test_damaged_manifest_and_wrong_folder_say_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="not a session"):
        Recording(tmp_path)
    session = record_session(tmp_path)
    (session / "manifest.json").write_bytes(b'{"format_version": 1')
    with pytest.raises(RecordingError, match=r"manifest\.json cannot be read"):
        Recording(session)
    (session / "manifest.json").write_bytes(b'{"format_version": 1}')
    with pytest.raises(RecordingError, match="lacks or misstates"):
        Recording(session)


def test_unknown_stream_names_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no stream 'gaze'; it has probe"):
        Recording(record_session(tmp_path)).stream("gaze")


def test_manifest_comes_back_as_written(tmp_path: Path) -> None:
    session = record_session(tmp_path)
    manifest = read_manifest(session)
    write_manifest(session, manifest)
    assert manifest == read_manifest(session)
    assert ["a", "b"] == manifest.devices[0]["capabilities"]
    assert 64 == len(manifest.configuration_sha256)


def test_running_session_reads_so_far_and_is_running_while_held(tmp_path: Path) -> None:
    clock = SimClock()
    folder = create_session(tmp_path, probe_manifest())
    recorder = new_recorder(folder, clock)
    record_trials(recorder, clock, range(1))
    assert "running" == Recording(folder.path).status
    assert 150 == len(Recording(folder.path).stream("probe"))
    folder.close()
    assert "crashed" == Recording(folder.path).status
    recorder.close("aborted")


@pytest.mark.parametrize(
    ("written", "code"), [("microvolts", "uV"), ("milliseconds", ""), ("furlongs", "")]
)
def test_units_recorded_before_they_were_those_of_ucum_are_read(written, code):
    schema = StreamSchema("eeg", (Field("fz", "f8", "uV", description="Fz"),), 250.0)
    arrow = arrow_schema(schema, is_simulated=True)
    notes = {**arrow.field("fz").metadata, b"unit": written.encode()}
    arrow = arrow.set(arrow.get_field_index("fz"), arrow.field("fz").with_metadata(notes))

    read = stream_schema(arrow).fields[0]

    assert read.unit == code
    assert read.description == f"Fz in {written}"
