"""Write into arrays that begin again at their start when they are full."""

from typing import Any

import numpy.typing as npt


def put_round(ring: npt.NDArray[Any], first: int, rows: npt.NDArray[Any]) -> None:
    """Write rows (n, ...) into a ring (capacity, ...) from row `first` on, n capacity at most.

    Two slices, because an index for each row takes five times as long.
    """
    capacity, end = len(ring), first + len(rows)
    if end <= capacity:
        ring[first:end] = rows
    else:
        ring[first:] = rows[: capacity - first]
        ring[: end - capacity] = rows[capacity - first :]
