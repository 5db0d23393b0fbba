"""What a device may say of itself: places, rates, clocks and sizes within bounds.

A number beyond its bounds is a misreading (another unit, another encoding, a defect). It is refused
and both numbers are named: the one that was said, and the bounds or what was counted instead.
"""

from collections import deque
from dataclasses import dataclass
from statistics import median

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector

MAX_FAR_M = 1000.0


def is_place(x: float, y: float, z: float) -> bool:
    """Tell whether a position (m) is plausible; NaN and infinity are not."""
    return abs(x) <= MAX_FAR_M and abs(y) <= MAX_FAR_M and abs(z) <= MAX_FAR_M


def are_places(position_m: Vector) -> npt.NDArray[np.bool_]:
    """Tell which positions, shape (..., 3), are plausible; shape (...)."""
    return np.asarray((np.abs(position_m) <= MAX_FAR_M).all(axis=-1))


@dataclass(frozen=True)
class Bounds:
    """The least and the most that a device can mean by a number it states of itself."""

    lowest: float
    highest: float
    unit: str

    def admit(self, value: float) -> bool:
        """Tell whether a number is plausible; NaN and infinity are not."""
        return self.lowest <= value <= self.highest

    def sentence(self, what: str, value: float) -> str:
        """Return the sentence that names the number and the bounds."""
        bounds = f"{self.lowest:g} to {self.highest:g} {self.unit}"
        return f"{what} is said to be {value:.9g} {self.unit}, but can only be {bounds}"


TICKS_PER_S = Bounds(1e3, 1e10, "ticks/s")
"""From milliseconds to a processor's own cycles."""

SAMPLES_PER_S = Bounds(0.01, 200_000.0, "Hz")
"""From a temperature every minute and a half to sound."""

SCREEN_SIDE_MM = Bounds(30.0, 10_000.0, "mm")
"""From a telephone to a wall."""

PUPIL_MM = Bounds(1.0, 10.0, "mm")
"""From the narrowest in bright light to the widest of a dilated eye."""

VIBRATION_HZ = Bounds(1.0, 1000.0, "Hz")
"""What skin feels as vibration."""

BLOCK_NS = NS_PER_S
BLOCKS = 9
MIN_BLOCKS = 3
MAX_PACE_ERROR_01 = 0.05
"""More than any oscillator is off, less than two units ever differ by."""


class ClockPace:
    """How many seconds a device's clock counts in a second of the host's, by its samples.

    The median over the last blocks of at least a second, so that a jump of the clock or a stretch
    that was held back on its way does not count.
    """

    def __init__(self) -> None:
        self._paces: deque[float] = deque(maxlen=BLOCKS)
        self._start: tuple[int, int] | None = None

    def add(self, t_device_ns: int, t_host_ns: int) -> None:
        """Take the device's stamp of a sample and its arrival."""
        if self._start is None:
            self._start = (t_device_ns, t_host_ns)
            return
        passed_ns = t_host_ns - self._start[1]
        if passed_ns >= BLOCK_NS:
            self._paces.append((t_device_ns - self._start[0]) / passed_ns)
            self._start = (t_device_ns, t_host_ns)

    def restart(self) -> None:
        """Forget everything, as after the device was away."""
        self._paces.clear()
        self._start = None

    def wrong(self) -> float | None:
        """Return the device's seconds per second of the host where they are wrong, else None."""
        if len(self._paces) < MIN_BLOCKS:
            return None
        pace = median(self._paces)
        return pace if abs(pace - 1) > MAX_PACE_ERROR_01 else None
