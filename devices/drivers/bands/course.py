"""The course of amplitudes on a band that the host drives; pure."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from visavis.devices.contracts import VibrationPattern


@dataclass(slots=True)
class Course:
    """A running course: amplitudes as a function of ns since `start_ns`, until `until_ns`."""

    start_ns: int
    until_ns: int
    amplitudes_at: Callable[[int], tuple[float, ...]]
    rates_hz: tuple[float, ...] | None
    changes: bool


def share_01(pattern: VibrationPattern, since_s: float) -> float:
    """Return a pattern's rate at a time as a share of its highest; 0 where `square` is off."""
    low_01 = pattern.low_hz / pattern.high_hz
    if pattern.name == "steady":
        return 1.0
    if pattern.name == "square":
        return 1.0 if (since_s * pattern.modulation_hz) % 1.0 < 0.5 else 0.0
    if pattern.name == "ramp":
        return low_01 + (1 - low_01) * min(1.0, since_s * 1000 / pattern.duration_ms)
    swing = math.sin(2 * math.pi * pattern.modulation_hz * since_s)
    return (1 + low_01) / 2 + (1 - low_01) / 2 * swing
