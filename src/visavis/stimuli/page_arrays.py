"""Arrays as the bytes that pages read (`readArrays` in `site/blend.js`).

A file is the length of its head (4 bytes, little-endian), the head as JSON, and the arrays, each
from the next multiple of eight bytes on, in the order of `arrays` in the head: name, shape, kind of
number ("f8", "f4", "u4", "u1").
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt


def packed_arrays(head: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Return a head and arrays as one file."""
    header = [[name, a.shape, a.dtype.str[1:]] for name, a in arrays.items()]
    text = json.dumps({**head, "arrays": header}).encode()
    start = _padded(struct.pack("<I", len(text)) + text)
    return start + b"".join(_padded(np.ascontiguousarray(a).tobytes()) for a in arrays.values())


def _padded(data: bytes) -> bytes:
    return data + b" " * (-len(data) % 8)
