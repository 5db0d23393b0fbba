"""Judge a headset calibration as Pupil Capture does: it finds how the eyes turn to the targets.

Capture multiplies `mm_pos` by (1, -1, s) and takes what comes out as its world (x right, y down, z
forward), so targets belong to it y up and z forward. It fits the eyes' rotations and answers
success even for mirrored targets, which no rotation fits: gaze is then turned half round the line
of sight. Source: tests/reference/devices/pupil_hmd_calibration.json.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, angle_deg, unit
from visavis.lab.rotation_fit import fit_turn

MATCH_WITHIN_S = 0.034
MATCHES_NEEDED = 9
MAX_MEDIAN_DEG = 10.0
MAX_OF_SPREAD_01 = 0.8
"""Largest residual as a share of the targets' spread; eyes that did not move leave all of it."""
MAX_UNTURNED_DEG = 10.0
"""A smaller rotation lies within the error that is drawn for every fit of the headset."""
OPEN_EYE_01 = 0.5


@dataclass(frozen=True)
class CalibrationFound:
    """Why a calibration failed, or None, and the matrix (3, 3) by which it turns gaze, if any."""

    reason: str | None
    turn: Vector | None = None


class CalibrationJudge:
    """Collect eye states and references on the device's clock, then decide.

    The limits are this simulator's own.
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
        """Take targets as sent: `mm_pos`, with y up and z forward, and `timestamp`."""
        for row in rows:
            try:
                x, y, z = (float(v) for v in row["mm_pos"])
                stamp_s = float(row["timestamp"])
            except (TypeError, KeyError, ValueError):
                continue  # too few usable ones make the verdict
            self._references.append((stamp_s, unit(np.array([x, y, -z]))))

    def verdict(self) -> CalibrationFound:
        """Return Capture's answer and the matrix by which it turns gaze from then on."""
        if not self._stamps_s:
            return CalibrationFound("Not enough pupil data available.")
        order = np.argsort(self._stamps_s, kind="stable")
        stamps_s = np.array(self._stamps_s)[order]
        looking, targets = [], []
        for at_s, target in self._references:
            i = int(np.clip(np.searchsorted(stamps_s, at_s), 1, max(1, stamps_s.size - 1)))
            near = min((i - 1, min(i, stamps_s.size - 1)), key=lambda j: abs(stamps_s[j] - at_s))
            if abs(stamps_s[near] - at_s) <= MATCH_WITHIN_S:
                looking.append(self._looking[int(order[near])])
                targets.append(target)
        if len(looking) < MATCHES_NEEDED:
            return CalibrationFound("Not enough reference data matched pupil data in time.")
        measured_rays, target_rays = np.array(looking), np.array(targets)
        fit = fit_turn(measured_rays, target_rays, may_mirror=True)
        ahead = unit(target_rays.sum(axis=0))
        spread_deg = float(np.median(angle_deg(target_rays, ahead)))
        left_deg = float(np.median(fit.residual_deg))
        if left_deg > min(MAX_MEDIAN_DEG, MAX_OF_SPREAD_01 * spread_deg):
            return CalibrationFound("Reference and pupil data do not fit one gaze model.")
        if fit.is_mirrored:
            return CalibrationFound(None, 2.0 * np.outer(ahead, ahead) - np.eye(3))
        return CalibrationFound(None, fit.matrix if fit.angle_deg > MAX_UNTURNED_DEG else None)
