"""Adjectives told from motion features: ridge regression, each walk predicted from the rest."""

from typing import Final

import numpy as np

from visavis.lab.geometry import Vector

PENALTIES: Final = np.logspace(-1, 4, 26)
CONSTANT: Final = 1e-9


def left_out_r2(features: Vector, values: Vector) -> float:
    """Return R² of values (n,) predicted from features (n, d), every one from all the others.

    Features are standardised; the penalty is chosen inside each training set, by leaving one out
    there too, so that no walk has a say in its own prediction.
    """
    n = len(values)
    predictions = np.empty(n)
    for i in range(n):
        rest = np.arange(n) != i
        train, aim = features[rest], values[rest]
        centre, spread = train.mean(axis=0), train.std(axis=0)
        tells = spread > CONSTANT
        x = (train[:, tells] - centre[tells]) / spread[tells]
        x_out = (features[i, tells] - centre[tells]) / spread[tells]
        errors = [_left_out_errors(x, aim - aim.mean(), penalty) for penalty in PENALTIES]
        best = PENALTIES[int(np.argmin(errors))]
        slope = x.T @ np.linalg.solve(x @ x.T + best * np.eye(n - 1), aim - aim.mean())
        predictions[i] = aim.mean() + x_out @ slope
    total = ((values - values.mean()) ** 2).sum()
    return (
        float("nan") if total < CONSTANT else float(1 - ((values - predictions) ** 2).sum() / total)
    )


def _left_out_errors(x: Vector, y: Vector, penalty: float) -> float:
    """Return the mean square of errors of ridge regression where every row is left out in turn."""
    n = len(y)
    hat = x @ x.T @ np.linalg.inv(x @ x.T + penalty * np.eye(n)) + 1.0 / n
    return float((((y - hat @ y) / (1.0 - np.diag(hat))) ** 2).mean())
