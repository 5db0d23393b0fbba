"""Compare the fixation detectors with two human coders on the Lund2013 images.

    python -m benchmarks.gaze_detectors FOLDER [--json]

FOLDER holds the `*_labelled_MN.mat` and `*_labelled_RA.mat` files of Andersson et al. (2017),
which are not part of Visavis (GPL). Each row is the mean over the two raters; the ratio is to
the other human measured in the same run (at the same rate), or to the limit where it says so.
Added noise is white, given as RMS from sample to sample, and the mean of three draws is shown.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.io import loadmat

from analysis.gaze.events import (
    IDT_HEADSET,
    IVT_HEADSET,
    IVT_MOVING_HEAD,
    Fixations,
    detect_idt,
    detect_ivt,
)
from lab.clock import cpu_time_s
from lab.geometry import Vector

FIXATION = 1
RATERS = ("MN", "RA")
NOISE_DRAWS = (1, 2, 3)
SPEED_LIMIT_PER_S = 1e6
SPEED_SAMPLES = 2_000_000
LIMITS = {
    "500 Hz": {"kappa": 0.74, "F1": 0.91},
    "125 Hz": {"kappa": 0.76, "F1": 0.915},
    "125 Hz + 0.25°": {"F1": 0.88},
    "125 Hz + 0.5°": {"F1": 0.85},
    "125 Hz + 1.0°": {"F1": 0.79},
}

Labels = npt.NDArray[np.bool_]
Detector = Callable[[npt.NDArray[np.int64], Vector], Fixations]


DETECTORS: dict[str, Detector] = {
    "IVT_SCREEN": detect_ivt,
    "IVT_HEADSET": partial(detect_ivt, params=IVT_HEADSET),
    "IVT_MOVING_HEAD": partial(detect_ivt, params=IVT_MOVING_HEAD),
    "IDT_SCREEN": detect_idt,
    "IDT_HEADSET": partial(detect_idt, params=IDT_HEADSET),
}
"""Every preset by its name in `analysis.gaze.events`."""
LIMITED = "IVT_SCREEN"
"""The preset that `LIMITS` hold for."""


@dataclass(frozen=True)
class Recording:
    """One recording as one rater labelled it."""

    name: str
    rater: str
    t_ns: npt.NDArray[np.int64]
    direction: Vector
    is_fixation: Labels


def read_lund(path: Path) -> Recording:
    """Read one labelled file; pixel positions become unit vectors from the viewing distance."""
    data = loadmat(path, squeeze_me=True, struct_as_record=False)["ETdata"]
    pixel = np.asarray(data.pos[:, 3:5], float)
    lost = (pixel == 0).all(axis=1) | ~np.isfinite(pixel).all(axis=1)
    centred = (pixel - np.asarray(data.screenRes, float) / 2) * (
        np.asarray(data.screenDim, float) / np.asarray(data.screenRes, float)
    )
    ray = np.column_stack([centred[:, 0], -centred[:, 1], np.full(len(pixel), -data.viewDist)])
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    ray[lost] = np.nan
    name, _, rater = path.stem.rpartition("_labelled_")
    t_ns = np.rint(np.arange(len(pixel)) * 1e9 / float(data.sampFreq)).astype(np.int64)
    return Recording(name, rater, t_ns, ray, data.pos[:, 5] == FIXATION)


def thinned(recording: Recording, step: int) -> Recording:
    """Keep every step-th sample."""
    r = recording
    return Recording(r.name, r.rater, r.t_ns[::step], r.direction[::step], r.is_fixation[::step])


def noisy(recording: Recording, rms_s2s_deg: float, draw: int) -> Recording:
    """Add white noise of this RMS sample to sample, the same for both raters of a recording."""
    if rms_s2s_deg == 0:
        return recording
    rng = np.random.default_rng([draw, *recording.name.encode()])
    sd = np.radians(rms_s2s_deg) / 2
    x, y, z = recording.direction.T
    azimuth, elevation = np.arctan2(x, -z), np.arcsin(y)
    noise = rng.normal(0, sd, (2, max(len(x), 10_000)))[:, : len(x)]
    azimuth, elevation = azimuth + noise[0] / np.cos(elevation), elevation + noise[1]
    shaken = np.column_stack(
        [
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
            -np.cos(azimuth) * np.cos(elevation),
        ]
    )
    return Recording(recording.name, recording.rater, recording.t_ns, shaken, recording.is_fixation)


def runs_of(labels: Labels) -> npt.NDArray[np.int64]:
    """Return (k, 2) first row and row after the last of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], labels, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def matched(a: npt.NDArray[np.int64], b: npt.NDArray[np.int64]) -> int:
    """Count pairs of runs with intersection over union of at least a half, one to one.

    A run can meet at most one disjoint run by more than half of the union; ties at exactly a
    half are taken once.
    """
    pairs = 0
    taken = -1
    for first, end in a:
        for j in range(taken + 1, len(b)):
            if b[j, 0] >= end:
                break
            common = min(end, b[j, 1]) - max(first, b[j, 0])
            if common > 0 and 2 * common >= max(end, b[j, 1]) - min(first, b[j, 0]):
                pairs, taken = pairs + 1, j
                break
    return pairs


@dataclass(frozen=True)
class Agreement:
    """How two labellings of the same samples agree."""

    kappa: float
    f1: float
    count_ratio: float


def agreement(
    reference: Sequence[Labels],
    other: Sequence[Labels],
    reference_runs: Sequence[npt.NDArray[np.int64]],
    other_runs: Sequence[npt.NDArray[np.int64]],
) -> Agreement:
    """Return Cohen's kappa over pooled samples, event F1 and the ratio of event counts."""
    a, b = np.concatenate(reference), np.concatenate(other)
    observed = (a == b).mean()
    chance = a.mean() * b.mean() + (1 - a.mean()) * (1 - b.mean())
    pairs = sum(matched(x, y) for x, y in zip(reference_runs, other_runs, strict=True))
    n_a, n_b = sum(map(len, reference_runs)), sum(map(len, other_runs))
    return Agreement((observed - chance) / (1 - chance), 2 * pairs / (n_a + n_b), n_b / n_a)


def averaged(each: Sequence[Agreement]) -> Agreement:
    """Return the mean of several agreements."""
    kappa, f1, ratio = np.mean([[e.kappa, e.f1, e.count_ratio] for e in each], axis=0)
    return Agreement(float(kappa), float(f1), float(ratio))


def against_humans(recordings: Sequence[Recording], detect: Detector) -> Agreement:
    """Return a detector's agreement with the two raters, averaged."""
    each = []
    for rater in RATERS:
        own = [r for r in recordings if r.rater == rater]
        found = [detect(r.t_ns, r.direction) for r in own]
        each.append(
            agreement(
                [r.is_fixation for r in own],
                [f.in_fixation for f in found],
                [runs_of(r.is_fixation) for r in own],
                [np.column_stack([f.first_row, f.last_row + 1]) for f in found],
            )
        )
    return averaged(each)


def between_humans(recordings: Sequence[Recording]) -> Agreement:
    """Return the raters' agreement with each other, over the samples both labelled."""
    by = {(r.rater, r.name): r.is_fixation for r in recordings}
    names = sorted({r.name for r in recordings})
    one, two = [], []
    for name in names:
        a, b = by[RATERS[0], name], by[RATERS[1], name]
        n = min(len(a), len(b))
        one.append(a[:n])
        two.append(b[:n])
    return agreement(one, two, [runs_of(x) for x in one], [runs_of(x) for x in two])


def samples_per_cpu_s(recordings: Sequence[Recording], detect: Detector) -> float:
    """Return the speed over the recordings, again and again, until the clock can tell."""
    done, began_s = 0, cpu_time_s()
    while done < SPEED_SAMPLES:
        for r in recordings:
            detect(r.t_ns, r.direction)
            done += len(r.t_ns)
    return done / (cpu_time_s() - began_s)


def rows_of(recordings: Sequence[Recording]) -> list[dict[str, object]]:
    """Return every figure: name, value, unit, what it is measured against, ratio."""
    rows: list[dict[str, object]] = []

    def add(name: str, value: float, unit: str, against: str, reference: float) -> None:
        rows.append(
            {
                "name": name,
                "value": round(float(value), 4),
                "unit": unit,
                "against": against,
                "reference": round(float(reference), 4),
                "ratio": round(float(value / reference), 4),
            }
        )

    conditions = [
        ("500 Hz", 1, 0.0), ("250 Hz", 2, 0.0), ("125 Hz", 4, 0.0), ("62.5 Hz", 8, 0.0),
        *((f"125 Hz + {noise}°", 4, noise) for noise in (0.25, 0.5, 1.0)),
    ]  # fmt: skip
    for label, step, noise in conditions:
        draws = [
            [noisy(thinned(r, step), noise, draw) for r in recordings]
            for draw in (NOISE_DRAWS if noise else NOISE_DRAWS[:1])
        ]
        human = between_humans(draws[0])
        for name, detect in DETECTORS.items():
            got = averaged([against_humans(data, detect) for data in draws])
            what = f"{name}, {label}"
            add(f"{what}: kappa", got.kappa, "1", "other human", human.kappa)
            add(f"{what}: event F1", got.f1, "1", "other human", human.f1)
            add(f"{what}: events / human's", got.count_ratio, "1", "human", 1.0)
            if name == LIMITED:
                for measure, limit in LIMITS.get(label, {}).items():
                    value = got.kappa if measure == "kappa" else got.f1
                    add(f"{what}: {measure} against limit", value, "1", "limit", limit)
            if noise == 0.0:
                speed = samples_per_cpu_s(draws[0], detect)
                add(f"{what}: speed", speed, "samples/CPU s", "limit", SPEED_LIMIT_PER_S)
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed or the folder holds no recording."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    paths = sorted(options.folder.rglob("*_labelled_*.mat"))
    if not paths:
        print(f"{options.folder}: no *_labelled_*.mat files; give the Lund2013 folder")
        return 1
    rows = rows_of([read_lund(path) for path in paths])
    if options.json:
        print(json.dumps(rows, indent=1, ensure_ascii=False))
    else:
        for row in rows:
            print(
                f"{row['name']:<46} {row['value']:>14,} {row['unit']:<14}"
                f"{row['against']:>12} {row['reference']:>12,} ratio {row['ratio']:.3f}"
            )
    missed = [
        r
        for r in rows
        if r["against"] == "limit"
        and float(str(r["ratio"])) < 1
        and str(r["name"]).startswith(LIMITED)
    ]
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
