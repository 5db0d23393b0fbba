"""What a fuzzer found: readers refuse these in words, none lets a traceback through."""

import gzip
import zipfile
from contextlib import suppress
from pathlib import Path

import msgpack
import numpy as np
import pytest

from analysis.foreign_check import check_foreign
from analysis.gaze.bids import read_bids
from analysis.gaze.text_table import read_text_table
from devices.wirelog import FORMAT, VERSION, read_wire_log
from lab.errors import DataError
from lab.plain_files import read_arrays, read_packed
from stimuli.characters.errors import CharacterError
from stimuli.characters.storage import read_character
from stimuli.motion.clip_file import read_clip
from stimuli.motion.errors import MotionError

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
