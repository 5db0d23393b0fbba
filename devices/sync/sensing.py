"""What every sensor of a synchronisation test gives: levels over the session's time."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Trace:
    """One channel: session times (n,) int64 ns, rising, and levels (n,) in any unit."""

    t_ns: npt.NDArray[np.int64]
    level: npt.NDArray[np.float64]


class Sensor(Protocol):
    """Something that listens, looks or feels while the test goes on."""

    @property
    def display_name(self) -> str:
        """Name of the sensor in the report."""
        ...

    def open(self) -> None:
        """Begin; raises DeviceError with a remedy."""
        ...

    def poll(self) -> None:
        """Take what has come; called every few milliseconds, never blocks."""
        ...

    def close(self) -> None:
        """End; idempotent."""
        ...

    def traces(self) -> Mapping[str, Trace]:
        """Return all channels so far, by name, on the session's clock."""
        ...

    def loss_count(self) -> int:
        """Return how many samples are known to be missing."""
        ...
