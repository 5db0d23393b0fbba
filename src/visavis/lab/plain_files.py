"""Open files and read JSON that may come from anywhere: bounded, and never a pipe or a device."""

import errno
import gzip
import json
import math
import os
import re
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from io import BufferedReader, BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

MAX_DEPTH = 64
MAX_TEXT_BYTES = 256 * 1024 * 1024
"""Far more than any text file that Visavis writes."""
MAX_UNPACKED_BYTES = 4 << 30
MAX_ARRAYS_BYTES = 448 << 20
"""Read and copied, they take less than a gigabyte of memory."""
MAX_TEXT_RATIO = 200
"""No recording packs its text so well; what repeats one byte for ever does."""
FREE_TEXT_BYTES = 64 << 20
"""Text unpacks to this much, however well it was packed."""
PIECE_BYTES = 1 << 20
DAMAGED_ARCHIVE = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    NotImplementedError,
    RecursionError,
    RuntimeError,
    SyntaxError,
    TypeError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What zipfile and NumPy's reader of headers let through whatever a damaged byte leads them to."""
_HALF_CHARACTER = re.compile("[\ud800-\udfff]")


def open_plain(path: Path) -> BufferedReader:
    """Open a regular file for reading.

    Raises OSError, also for a pipe, a device or a folder, at which other calls would wait.
    """
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file", str(path))
    return path.open("rb")


def read_plain(path: Path, *, max_bytes: int = MAX_TEXT_BYTES) -> bytes:
    """Return what a regular file holds; raises OSError, also when it is larger than `max_bytes`."""
    with open_plain(path) as file:
        data = _at_most(file, max_bytes + 1, os.fstat(file.fileno()).st_size + 1)
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"it is larger than {max_bytes} bytes", str(path))
    return data


def read_packed(
    path: Path, *, max_bytes: int = MAX_UNPACKED_BYTES, may_be_cut: bool = False
) -> bytes:
    """Return what a gzip file holds; what comes before its damage where it `may_be_cut`.

    Raises OSError, also when it is cut or damaged, or unpacks to more than `max_bytes` or than
    text does.
    """
    with open_plain(path) as file, gzip.GzipFile(fileobj=file) as stream:
        packed_bytes = os.fstat(file.fileno()).st_size
        max_bytes = min(max_bytes, max(MAX_TEXT_RATIO * packed_bytes, FREE_TEXT_BYTES))
        try:
            if may_be_cut:
                data = _before_damage(stream, max_bytes + 1)
            else:
                data = _at_most(stream, max_bytes + 1, PIECE_BYTES)
        except (EOFError, zlib.error) as error:
            raise OSError(
                errno.EIO, f"it is not a complete gzip file ({error})", str(path)
            ) from error
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"it unpacks to more than {max_bytes} bytes", str(path))
    return data


def _before_damage(file: gzip.GzipFile, most: int) -> bytes:
    """Read a file up to its end or its damage, no more than `most` bytes."""
    read = BytesIO()
    with suppress(EOFError, zlib.error):
        while data := file.read1(min(PIECE_BYTES, most - read.tell())):
            read.write(data)
    return read.getvalue()


def _at_most(file: BufferedReader | gzip.GzipFile, most: int, piece: int) -> bytes:
    """Read a file to its end, no more than `most` bytes, `piece` at first and then more.

    Python allocates as much as is requested before it knows how much there is.
    """
    data = file.read(min(piece, most))
    if len(data) < piece:  # all there is, which need not be copied
        return data
    read = BytesIO()
    while data:
        read.write(data)
        data = file.read(min(PIECE_BYTES, most - read.tell()))
    return read.getvalue()


def unpacked(
    path: Path,
    is_wanted: Callable[[str], bool] = lambda name: True,
    *,
    max_bytes: int = MAX_UNPACKED_BYTES,
    max_member_bytes: int = MAX_UNPACKED_BYTES,
) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of the wanted members of a ZIP archive, one at a time.

    What members claim is added up first: an archive of more than `max_bytes`, or with a member of
    more than `max_member_bytes`, is refused unread; no member is read beyond its claim. Raises
    OSError when it cannot be read, and ValueError when it is damaged, encrypted or too large.
    """
    try:
        with open_plain(path) as file, zipfile.ZipFile(file) as archive:
            members = [m for m in archive.infolist() if not m.is_dir() and is_wanted(m.filename)]
            unpacked_bytes = sum(member.file_size for member in members)
            if unpacked_bytes > max_bytes:
                raise ValueError(f"it unpacks to {unpacked_bytes} bytes, more than {max_bytes}")
            for member in members:
                if member.file_size > max_member_bytes:
                    size = f"{member.file_size} bytes, more than {max_member_bytes}"
                    raise ValueError(f"{member.filename} unpacks to {size}")
            for member in members:
                yield member.filename, archive.read(member)
    except DAMAGED_ARCHIVE as error:
        why = error or type(error).__name__
        raise ValueError(f"no whole {path.suffix or 'ZIP'} file: {why}") from error


def read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an .npz file by name.

    Raises OSError when it cannot be read, and ValueError for anything that is not a complete
    .npz file of real numbers and texts.
    """
    try:
        arrays = {
            name.removesuffix(".npy"): _array(content)
            for name, content in unpacked(path, max_bytes=MAX_ARRAYS_BYTES)
        }
    except DAMAGED_ARCHIVE as error:
        raise ValueError(f"no whole .npz file: {error or type(error).__name__}") from error
    for name, array in arrays.items():
        if array.dtype.kind == "c":
            raise ValueError(f"array {name!r} holds complex numbers")
    return arrays


def _array(member: bytes) -> npt.NDArray[Any]:
    """Return what a member of an .npz file holds; raises ValueError for all but arrays.

    Same result as NumPy's reader, but equal headers are parsed once: files hold many such arrays.
    """
    end = 10 + int.from_bytes(member[8:10], "little")
    if member[:8] == b"\x93NUMPY\x01\x00":
        shape, by_column, dtype = _header(member[8:end])
        count = math.prod(shape)
        if count > 0 and dtype.itemsize > 0 and not by_column and not dtype.hasobject:
            flat = np.frombuffer(member, dtype, count, end)
            return flat.reshape(shape).copy()
    stream = BytesIO(member)
    is_first_version = np.lib.format.read_magic(stream) == (1, 0)
    read_header = (
        np.lib.format.read_array_header_1_0
        if is_first_version
        else np.lib.format.read_array_header_2_0
    )
    shape, _, dtype = read_header(stream)
    if math.prod(shape) * dtype.itemsize > len(member):  # NumPy would allocate it before it reads
        raise ValueError(f"an array claims {math.prod(shape)} values that are not there")
    stream.seek(0)
    read: npt.NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    return read


@lru_cache(maxsize=4096)
def _header(header: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, whether columns come first, and type."""
    read: tuple[tuple[int, ...], bool, np.dtype[Any]] = np.lib.format.read_array_header_1_0(
        BytesIO(header)
    )
    return read


def parse_json(data: bytes | str, *, max_depth: int = MAX_DEPTH) -> Any:
    """Return what a JSON text says.

    Raises ValueError for anything else: numbers that are none, text that is not UTF-8, lists and
    objects nested deeper than `max_depth`.
    """
    try:
        value = json.loads(data, parse_constant=_refuse)
    except RecursionError:
        raise ValueError(f"it is nested deeper than {max_depth} levels") from None
    raw = data.encode(errors="replace") if isinstance(data, str) else data
    if raw.count(b"[") + raw.count(b"{") > max_depth and _depth(value) > max_depth:
        raise ValueError(f"it is nested deeper than {max_depth} levels")
    return value


def with_whole_characters(value: Any) -> Any:
    """Return a JSON value with U+FFFD in the place of halves of characters (lone surrogates).

    A browser cuts a text between the halves of an emoji; no file could hold what is left.
    """
    if isinstance(value, str):
        return _HALF_CHARACTER.sub("\ufffd", value)
    if isinstance(value, list):
        return [with_whole_characters(inner) for inner in value]
    if isinstance(value, dict):
        return {
            _HALF_CHARACTER.sub("\ufffd", k): with_whole_characters(v) for k, v in value.items()
        }
    return value


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is not a JSON number")


def _depth(value: Any) -> int:
    depth, level = 0, [value]
    while level:
        depth += 1
        level = [inner for outer in level for inner in _inside(outer)]
    return depth - 1


def _inside(value: Any) -> Iterator[Any]:
    if isinstance(value, dict):
        yield from value.values()
    elif isinstance(value, list):
        yield from value
