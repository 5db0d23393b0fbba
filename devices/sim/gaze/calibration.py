"""Judge a calibration as a tracker can: did the eyes follow the reference targets?"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector, angle_deg, unit

MATCH_WITHIN_S = 0.034
MATCHES_NEEDED = 9
LARGEST_MEDIAN_DEG = 10.0
OPEN_EYE_01 = 0.5


class CalibrationJudge:
    """Collect eye states and references on the device's clock, then decide.

    The limits are this simulator's own: Capture fits a model and reports only success or a
    reason.
    """

    def __init__(self) -> None:
        self._stamps_s: list[float] = []
        self._looking: list[Vector] = []
        self._references: list[tuple[float, Vector]] = []

    def observe(
        self,
        stamps_s: Sequence[float],
        left: Vector,
        right: Vector,
        openness_01: npt.NDArray[np.float64],
    ) -> None:
        """Take true eye directions (n, 3) in the head frame; closed eyes do not count."""
        middle = unit(left + right)
        for stamp_s, direction, open_01 in zip(stamps_s, middle, openness_01, strict=True):
            if open_01 >= OPEN_EYE_01 and np.isfinite(direction).all():
                self._stamps_s.append(stamp_s)
                self._looking.append(direction)

    def add_references(self, rows: Iterable[Any]) -> None:
        """Take targets as sent: `mm_pos` in the scene camera's frame and `timestamp`."""
        for row in rows:
            try:
                x, y, z = (float(v) for v in row["mm_pos"])
                stamp_s = float(row["timestamp"])
            except (TypeError, KeyError, ValueError):
                continue  # too few usable ones make the verdict
            self._references.append((stamp_s, unit(np.array([x, -y, -z]))))

    def verdict(self) -> str | None:
        """Return why the calibration fails, or None when it succeeds."""
        if not self._stamps_s:
            return "Not enough pupil data available."
        order = np.argsort(self._stamps_s, kind="stable")
        stamps_s = np.array(self._stamps_s)[order]
        errors_deg = []
        for at_s, target in self._references:
            i = int(np.clip(np.searchsorted(stamps_s, at_s), 1, max(1, stamps_s.size - 1)))
            near = min((i - 1, min(i, stamps_s.size - 1)), key=lambda j: abs(stamps_s[j] - at_s))
            if abs(stamps_s[near] - at_s) <= MATCH_WITHIN_S:
                looking = self._looking[int(order[near])]
                errors_deg.append(float(angle_deg(looking, target)))
        if len(errors_deg) < MATCHES_NEEDED:
            return "Not enough reference data matched pupil data in time."
        if float(np.median(errors_deg)) > LARGEST_MEDIAN_DEG:
            return "Reference and pupil data do not fit one gaze model."
        return None
