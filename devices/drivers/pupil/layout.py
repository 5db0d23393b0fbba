"""Read gaze data of a known layout without unpacking each: a faster way than the codec.

Capture packs the same keys in the same order for every datum of two eyes, so two payloads of one
length differ only in their 64-bit floats. Their places are learnt from a datum that the codec has
read. A later payload has the same layout if all its other bytes are equal, and is then read from
these places. Everything else goes to the codec, which alone decides what is malformed.
"""

from collections.abc import Sequence
from itertools import takewhile
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import GAZE
from visavis.devices.drivers.pupil import codec
from visavis.devices.drivers.streaming.gaze_rays import MAX_PUPIL_MM, MIN_PUPIL_MM
from visavis.devices.plausible import MAX_FAR_M
from visavis.lab.compiled import compiled

Bytes = npt.NDArray[np.uint8]
Places = npt.NDArray[np.int64]

MAX_LAYOUTS = 16
MAX_ATTEMPTS = 4
"""Attempts to learn from data of one length; after that its layout is not regular."""

_FIRST_MARK = 1e300
_TIMESTAMP, _CONFIDENCE, _NORMALS, _CENTERS, _SURE, _MM, _N_PLACES = 0, 1, 2, 8, 14, 16, 18
_ROW_BYTES = GAZE.dtype.itemsize
_MAX_F4 = float(np.finfo(np.float32).max)
_MAX_STAMP = 2.0**62


class Layout:
    """Where the numbers of a datum lie: `fixed` masks the bytes that must equal `example`."""

    def __init__(self, example: bytes, floats: list[int], places: list[int]) -> None:
        self.example = np.frombuffer(example, np.uint8)
        is_fixed = np.ones(len(example), np.bool_)
        for at in floats:
            is_fixed[at : at + 8] = False
        self.fixed = np.flatnonzero(is_fixed)
        self.places = np.array(places, np.int64)


def learn_layout(payload: bytes) -> Layout | None:
    """Return the layout of a well-formed datum of two eyes; None if its layout is different.

    Numbers are found by packing the datum again with a mark in the place of every float, so its
    bytes must be those that msgpack packs.
    """
    try:
        datum = msgpack.unpackb(payload, strict_map_key=False)
        if msgpack.packb(datum) != payload:
            return None
        count = [0]
        marked_datum = _with_marks(datum, count)
        marked_bytes: bytes = msgpack.packb(marked_datum)
        marks = [_FIRST_MARK * (1 + i / 65536) for i in range(count[0])]
        at = {mark: marked_bytes.index(msgpack.packb(mark)) + 1 for mark in marks}
        places = [at[mark] for mark in _sample_marks(marked_datum)]
    except (ValueError, TypeError, KeyError, IndexError, msgpack.UnpackException):
        return None
    return Layout(payload, list(at.values()), places)


class GazeDecoder:
    """Decode gaze data one after another, as `codec.decode_gaze` does."""

    def __init__(self, threshold_01: float) -> None:
        self._threshold_01 = threshold_01
        self._layouts: dict[int, Layout] = {}
        self._attempts: dict[int, int] = {}

    def decode(self, payload: bytes, rows: Bytes, stamps_ns: Places, i: int) -> bool:
        """Write row i of `rows` (bytes of `GAZE.dtype`, joined) and of `stamps_ns`.

        Returns False when the payload is malformed.
        """
        layout = self._layouts.get(len(payload))
        if layout is not None and _read(
            np.frombuffer(payload, np.uint8),
            layout.example,
            layout.fixed,
            layout.places,
            self._threshold_01,
            rows,
            stamps_ns,
            i,
        ):
            return True
        return self._take_apart(payload, rows, stamps_ns, i)

    def decode_run(self, payloads: Sequence[bytes], rows: Bytes, stamps_ns: Places) -> int:
        """Write rows 0 to n - 1 from the first n payloads, which share a known layout; return n."""
        size = len(payloads[0]) if payloads else 0
        layout = self._layouts.get(size)
        if layout is None:
            return 0
        alike = list(takewhile(lambda payload: len(payload) == size, payloads))
        return _read_run(
            np.frombuffer(b"".join(alike), np.uint8),
            layout.example,
            layout.fixed,
            layout.places,
            self._threshold_01,
            rows,
            stamps_ns,
        )

    def _take_apart(self, payload: bytes, rows: Bytes, stamps_ns: Places, i: int) -> bool:
        sample = codec.decode_gaze(payload, self._threshold_01)
        if sample is None:
            return False
        stamps_ns[i] = sample[0]
        rows[i * _ROW_BYTES : (i + 1) * _ROW_BYTES] = np.frombuffer(sample[1], np.uint8)
        size = len(payload)
        attempts = self._attempts.get(size, 0)
        if attempts < MAX_ATTEMPTS and (size in self._layouts or len(self._layouts) < MAX_LAYOUTS):
            self._attempts[size] = attempts + 1
            layout = learn_layout(payload)
            if layout is not None:
                self._layouts[size] = layout
        return True


def _with_marks(value: Any, count: list[int]) -> Any:
    """Return the value with every float replaced by a mark of its own."""
    if isinstance(value, float):
        count[0] += 1
        return _FIRST_MARK * (1 + (count[0] - 1) / 65536)
    if isinstance(value, dict):
        return {key: _with_marks(item, count) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_marks(item, count) for item in value]
    return value


def _sample_marks(marked_datum: dict[str, Any]) -> list[float]:
    """Return the marks of the numbers that make a sample; KeyError when one is not a float."""
    normals, centers = marked_datum["gaze_normals_3d"], marked_datum["eye_centers_3d"]
    pupils = {pupil["id"]: pupil for pupil in marked_datum["base_data"]}
    if len(marked_datum["base_data"]) != 2 or pupils.keys() != {0, 1}:
        raise KeyError("base_data")
    keys = ["0", "1"] if "0" in normals else [0, 1]
    marks = [marked_datum["timestamp"], marked_datum["confidence"]]
    for vectors in (normals, centers):
        for key in keys:
            x, y, z = vectors[key]
            marks += [x, y, z]
    marks += [pupils[eye]["confidence"] for eye in (0, 1)]
    marks += [pupils[eye]["diameter_3d"] for eye in (0, 1)]
    return marks


@compiled
def _read(
    payload: Bytes,
    example: Bytes,
    fixed: Places,
    places: Places,
    threshold_01: float,
    rows: Bytes,
    stamps_ns: Places,
    i: int,
) -> bool:
    """Write a sample as `decode_gaze` would; False where `decode_gaze` must decide."""
    # Every byte outside the floats must equal the example; the floats are big-endian.
    for at in fixed:
        if payload[at] != example[at]:
            return False
    number = np.empty(_N_PLACES)
    raw = number.view(np.uint8)
    for j in range(_N_PLACES):
        for k in range(8):
            raw[8 * j + k] = payload[places[j] + 7 - k]
    stamp = number[_TIMESTAMP] * 1e9
    if not abs(stamp) < _MAX_STAMP:
        return False
    # Directions and positions of the right eye (0) and the left (1), NaN when there is none.
    ray = np.empty((2, 3))
    at_m = np.empty((2, 3))
    has_ray = np.empty(2, np.bool_)
    for eye in range(2):
        x, y, z = (
            number[_NORMALS + 3 * eye],
            number[_NORMALS + 3 * eye + 1],
            number[_NORMALS + 3 * eye + 2],
        )
        length = np.sqrt(x * x + y * y + z * z)
        has_ray[eye] = 1e-6 < length < np.inf
        if has_ray[eye]:
            ray[eye, 0], ray[eye, 1], ray[eye, 2] = x / length, -y / length, -z / length
        else:
            ray[eye] = np.nan
        at_m[eye, 0] = number[_CENTERS + 3 * eye] * 1e-3
        at_m[eye, 1] = number[_CENTERS + 3 * eye + 1] * -1e-3
        at_m[eye, 2] = number[_CENTERS + 3 * eye + 2] * -1e-3
    # The combined ray: the mean of both eyes, or the only valid (or only present) one.
    right_valid = has_ray[0] and number[_SURE] >= threshold_01
    left_valid = has_ray[1] and number[_SURE + 1] >= threshold_01
    single = np.empty(15, np.float32)
    both = np.empty(3)
    origin = np.empty(3)
    used_eyes = 0
    if left_valid == right_valid and has_ray[0] and has_ray[1]:
        x, y, z = ray[1, 0] + ray[0, 0], ray[1, 1] + ray[0, 1], ray[1, 2] + ray[0, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length > 1e-6:
            both[0], both[1], both[2] = x / length, y / length, z / length
        else:
            both[:] = np.nan
        for k in range(3):
            origin[k] = (at_m[1, k] + at_m[0, k]) / 2
        used_eyes = 3
    elif left_valid or (has_ray[1] and not right_valid):
        for k in range(3):
            both[k], origin[k] = ray[1, k], at_m[1, k]
        used_eyes = 1
    elif has_ray[0]:
        for k in range(3):
            both[k], origin[k] = ray[0, k], at_m[0, k]
        used_eyes = 2
    else:
        both[:] = np.nan
        origin[:] = np.nan
    confidence = number[_CONFIDENCE]
    if origin[0] == origin[0]:  # the codec decides about impossible places
        for k in range(3):
            if not abs(origin[k]) <= MAX_FAR_M:
                return False
    if np.isfinite(confidence) and abs(confidence) > _MAX_F4:
        return False
    valid = confidence >= threshold_01 and (left_valid or right_valid) and both[0] == both[0]
    for k in range(3):
        single[k] = both[k]
        single[3 + k] = origin[k]
        single[7 + k] = ray[1, k]
        single[11 + k] = ray[0, k]
    single[6] = confidence
    for eye in range(2):
        mm = number[_MM + eye]
        single[14 - 4 * eye] = mm if MIN_PUPIL_MM <= mm < MAX_PUPIL_MM else np.nan
    # Pack the row byte by byte in the order of `GAZE.dtype`, which has no padding.
    bits = single.view(np.uint8)
    row = i * _ROW_BYTES
    for k in range(24):
        rows[row + k] = bits[k]
    rows[row + 24] = 1 if valid else 0
    rows[row + 25] = used_eyes
    for k in range(4):
        rows[row + 26 + k] = bits[24 + k]
    for k in range(12):
        rows[row + 30 + k] = bits[28 + k]
    rows[row + 42] = 1 if left_valid else 0
    for k in range(4):
        rows[row + 43 + k] = bits[40 + k]
    for k in range(12):
        rows[row + 47 + k] = bits[44 + k]
    rows[row + 59] = 1 if right_valid else 0
    for k in range(4):
        rows[row + 60 + k] = bits[56 + k]
    stamps_ns[i] = np.int64(np.rint(stamp))
    return True


@compiled
def _read_run(
    payloads: Bytes,
    example: Bytes,
    fixed: Places,
    places: Places,
    threshold_01: float,
    rows: Bytes,
    stamps_ns: Places,
) -> int:
    """Do `_read` for joined payloads of one length until it says False; return how many it read."""
    size = len(example)
    n = len(payloads) // size
    for i in range(n):
        payload = payloads[i * size : (i + 1) * size]
        if not _read(payload, example, fixed, places, threshold_01, rows, stamps_ns, i):
            return i
    return n
