"""Fit the turn that leads one set of directions to another (orthogonal Procrustes)."""

from dataclasses import dataclass

import numpy as np

from visavis.lab.geometry import Vector, angle_deg


@dataclass(frozen=True)
class FittedTurn:
    """The orthogonal matrix (3, 3) that leads `start` to `end` best, by least squares.

    `residual_deg` (n,) is what is left of every pair; a mirroring has determinant −1.
    """

    matrix: Vector
    residual_deg: Vector

    @property
    def is_mirrored(self) -> bool:
        """Return whether only a reflection fits, not a rotation."""
        return bool(np.linalg.det(self.matrix) < 0)

    @property
    def angle_deg(self) -> float:
        """The angle of the rotation, degrees; of a mirroring the one that comes after it."""
        cosine = (float(np.trace(self.matrix)) - (-1.0 if self.is_mirrored else 1.0)) / 2
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def fit_turn(start: Vector, end: Vector, *, may_mirror: bool = False) -> FittedTurn:
    """Fit the turn between pairs of unit directions (n, 3), by Kabsch's solution.

    It is a rotation unless `may_mirror`. Directions that all lie in one plane leave a mirroring
    across that plane undecided, a single direction any turn about itself.
    """
    u, _, vt = np.linalg.svd(end.T @ start)
    if not may_mirror and np.linalg.det(u @ vt) < 0:
        u[:, -1] *= -1
    matrix: Vector = u @ vt
    return FittedTurn(matrix, angle_deg(start @ matrix.T, end))
