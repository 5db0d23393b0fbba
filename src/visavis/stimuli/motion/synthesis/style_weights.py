"""Weights that blend example motions for any point of a space of adjectives or features.

Every example is a point; a linear fit says roughly how much of each belongs to a place, and radial
functions around the examples correct it, so that at an example its own weight is one and the
others' are none. Source: a study of walking styles by adjectives; radial functions after Rose,
Cohen and Bodenheimer (1998) and Sloan, Rose and Cohen (2001).
"""

from dataclasses import dataclass

import numpy as np

from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector

MIN_SPARE = 4
"""Examples beyond the dimensions without which raw weights reach several times their range."""


def b_spline(x: Vector) -> Vector:
    """Return the cubic B-spline of |x|: 2/3 at 0, 1/6 at 1, 0 from 2 on."""
    r = np.abs(x)
    near = 2.0 / 3.0 - r * r + 0.5 * r**3
    far = (2.0 - np.minimum(r, 2.0)) ** 3 / 6.0
    shape: Vector = np.where(r < 1.0, near, far)
    return shape


@dataclass(frozen=True, eq=False)
class StyleWeights:
    """A fit to examples (n, d): `linear` (d + 1, n), `radial` (n, n), `reach` (n,) of each."""

    examples: Vector
    linear: Vector
    radial: Vector
    reach: Vector

    @property
    def is_spare(self) -> bool:
        """Whether so few examples stand in so many dimensions that weights are unsteady."""
        n, d = self.examples.shape
        return bool(n < d + MIN_SPARE)

    @property
    def condition(self) -> float:
        """Condition number of the radial functions' matrix: how far errors can grow in the fit."""
        distance = np.linalg.norm(self.examples[:, None] - self.examples, axis=-1)
        return float(np.linalg.cond(b_spline(distance / self.reach)))

    def raw(self, points: Vector) -> Vector:
        """Return weights (..., n) at points (..., d) as fitted; they may be below 0 or above 1."""
        p = np.asarray(points, dtype=np.float64)
        distance = np.linalg.norm(p[..., None, :] - self.examples, axis=-1) / self.reach
        weights: Vector = self.linear[0] + p @ self.linear[1:] + b_spline(distance) @ self.radial
        return weights

    def at(self, points: Vector) -> Vector:
        """Return weights (..., n) at points (..., d): between 0 and 1, summing to 1.

        Where no example has any weight, the nearest one (the first of several) has all of it.

        Raises:
            DataError: a point is not finite.
        """
        p = np.asarray(points, dtype=np.float64)
        if not np.isfinite(p).all():
            raise DataError("a requested point is not a number; give finite parameters")
        clipped_01 = np.clip(self.raw(p), 0.0, 1.0)
        total = clipped_01.sum(axis=-1, keepdims=True)
        nearest = np.argmin(np.linalg.norm(p[..., None, :] - self.examples, axis=-1), axis=-1)
        alone = np.eye(len(self.examples))[nearest]
        weights: Vector = np.where(total > 0, clipped_01 / np.where(total > 0, total, 1.0), alone)
        return weights


def fit_weights(examples: Vector) -> StyleWeights:
    """Fit weights to examples (n, d), to be made anew when the space or the examples change.

    Raises:
        DataError: fewer than two examples, two at one place, or a number is not finite.
    """
    points = np.asarray(examples, dtype=np.float64)
    if points.ndim != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise DataError(f"examples of shape {points.shape}; give at least two finite rows")
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    np.fill_diagonal(distance, np.inf)
    reach: Vector = distance.min(axis=0)
    if not (reach > 0).all():
        row = int(np.argmin(reach))
        raise DataError(f"example {row + 1} is at the same point as another; move or drop one")
    np.fill_diagonal(distance, 0.0)
    own = np.eye(len(points))
    basis = np.column_stack([np.ones(len(points)), points])
    linear = np.asarray(np.linalg.lstsq(basis, own, rcond=None)[0], dtype=np.float64)
    radial = np.asarray(np.linalg.solve(b_spline(distance / reach), own - basis @ linear))
    return StyleWeights(points, linear, radial, reach)
