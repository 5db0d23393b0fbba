"""Files from anywhere end in an error that names them, never in a wait or an overflow."""

import gzip
import os
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml

from visavis.lab.errors import ConfigError
from visavis.lab.plain_files import open_plain, parse_json, read_arrays, read_packed, read_plain
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
