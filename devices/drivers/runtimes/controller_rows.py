"""Rows of controllers: buttons and axes that changed, and where each hand points."""

import math
import struct
from collections.abc import Sequence

import numpy as np

from devices.contracts import POINTER, RESPONSES
from lab.schema import SampleBatch

SMALLEST_STEP_01 = 0.01
"""An axis is told when it has moved by this much, or got to an end."""

Ray = tuple[Sequence[float], Sequence[float]] | None
"""Position and orientation (w, x, y, z); None: not tracked."""
Change = tuple[int, int, int, float]
"""When it happened, when it was known, control, value."""

_RAY_ROW = struct.Struct("<B3f4f?")


class Levels:
    """Remember every control's value; tell those that changed."""

    def __init__(self) -> None:
        self._told: dict[int, float] = {}

    def changed(self, control: int, value_01: float, *, axis: bool) -> bool:
        """Tell whether a control's value is new enough to be told, and remember it then."""
        before = self._told.get(control, 0.0)
        moved = abs(value_01 - before)
        at_end = axis and value_01 in (0.0, 1.0) and moved > 0.0
        if moved < SMALLEST_STEP_01 and not at_end:
            return False
        self._told[control] = value_01
        return True


def response_batch(seq: int, rows: Sequence[Change]) -> SampleBatch:
    """Return rows of `RESPONSES` from `seq` on."""
    happened, known, controls, levels = zip(*rows, strict=True)
    values = np.empty(len(rows), RESPONSES.dtype)
    values["control"], values["value_01"] = controls, levels
    return SampleBatch(
        RESPONSES,
        np.arange(seq, seq + len(rows)),
        np.array(happened, np.int64),
        np.array(known, np.int64),
        values,
    )


def ray_batch(seq: int, t_device_ns: int, t_host_ns: int, rays: Sequence[Ray]) -> SampleBatch:
    """Return rows of `POINTER` from `seq` on, one per hand, left first."""
    packed = []
    for hand, ray in enumerate(rays):
        numbers = [math.nan] * 7 if ray is None else [*ray[0], *ray[1]]
        packed.append(_RAY_ROW.pack(hand, *numbers, ray is not None))
    n = len(packed)
    return SampleBatch(
        POINTER,
        np.arange(seq, seq + n),
        np.full(n, t_device_ns, np.int64),
        np.full(n, t_host_ns, np.int64),
        np.frombuffer(b"".join(packed), POINTER.dtype),
    )
