"""Describe streams of samples: columns with dtypes, units and frames, and batches of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError
from visavis.lab.ucum import require_ucum

UNIT_OF_SUFFIX: Mapping[str, str] = {
    "_ns": "ns",
    "_ms": "ms",
    "_s": "s",
    "_m": "m",
    "_mm": "mm",
    "_deg": "deg",
    "_hz": "Hz",
    "_01": "1",
}
"""Name endings that state a unit; a field of one of these units must end in its suffix.

Other units (a device's microvolts) stand in the field alone.
"""


@dataclass(frozen=True)
class Field:
    """One column of a stream.

    `dtype` is a NumPy scalar code ("f4", "i8", "?", "u1"); `shape` is the shape per sample,
    `()` for a scalar, `(3,)` for a vector; `frame` names the coordinate frame of vectors
    ("world", "head"); `unit` is of UCUM (`visavis.lab.ucum`): "uV", "/min", "1" for dimensionless
    numbers, and "" for flags and codes. Raises DataError for any other, with the nearest.
    """

    name: str
    dtype: str
    unit: str
    frame: str = ""
    shape: tuple[int, ...] = ()
    description: str = ""

    def __post_init__(self) -> None:
        if self.unit:
            require_ucum(self.unit, f"field {self.name!r}")
        suffix_unit = next((u for s, u in UNIT_OF_SUFFIX.items() if self.name.endswith(s)), None)
        if self.unit in UNIT_OF_SUFFIX.values() and self.unit != "1" and suffix_unit != self.unit:
            raise DataError(f"field {self.name!r} has unit {self.unit!r} but its name does not")
        if suffix_unit is not None and suffix_unit != self.unit:
            raise DataError(
                f"field {self.name!r} ends like {suffix_unit!r} but has unit {self.unit!r}"
            )


@dataclass(frozen=True)
class StreamSchema:
    """A named stream; `nominal_rate_hz` is 0 for irregular streams."""

    name: str
    fields: tuple[Field, ...]
    nominal_rate_hz: float
    version: int = 1

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The structured dtype of `SampleBatch.values`."""
        return np.dtype([(f.name, f.dtype, f.shape) for f in self.fields])


@dataclass(frozen=True, init=False)
class SampleBatch:
    """Hold n consecutive samples of one stream in arrival order.

    `seq` counts samples as the driver saw them (a hole means lost samples), `t_device_ns` is
    the device's own time (unmapped, never corrected), `t_host_ns` the session clock at arrival;
    all int64 of shape (n,). `values` is structured, shape (n,), dtype `schema.dtype`.
    """

    schema: StreamSchema
    seq: npt.NDArray[np.int64]
    t_device_ns: npt.NDArray[np.int64]
    t_host_ns: npt.NDArray[np.int64]
    values: npt.NDArray[np.void]

    def __init__(
        self,
        schema: StreamSchema,
        seq: npt.NDArray[np.int64],
        t_device_ns: npt.NDArray[np.int64],
        t_host_ns: npt.NDArray[np.int64],
        values: npt.NDArray[np.void],
    ) -> None:
        # Every frame makes some; a frozen dataclass's own __init__ takes three times as long.
        own = self.__dict__
        own["schema"], own["seq"], own["values"] = schema, seq, values
        own["t_device_ns"], own["t_host_ns"] = t_device_ns, t_host_ns

    def __len__(self) -> int:
        return int(self.seq.shape[0])

    def part(self, first: int, end: int) -> "SampleBatch":
        """Return the rows `first` up to, and without, `end`."""
        rows = slice(first, end)
        stamps = self.seq[rows], self.t_device_ns[rows], self.t_host_ns[rows]
        return SampleBatch(self.schema, *stamps, self.values[rows])


def empty_values(schema: StreamSchema, n: int) -> npt.NDArray[np.void]:
    """Return n zeroed samples of a stream, to be filled column by column."""
    values: npt.NDArray[Any] = np.zeros(n, dtype=schema.dtype)
    return values
