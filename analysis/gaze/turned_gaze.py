"""Say whether gaze at the targets of a validation is mirrored or turned as a whole.

Wrong axes in a calibration leave every sample valid and precise and every direction wrong; what
gives them away is that one turn leads all targets to where gaze was measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from visavis.lab.geometry import Vector, angle_deg, unit
from visavis.lab.rotation_fit import fit_turn

MIN_TARGETS = 4
MIN_SPREAD_DEG = 3.0
MIN_ERROR_DEG = 3.0
MAX_LEFT_01 = 0.4
"""Share of the error that may remain when a turn is named as its cause."""
MIN_ROLL_DEG = 10.0
MIN_SHIFT_DEG = 5.0

Kind = Literal["mirrored", "rolled", "shifted"]


@dataclass(frozen=True)
class TurnedGaze:
    """How gaze as a whole is turned against the targets.

    `roll_deg` is about the line of sight, counter-clockwise as the participant sees it; `right_deg`
    and `up_deg` say where gaze at a target straight ahead lies. For mirrored gaze,
    `mirrored_across` is "left and right" or "up and down", whichever fits better. `left_deg` is
    the mean error that remains once the turn is taken back.
    """

    kind: Kind
    roll_deg: float
    right_deg: float
    up_deg: float
    mirrored_across: str
    left_deg: float

    def sentence(self) -> str:
        """Say it, with the likely cause."""
        if self.kind == "mirrored":
            return (
                f"gaze is mirrored ({self.mirrored_across} exchanged): an axis of the tracker's "
                "image or of the calibration targets is likely turned over"
            )
        if self.kind == "rolled":
            return (
                f"gaze is rotated by {abs(self.roll_deg):.0f}° about the line of sight: the "
                "calibration targets were likely sent with wrong axes, or a camera is mounted or "
                "set to be read turned"
            )
        return (
            f"gaze as a whole lies {abs(self.right_deg):.1f}° to the "
            f"{'right' if self.right_deg > 0 else 'left'} and {abs(self.up_deg):.1f}° too "
            f"{'high' if self.up_deg > 0 else 'low'}: the tracker likely sits turned on the head, "
            "or has slipped"
        )


def turned_gaze(aims: Sequence[Vector], gaze: Sequence[Vector]) -> TurnedGaze | None:
    """Return how gaze is turned; None when no turn explains its error.

    Takes, for each target, the way to it and the gaze at every sample (n, 3), unit vectors in the
    head's frame, NaN where lost. Also None for targets on one line, for fewer than four targets
    and for an error below 3°.
    """
    pairs = []
    for aim, samples in zip(aims, gaze, strict=True):
        is_usable = np.isfinite(samples).all(axis=-1)
        if is_usable.any():
            pairs.append((unit(aim[is_usable].sum(axis=0)), unit(samples[is_usable].sum(axis=0))))
    if len(pairs) < MIN_TARGETS:
        return None
    target_directions, gaze_directions = (np.array(part) for part in zip(*pairs, strict=True))
    error_deg = float(angle_deg(target_directions, gaze_directions).mean())
    if not error_deg >= MIN_ERROR_DEG or _narrowest_deg(target_directions) < MIN_SPREAD_DEG:
        return None
    turn = fit_turn(target_directions, gaze_directions, may_mirror=True)
    left_deg = float(turn.residual_deg.mean())
    if left_deg > MAX_LEFT_01 * error_deg:
        return None
    ahead = turn.matrix @ np.array([0.0, 0.0, -1.0])
    right_deg = float(np.degrees(np.arctan2(ahead[0], -ahead[2])))
    up_deg = float(np.degrees(np.arcsin(np.clip(ahead[1], -1.0, 1.0))))
    matrix = turn.matrix
    if turn.is_mirrored:
        across = "left and right" if matrix[0, 0] < matrix[1, 1] else "up and down"
        return TurnedGaze("mirrored", 0.0, right_deg, up_deg, across, left_deg)
    roll_deg = float(
        np.degrees(np.arctan2(matrix[1, 0] - matrix[0, 1], matrix[0, 0] + matrix[1, 1]))
    )
    if abs(roll_deg) >= MIN_ROLL_DEG:
        return TurnedGaze("rolled", roll_deg, right_deg, up_deg, "", left_deg)
    if np.hypot(right_deg, up_deg) >= MIN_SHIFT_DEG:
        return TurnedGaze("shifted", roll_deg, right_deg, up_deg, "", left_deg)
    return None


def _narrowest_deg(directions: Vector) -> float:
    """Return how far directions spread across the line along which they spread most."""
    _, spread, _ = np.linalg.svd(directions - directions.mean(axis=0))
    return float(np.degrees(spread[1] / np.sqrt(len(directions))))
