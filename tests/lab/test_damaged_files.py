"""What a fuzzer found: readers refuse these in words, none lets a traceback through."""

import gzip
import json
import zipfile
from contextlib import suppress
from pathlib import Path

import msgpack
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from visavis.analysis.foreign_check import check_foreign
from visavis.analysis.gaze.bids import read_bids
from visavis.analysis.gaze.text_table import read_text_table
from visavis.analysis.statistics_report.table_file import read_table
from visavis.devices.wirelog import FORMAT, VERSION, read_wire_log
from visavis.lab.errors import DataError
from visavis.lab.plain_files import read_arrays, read_packed
from visavis.recording.chained import append_lines
from visavis.results.picture_delay import read_sync_test
from visavis.running.page.other_hosts.results import read_runs
from visavis.running.sessions.plan_lock import PEEKS_NAME, read_peeks
from visavis.stimuli.characters.cast import DATA
from visavis.stimuli.characters.errors import CharacterError
from visavis.stimuli.characters.storage import read_character
from visavis.stimuli.motion.clip_file import read_clip
from visavis.stimuli.motion.errors import MotionError

SIDECAR = """{"PhysioType": "eyetrack", "Columns": ["timestamp"], "timestamp": {"Units": "s"},
"SamplingFrequency": 100, "RecordedEye": "left", "SampleCoordinateSystem": "eye-in-head"}"""


def packed_with_a_damaged_block(path: Path) -> None:
    data = bytearray(gzip.compress(b"0.01\n" * 500, mtime=0))
    data[12] ^= 0xFF
    path.write_bytes(data)


def test_a_gzip_file_with_a_damaged_block_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sub-1_recording-eye1_physio.tsv.gz"
    packed_with_a_damaged_block(path)
    (tmp_path / "sub-1_recording-eye1_physio.json").write_text(SIDECAR, "utf-8")
    (tmp_path / "dataset_description.json").write_text("{}", "utf-8")
    with pytest.raises(OSError):
        read_packed(path)
    with pytest.raises(DataError, match="copy it again"):
        read_bids(path)
    with pytest.raises(DataError, match="cannot be read"):
        check_foreign(tmp_path)


def test_a_gzip_file_that_unpacks_without_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.gz"
    path.write_bytes(gzip.compress(bytes(10_000)))
    assert bytes(10_000) == read_packed(path, max_bytes=10_000)
    with pytest.raises(OSError, match="more than 9999"):
        read_packed(path, max_bytes=9_999)


@pytest.mark.parametrize("at", range(0, 200, 3))
def test_an_npz_file_with_a_damaged_byte_is_read_or_refused(at: int, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez_compressed(path, format=np.array(1), names=np.array(["hips", "head"]))
    data = bytearray(path.read_bytes())
    data[-at - 1] ^= 0xFF
    data[at] ^= 0xFF
    path.write_bytes(data)
    with suppress(ValueError, OSError):
        read_arrays(path)
    with pytest.raises(MotionError):
        read_clip(path)
    with pytest.raises(CharacterError):
        read_character(path)


def test_an_npz_file_of_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("format.npy", b"x" * 40)
    data = path.read_bytes()
    header = data.index(b"PK\x01\x02")
    path.write_bytes(data[: header + 10] + b"\x63\x00" + data[header + 12 :])
    with pytest.raises(ValueError, match="npz"):
        read_arrays(path)
    with pytest.raises(MotionError, match="cannot be read as a clip"):
        read_clip(path)


@pytest.mark.parametrize("record", [b"\xc1", b"\xa2\xff\xfe", b"\xd7\xff" + b"\xff" * 8])
def test_a_wire_log_with_a_record_that_is_no_msgpack_is_refused(
    record: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "a.wire"
    head = msgpack.packb({"format": FORMAT, "version": VERSION})
    path.write_bytes(head + record + msgpack.packb([2, 0, [b"x"]]))
    with pytest.raises(DataError, match="record"):
        read_wire_log(path)


def test_a_wire_log_whose_note_is_no_map_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.wire"
    path.write_bytes(msgpack.packb({"format": FORMAT, "version": VERSION, "note": ["role"]}))
    with pytest.raises(DataError, match="note"):
        read_wire_log(path)


@pytest.mark.parametrize("cell", ["9" * 5000, "1e999999999", "-1e40", "nan", "inf"])
def test_a_time_of_too_many_digits_is_refused(cell: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"t,x\n0,1\n{cell},1\n", "utf-8")
    with pytest.raises(DataError, match="line 3, column 't'"):
        read_text_table(path, delimiter=",").stamps("t", "s", from_first=True)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("sub-1_tracksys-a_channels.tsv", "name\ttype\nx\tPOS\ny\tPOS\nlatency\tLATENCY\n"),
        ("sub-1_tracksys-a_motion.json", '{"SamplingFrequency": [10]}'),
        ("sub-1_tracksys-a_motion.json", "[1]"),
        ("sub-1_recording-eye1_physio.json", '{"Columns": 1}'),
    ],
)
def test_a_data_set_whose_files_disagree_is_refused(name: str, text: str, tmp_path: Path) -> None:
    said = {
        "dataset_description.json": "{}",
        "sub-1_tracksys-a_motion.tsv": "0.0\t1\n0.1\t2\n",
        "sub-1_tracksys-a_motion.json": '{"SamplingFrequency": 10}',
        "sub-1_tracksys-a_channels.tsv": "name\ttype\nlatency\tLATENCY\nx\tPOS\n",
        "sub-1_recording-eye1_physio.json": '{"Columns": ["timestamp"]}',
    }
    for file, content in {**said, name: text}.items():
        (tmp_path / file).write_text(content, "utf-8")
    gaze = tmp_path / "sub-1_recording-eye1_physio.tsv.gz"
    gaze.write_bytes(gzip.compress(b"0.0\n0.1\n"))
    with pytest.raises(DataError, match="cannot be read with"):
        check_foreign(tmp_path)


@pytest.mark.parametrize("line", [{"at": "x"}, {"at": "x", "sessions": "many", "reason": ""}])
def test_a_look_at_results_that_no_analysis_wrote_is_refused(
    line: dict[str, str], tmp_path: Path
) -> None:
    append_lines(tmp_path / PEEKS_NAME, [line])
    with pytest.raises(DataError, match="restore it from a copy"):
        read_peeks(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        '{"made": "2026", "is_simulated": false, "offsets_ms": null}',
        '{"made": "2026", "is_simulated": false, "offsets_ms": {"picture_delay_ms": "late"}}',
        "[" * 100_000,
    ],
)
def test_what_is_no_synchronisation_test_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "sync.json"
    path.write_text(text, "utf-8")
    with pytest.raises(DataError, match="no test that visavis sync-test saved"):
        read_sync_test(path)


@pytest.mark.parametrize("at", [60, 80])
def test_a_damaged_archive_of_results_is_refused(at: int, tmp_path: Path) -> None:
    path = tmp_path / "results.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("comp-result_1/data.txt", '{"run": "a", "line": 0, "arrived": {}}\n')
    data = bytearray(path.read_bytes())
    assert 1 == len(read_runs([path])[0])
    data[at] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(DataError):
        read_runs([path])


def test_results_nested_without_end_are_counted_as_unreadable(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    path.write_text('{"run": "a", "line": 0, "arrived": {}}\n' + "[" * 100_000 + "\n", "utf-8")
    runs, unreadable = read_runs([path])
    assert (1, 1) == (len(runs), unreadable)


def test_a_parquet_file_whose_notes_are_damaged_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trials.parquet"
    pq.write_table(pa.table({"x": [1]}).replace_schema_metadata({"pandas": "{}"}), path)
    with pytest.raises(DataError, match="cannot be read as Parquet"):
        read_table(path)


def test_a_character_whose_materials_are_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "person.npz"
    with np.load(DATA / "anna.npz") as file:
        arrays = {name: file[name] for name in file.files}
    head = {**json.loads(arrays["head"].tobytes()), "materials": ["cloth"]}
    np.savez(path, **{**arrays, "head": np.frombuffer(json.dumps(head).encode(), np.uint8)})
    with pytest.raises(CharacterError, match="not a whole character file"):
        read_character(path)
