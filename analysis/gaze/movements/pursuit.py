"""Tell smooth pursuit from fixation between saccades, by how steadily gaze drifts.

Each row is described by speed and straightness of gaze in windows around it, of its whole run
between two saccades, and by how far the runs before and after drift the same way. A small
network (8 units) weighs these; a change between fixation and pursuit within a run must be worth
its price, so single rows do not flicker. The weights were fitted on every second clip, by name,
of GazeCom (Startsev, Agtzidis & Dorr 2019), with and without added noise and at a half and a
quarter of its rate; `python -m benchmarks.gaze_detectors.fit_pursuit` repeats that.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.movements.pursuit_kernels import cheapest_path, drift_features
from visavis.analysis.gaze.movements.velocity import Rows
from visavis.analysis.gaze.stamps import Times
from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector
from visavis.lab.plain_files import read_arrays

WINDOWS_MS = (60, 120, 250, 500)
TRIM_MS = 15
"""Left out at both ends of a run, where saccades begin and end."""
EVERY_MS = 16
WEIGHTS_FILE = "pursuit_weights.npz"


@dataclass(frozen=True, slots=True)
class PursuitWeights:
    """The fitted network: features are (x − `mean`) / `spread`, then tanh(· `inner` + `offset`)
    · `outer` + `bias` is the log odds of pursuit.
    """

    mean: Vector
    spread: Vector
    inner: Vector
    offset: Vector
    outer: Vector
    bias: Vector


@cache
def fitted_weights() -> PursuitWeights:
    """Return the weights that ship with the package."""
    return PursuitWeights(**read_arrays(Path(__file__).with_name(WEIGHTS_FILE)))


def log_odds(features: Vector, weights: PursuitWeights) -> Vector:
    """Return (m,) log odds of pursuit of features (m, f)."""
    hidden_layer = np.tanh(
        (features - weights.mean) / weights.spread @ weights.inner + weights.offset
    )
    odds: Vector = hidden_layer @ weights.outer + weights.bias
    return odds


def rows_with_features(
    t_ns: Times, v: Vector, runs: Rows, step_ns: int
) -> tuple[Rows, Rows, Vector]:
    """Return rows about every `EVERY_MS` of the runs, the run of each, and their features."""
    return drift_features(
        t_ns,
        v,
        runs,
        TRIM_MS * NS_PER_MS,
        np.array(WINDOWS_MS, np.int64) * NS_PER_MS,
        max(1, round(EVERY_MS * NS_PER_MS / step_ns)),
    )


def is_pursuit(
    t_ns: Times, v: Vector, runs: Rows, step_ns: int, *, change_cost: float
) -> npt.NDArray[np.bool_]:
    """Return (n,) True for rows of runs (k, 2) during which gaze pursues."""
    out = np.zeros(len(t_ns), np.bool_)
    if len(runs):
        rows, of, features = rows_with_features(t_ns, v, runs, step_ns)
        odds = log_odds(features, fitted_weights())
        cheapest_path(rows, of, np.ascontiguousarray(runs), odds, change_cost, out)
    return out
