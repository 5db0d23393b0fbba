"""Arrays and their description as text that a page carries within itself."""

import base64
import json
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

MISSING = 65535
"""Stands for a value that is missing in quantised arrays."""


class Bundle:
    """Collect arrays; each is known by the reference that `add` returns, for use in the header."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self.size = 0
        """Bytes of all arrays, before they are packed."""

    def add(self, values: npt.NDArray[Any]) -> dict[str, Any]:
        """Take an array in; return where it lies: kind and number of elements, shape, first byte.

        Arrays of several dimensions are laid out column after column, which packs better.
        """
        flat = np.ascontiguousarray(
            values.reshape(len(values), int(np.prod(values.shape[1:]))).T
            if values.ndim > 1
            else values
        )
        reference = {"d": values.dtype.str[1:], "s": list(values.shape), "o": self.size}
        self._append(flat.astype(flat.dtype.newbyteorder("<")).tobytes())
        return reference

    def add_bytes(self, content: bytes) -> dict[str, Any]:
        """Take a file in."""
        reference = {"d": "u1", "s": [len(content)], "o": self.size}
        self._append(content)
        return reference

    def add_whole(self, values: npt.NDArray[Any]) -> dict[str, Any]:
        """Take whole numbers and truth values in, exactly: they number, count or name things."""
        columns = values.reshape(len(values), int(np.prod(values.shape[1:]))).astype(np.int64)
        changes = np.diff(columns, axis=0, prepend=np.int64(0))
        kinds: list[Any] = [np.int8, np.int16, np.int32, np.float64]
        size = np.abs(changes).max(initial=0)
        kind = next(k for k in kinds if k is np.float64 or size <= np.iinfo(k).max)
        return {**self.add(changes.astype(kind)), "columns": columns.shape[1]}

    def add_quantised(self, values: npt.NDArray[Any]) -> dict[str, Any]:
        """Take numbers in at 1 part in 65,000 of each column's range; NaN stays missing."""
        columns = values.reshape(len(values), int(np.prod(values.shape[1:]))).astype(np.float64)
        numbers = np.where(np.isfinite(columns), columns, np.nan)
        some = (
            np.isfinite(numbers).any(axis=0) if len(numbers) else np.zeros(numbers.shape[1], bool)
        )
        low, high = np.zeros(numbers.shape[1]), np.zeros(numbers.shape[1])
        if some.any():
            low[some], high[some] = np.nanmin(numbers[:, some], 0), np.nanmax(numbers[:, some], 0)
        step = np.where(high > low, (high - low) / (MISSING - 1), 1.0)
        codes = np.where(np.isfinite(numbers), np.rint((numbers - low) / step), MISSING).astype(
            np.int64
        )
        changes = np.diff(codes, axis=0, prepend=0).astype(np.uint16)
        reference = self.add(changes.reshape(values.shape))
        return {**reference, "low": [_short(x) for x in low], "step": [_short(x) for x in step]}

    def _append(self, content: bytes) -> None:
        content += bytes(-len(content) % 8)
        self._pieces.append(content)
        self.size += len(content)

    def text(self, header: dict[str, Any]) -> str:
        """Return header and arrays, packed, as characters that any page may hold."""
        head = json.dumps(header, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        raw = head.encode()
        raw += b" " * (-len(raw) % 8)
        content = len(raw).to_bytes(8, "little") + raw + b"".join(self._pieces)
        return base64.b64encode(zlib.compress(content, 9)).decode()


def _short(value: float) -> float:
    return float(f"{value:.9g}")
