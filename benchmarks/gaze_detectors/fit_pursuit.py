"""Fit the weights that tell pursuit from fixation, on half the clips of GazeCom.

    python -m benchmarks.gaze_detectors.fit_pursuit FOLDER -o FILE

FOLDER holds the set as tables (see `benchmarks.gaze_detectors.sets`). Fitted are the clips that
`is_tuned_on` names, every second by name, each recording once as it is and once with noise of a
random level and at 1, 1/2 or 1/4 of its rate. FILE is what `visavis.analysis.gaze.movements` ships.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from benchmarks.gaze_detectors.sets import SETS, TUNING_SET, Recording, is_tuned_on
from visavis.analysis.gaze.movements.detect import runs_between_saccades
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import MovementParameters
from visavis.analysis.gaze.movements.pursuit import PursuitWeights, rows_with_features
from visavis.lab.geometry import Vector, unit

UNITS, ROUNDS, BATCH, RATE = 8, 15, 2048, 3e-3


def shaken(recording: Recording, noise_deg: float, step: int, draw: int) -> Recording:
    """Return every step-th sample with white noise of this spread per axis, its labels thinned."""
    v = recording.direction[::step]
    noise = np.random.default_rng([11, draw]).normal(0, np.radians(noise_deg), v.shape)
    by = {
        who: replace(x, movement=x.movement[::step]) for who, x in recording.by.items()
    }  # events are not needed
    return Recording(recording.name, recording.t_ns[::step], unit(v + noise), by)


def samples(recording: Recording) -> tuple[Vector, Vector]:
    """Return features (m, f) of rows labelled fixation or pursuit, and 1 for pursuit (m,)."""
    t_ns, v, runs, step_ns = runs_between_saccades(
        recording.t_ns, recording.direction, MovementParameters()
    )
    rows, _, features = rows_with_features(t_ns, v, runs, step_ns)
    (labelling,) = recording.by.values()
    label = labelling.movement[rows]
    known = (label == Movement.FIXATION) | (label == Movement.PURSUIT)
    return features[known], (label[known] == Movement.PURSUIT).astype(float)


def fitted(features: Vector, is_pursuit: Vector, seed: int = 0) -> PursuitWeights:
    """Minimise the cross entropy by Adam steps whose size falls along a half cosine."""
    rng = np.random.default_rng(seed)
    mean, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
    x_all = (features - mean) / spread
    count, f = x_all.shape
    inner = rng.normal(0, 1 / np.sqrt(f), (f, UNITS))
    outer = rng.normal(0, 1 / np.sqrt(UNITS), UNITS)
    weights = [inner, np.zeros(UNITS), outer, np.zeros(1)]
    first = [np.zeros_like(w) for w in weights]
    second = [np.zeros_like(w) for w in weights]
    done = 0
    for turn in range(ROUNDS):
        size = RATE * 0.5 * (1 + np.cos(np.pi * turn / ROUNDS))
        order = rng.permutation(count)
        for begin in range(0, count, BATCH):
            rows = order[begin : begin + BATCH]
            x = x_all[rows]
            hidden = np.tanh(x @ weights[0] + weights[1])
            odds = hidden @ weights[2] + weights[3]
            error = (1 / (1 + np.exp(-odds)) - is_pursuit[rows]) / len(rows)
            back = np.outer(error, weights[2]) * (1 - hidden**2)
            slopes = [x.T @ back, back.sum(axis=0), hidden.T @ error, error.sum(keepdims=True)]
            done += 1
            for w, g, m, v in zip(weights, slopes, first, second, strict=True):
                m += 0.1 * (g - m)
                v += 0.001 * (g * g - v)
                w -= size * (m / (1 - 0.9**done)) / (np.sqrt(v / (1 - 0.999**done)) + 1e-8)
    return PursuitWeights(mean, spread, *weights)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit and write the weights; return 1 when the folder lacks the set."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    recordings = [r for r in SETS[TUNING_SET](options.folder) if is_tuned_on(TUNING_SET, r)]
    if not recordings:
        print(f"{options.folder}: no data_gazecom/CLIP/*.csv files")
        return 1
    rng = np.random.default_rng(5)
    parts = []
    for number, recording in enumerate(recordings):
        noise_deg, step = 10 ** rng.uniform(-1.6, -0.2), int(rng.choice([1, 1, 2, 4]))
        parts += [samples(recording), samples(shaken(recording, noise_deg, step, number))]
    weights = fitted(np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]))
    np.savez(options.out, **asdict(weights))
    print(f"{options.out}: fitted on {len(recordings)} recordings")
    return 0


if __name__ == "__main__":
    sys.exit(main())
