"""No byte of a growing file of lines changes unseen, and its copy puts it back."""

from pathlib import Path

import numpy as np
import pytest

from visavis.recording.chained import append_lines, read_lines, repair_lines
from visavis.recording.sealed import copy_path

RECORDS = [{"event": "added", "label": f"{i:02d}A", "note": "é"} for i in range(12)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    lines = tmp_path / "lines.jsonl"
    for record in RECORDS:
        append_lines(lines, [record])
    return lines


def test_records_come_back_in_order(path: Path) -> None:
    content = read_lines(path)
    assert (tuple(RECORDS), None, ()) == (content.records, content.damaged_line, content.notes)
    assert path.read_bytes() == copy_path(path).read_bytes()


def test_no_flipped_bit_is_read_as_if_nothing_were(path: Path) -> None:
    data = path.read_bytes()
    rng = np.random.default_rng(2)
    for _ in range(300):
        at, bit = int(rng.integers(len(data))), 1 << int(rng.integers(8))
        path.write_bytes(data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :])
        content = read_lines(path)
        assert content.damaged_line is not None or content.notes
        assert content.records == tuple(RECORDS)[: len(content.records)]
        assert repair_lines(path) is not None
        assert data == path.read_bytes()


def test_a_cut_takes_nothing_as_the_copy_has_it(path: Path) -> None:
    data = path.read_bytes()
    for cut in range(0, len(data), 11):
        path.write_bytes(data[:cut])
        content = read_lines(path)
        assert tuple(RECORDS) == content.records
        assert "of its copy" in content.notes[0]
    append_lines(path, [{"event": "more"}])
    assert 13 == len(read_lines(path).records)
    assert () == read_lines(path).notes


def test_lines_taken_out_or_swapped_are_noticed(path: Path) -> None:
    lines = path.read_bytes().splitlines(True)
    copy_path(path).unlink()
    for changed in (lines[:3] + lines[4:], [lines[1], lines[0], *lines[2:]], [*lines, lines[-1]]):
        path.write_bytes(b"".join(changed))
        assert read_lines(path).damaged_line is not None


def test_lines_from_before_there_were_checksums_are_read_and_vouched_for(path: Path) -> None:
    copy_path(path).unlink()
    path.write_bytes(b'{"event":"ledger","format":1}\n{"event":"added","n":1}\n')
    append_lines(path, [{"event": "added", "n": 2}])
    assert [None, 1, 2] == [r.get("n") for r in read_lines(path).records]
    path.write_bytes(path.read_bytes().replace(b'"n":1', b'"n":7'))
    assert (3, "or one before it is not as it was written") == read_lines(path).damaged_line


def test_a_damaged_copy_is_named_and_renewed(path: Path) -> None:
    data = path.read_bytes()
    copy_path(path).write_bytes(data.replace(b"05A", b"06A"))
    content = read_lines(path)
    assert tuple(RECORDS) == content.records
    assert "is damaged or cut short" in content.notes[0]
    assert "was renewed" in str(repair_lines(path))
    assert data == copy_path(path).read_bytes()


def test_where_both_are_damaged_nothing_is_put_back(path: Path) -> None:
    for file in (path, copy_path(path)):
        file.write_bytes(file.read_bytes().replace(b"05A", b"06A"))
    with pytest.raises(ValueError, match="restore one from a backup"):
        repair_lines(path)
