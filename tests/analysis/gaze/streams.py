"""Made-up gaze streams with known truth, for the tests of this folder."""

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg

ON, OTHER, OFF, LOST = 3, 5, -1, -2
TRIAL_NS = 16_000_000_000
TRIAL_ROWS = 1920


def stamps(n: int, rate_hz: float = 120.0, start_ns: int = 0) -> npt.NDArray[np.int64]:
    return start_ns + np.rint(np.arange(n) * 1e9 / rate_hz).astype(np.int64)


def trial(*runs: tuple[int, int, int]) -> npt.NDArray[np.int16]:
    """Areas of a 16 s trial at 120 Hz: off but for runs (first row, rows, area)."""
    areas = np.full(TRIAL_ROWS, OFF, np.int16)
    for first, rows, area in runs:
        areas[first : first + rows] = area
    return areas


def looks(
    targets_deg: list[tuple[float, float]], rows: list[int], *, saccade_rows: int = 5
) -> Vector:
    """Directions that rest on each target for its rows and move evenly in between."""
    yaw, pitch = [], []
    for k, ((y, p), n) in enumerate(zip(targets_deg, rows, strict=True)):
        if k:
            share = np.arange(1, saccade_rows + 1) / (saccade_rows + 1)
            before = targets_deg[k - 1]
            yaw.append(before[0] + share * (y - before[0]))
            pitch.append(before[1] + share * (p - before[1]))
        yaw.append(np.full(n, y))
        pitch.append(np.full(n, p))
    return direction_from_yaw_pitch_deg(np.concatenate(yaw), np.concatenate(pitch))


def shaken(direction: Vector, sd_deg: float, rng: np.random.Generator) -> Vector:
    noisy = direction + rng.normal(0, np.radians(sd_deg), direction.shape)
    return noisy / np.linalg.norm(noisy, axis=1, keepdims=True)
