"""Files from anywhere end in an error that names them, never in a wait or an overflow."""

import gzip
import os
import tracemalloc
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml

from tests.product_files import name_in_repository, product_files
from visavis.lab import plain_files
from visavis.lab.errors import ConfigError
from visavis.lab.plain_files import (
    open_plain,
    parse_json,
    read_arrays,
    read_packed,
    read_plain,
    unpacked,
    with_whole_characters,
)
from visavis.lab.yaml_lines import parse_document, read_document


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with names")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="not a regular file"):
        open_plain(pipe)
    with pytest.raises(ConfigError, match="not a regular file"):
        read_document(pipe)


def test_a_folder_and_a_file_too_large_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="not a regular file"):
        read_plain(tmp_path)
    (tmp_path / "large").write_bytes(b"x" * 101)
    with pytest.raises(OSError, match="larger than 100 bytes"):
        read_plain(tmp_path / "large", max_bytes=100)


@pytest.mark.parametrize(("read", "pack"), [(read_plain, bytes), (read_packed, gzip.compress)])
@pytest.mark.parametrize("size", [0, 1, 1 << 20, (1 << 20) + 1, 3_000_000])
def test_reading_takes_memory_for_what_is_there_not_for_the_most_there_may_be(
    tmp_path: Path, read: Callable[..., bytes], pack: Callable[[bytes], bytes], size: int
) -> None:
    data = bytes(range(256)) * (size // 256) + b"x" * (size % 256)
    path = tmp_path / "small"
    path.write_bytes(pack(data))
    read(path, max_bytes=1 << 36)  # 64 GiB; what is imported once does not count
    tracemalloc.start()
    try:
        assert data == read(path, max_bytes=1 << 36)
        assert tracemalloc.get_traced_memory()[1] < 3 * size + (1 << 21)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "text",
    ["[" * 70 + "]" * 70, "[" * 100_000 + "]" * 100_000, '{"a":' * 300 + "1" + "}" * 300],
)
def test_deep_json_is_a_value_error(text: str) -> None:
    for data in (text, text.encode()):
        with pytest.raises(ValueError, match="nested deeper than 64"):
            parse_json(data)


@pytest.mark.parametrize("text", ["NaN", "[Infinity]", '{"a": -Infinity}', "", "{", "\xff"])
def test_what_is_no_json_is_a_value_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_json(text)


def test_many_brackets_beside_each_other_are_not_deep() -> None:
    assert 500 == len(parse_json("[" + ",".join(["[]"] * 500) + "]"))


def deep_flow() -> str:
    return "[" * 20_000 + "]" * 20_000


def deep_block() -> str:
    return "".join(" " * i + "a:\n" for i in range(2_000))


def alias_bomb() -> str:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 9)]
    return "\n".join(lines)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    ("make", "said"),
    [(deep_flow, "nested deeper"), (deep_block, "nested deeper"), (alias_bomb, "aliases counted")],
)
def test_yaml_that_would_never_end_is_refused_soon(make, said) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_document(make(), Path("hostile.yaml"))


def test_yaml_of_brackets_is_refused_at_the_first_that_is_too_deep(monkeypatch) -> None:
    """A scanner of YAML looks a thousand characters ahead, and slower with every open bracket."""
    given, begun = Path("hostile.yaml"), []
    begin = yaml.scanner.Scanner.fetch_flow_sequence_start
    monkeypatch.setattr(
        yaml.scanner.Scanner,
        "fetch_flow_sequence_start",
        lambda scanner: (begun.append(1), begin(scanner)),
    )
    assert 50 == str(parse_document("[" * 50 + "]" * 50, given).data).count("[")
    begun.clear()
    with pytest.raises(ConfigError, match="nested deeper than 50 levels"):
        parse_document("[" * 3000, given)
    assert 51 == len(begun)


@pytest.mark.parametrize(
    "array",
    [
        np.arange(12, dtype=np.int16).reshape(3, 4),
        np.asfortranarray(np.arange(12.0).reshape(3, 4)),
        np.arange(4, dtype=">i4"),
        np.array(["hips", "head"]),
        np.array([("a", 1.5)], dtype=[("name", "<U4"), ("value", "<f8")]),
        np.array(True),
        np.zeros((0, 3)),
        np.array(["", ""]),
    ],
)
def test_an_array_is_read_as_it_was_written_and_may_be_changed(
    array: npt.NDArray[Any], tmp_path: Path
) -> None:
    path = tmp_path / "a.npz"
    np.savez_compressed(path, first=array, second=array)
    found = read_arrays(path)
    assert ["first", "second"] == list(found)
    for read in found.values():
        assert (array.dtype, array.shape) == (read.dtype, read.shape)
        assert array.tobytes() == read.tobytes()
        assert read.flags.writeable


@pytest.mark.parametrize("member", [b"no array", b"\x93NUMPY\x01\x00", b""])
def test_an_npz_file_that_holds_anything_but_arrays_is_refused(
    member: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("note.txt", member)
    with pytest.raises(ValueError, match=r"magic|EOF"):
        read_arrays(path)


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, names=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="pickle"):
        read_arrays(path)


def hostile_archive(path: Path, size: int) -> None:
    """Write an archive of six megabytes at most that unpacks to `size` bytes of zeros."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("zeros.npy", "w", force_zip64=True) as member:
            head = {"descr": "|u1", "fortran_order": False, "shape": (size,)}
            np.lib.format.write_array_header_1_0(member, head)
            for _ in range(0, size, 1 << 20):
                member.write(bytes(1 << 20))


def test_an_archive_that_unpacks_to_more_than_it_may_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plain_files, "MAX_ARRAYS_BYTES", 4 << 20)
    hostile_archive(tmp_path / "small.npz", 3 << 20)
    assert (3 << 20,) == read_arrays(tmp_path / "small.npz")["zeros"].shape
    hostile_archive(tmp_path / "large.npz", 8 << 20)
    with pytest.raises(ValueError, match=r"unpacks to \d+ bytes"):
        read_arrays(tmp_path / "large.npz")


def test_an_archive_is_read_a_member_at_a_time_and_not_beyond_what_it_may(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.mkdir("folder")
        for name in ("a.txt", "b.txt", "large.bin"):
            archive.writestr(name, bytes(1000 if name.endswith("txt") else 5000))
    wanted: Any = {"is_wanted": lambda name: name.endswith(".txt"), "max_bytes": 2000}
    assert [("a.txt", bytes(1000)), ("b.txt", bytes(1000))] == list(unpacked(path, **wanted))
    with pytest.raises(ValueError, match="unpacks to 7000 bytes, more than 2000"):
        next(unpacked(path, max_bytes=2000))
    with pytest.raises(ValueError, match=r"large\.bin unpacks to 5000 bytes, more than 4000"):
        next(unpacked(path, max_member_bytes=4000))
    data = bytearray(path.read_bytes())
    at = data.index(b"a.txt", data.index(b"PK\x01\x02")) - 22  # the claim of its size there
    data[at : at + 4] = (10).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"no whole \.zip file"):
        list(unpacked(path, **wanted))


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive at all" * 100])
def test_what_is_no_archive_is_a_refusal(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(content)
    with pytest.raises(ValueError, match=r"no whole \.zip file"):
        list(unpacked(tmp_path / "a.zip"))


def test_a_text_that_unpacks_as_no_text_does_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plain_files, "FREE_TEXT_BYTES", 1 << 16)
    path = tmp_path / "a.tsv.gz"
    path.write_bytes(gzip.compress(bytes(1 << 16)))
    assert bytes(1 << 16) == read_packed(path)
    path.write_bytes(gzip.compress(bytes(1 << 22)))
    with pytest.raises(OSError, match="unpacks to more than"):
        read_packed(path)
    rows = "".join(f"{i}\t{i * 7919 % 1000}.5\n" for i in range(100_000)).encode()
    path.write_bytes(gzip.compress(rows, 9))
    assert rows == read_packed(path)


OPENERS = ("ZipFile", "GzipFile", "np.load", "gzip.open", "gzip.decompress", "tarfile", "lzma.")


def test_nothing_else_opens_an_archive() -> None:
    """One reader is bounded; a second one would have to be, too."""
    found = [
        f"{name_in_repository(path)}: {line.strip()}"
        for path in product_files()
        if path.name != "plain_files.py"
        for line in path.read_text("utf-8").splitlines()
        if any(opener in line for opener in OPENERS) and '"w' not in line
    ]
    assert [] == found


@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
@pytest.mark.parametrize("by_column", [False, True])
def test_an_array_that_claims_more_than_is_there_is_not_allocated(
    tmp_path: Path, version: tuple[int, int], by_column: bool
) -> None:
    member = BytesIO()
    head = {"descr": "<f8", "fortran_order": by_column, "shape": (1 << 20, 1 << 20)}
    write = {
        (1, 0): np.lib.format.write_array_header_1_0,
        (2, 0): np.lib.format.write_array_header_2_0,
    }
    write[version](member, head)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", member.getvalue() + bytes(64))
    with pytest.raises(ValueError, match=r"claims|buffer is smaller"):
        read_arrays(tmp_path / "a.npz")
    assert [[1.0, 2.0]] == _read_back(tmp_path, np.asfortranarray([[1.0, 2.0]]))


def _read_back(folder: Path, array: npt.NDArray[np.float64]) -> object:
    np.savez(folder / "b.npz", array=array)
    return read_arrays(folder / "b.npz")["array"].tolist()


@pytest.mark.parametrize(
    ("posted", "whole"),
    [
        ("a\ud83d", "a�"),
        (["\udc00", 1, None], ["�", 1, None]),
        ({"\ud83d": {"b": "😀"}}, {"�": {"b": "😀"}}),
    ],
)
def test_halves_of_characters_are_marked(posted: object, whole: object) -> None:
    assert whole == with_whole_characters(posted)
