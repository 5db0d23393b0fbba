"""Compare the fixation detectors with two people on the Lund2013 images, by rate and noise.

    python -m benchmarks.gaze_detectors.rates FOLDER [--json]

FOLDER holds the `lund images` of `benchmarks.gaze_detectors.sets`. Each row is the mean over the
two raters; the ratio is to the other person measured in the same run (at the same rate), or to
the limit where it says so. Added noise is white, given as RMS from sample to sample, and the mean
of three draws is shown.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.gaze_detectors.agreement import Agreement, agreement, averaged
from benchmarks.gaze_detectors.sets import RATERS, SETS, Recording, labelling_of
from visavis.analysis.gaze.events import (
    IDT_HEADSET,
    IVT_HEADSET,
    IVT_MOVING_HEAD,
    Fixations,
    detect_idt,
    detect_ivt,
)
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement, fixations_of
from visavis.analysis.gaze.movements.parameters import AUTO
from visavis.lab.clock import cpu_time_s
from visavis.lab.geometry import Vector

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

Detector = Callable[[npt.NDArray[np.int64], Vector], Fixations]


def _auto(t_ns: npt.NDArray[np.int64], direction: Vector) -> Fixations:
    return fixations_of(detect_movements(t_ns, direction, AUTO))


DETECTORS: dict[str, Detector] = {
    "auto": _auto,
    "IVT_SCREEN": detect_ivt,
    "IVT_HEADSET": partial(detect_ivt, params=IVT_HEADSET),
    "IVT_MOVING_HEAD": partial(detect_ivt, params=IVT_MOVING_HEAD),
    "IDT_SCREEN": detect_idt,
    "IDT_HEADSET": partial(detect_idt, params=IDT_HEADSET),
}
"""Every preset by its name in `visavis.analysis.gaze.events`."""
LIMITED = "IVT_SCREEN"
"""The preset that `LIMITS` hold for."""


def thinned(recording: Recording, step: int) -> Recording:
    """Keep every step-th sample."""
    by = {who: labelling_of(labelling.movement[::step]) for who, labelling in recording.by.items()}
    return replace(
        recording,
        t_ns=recording.t_ns[::step],
        direction=recording.direction[::step],
        by=by,
    )


def noisy(recording: Recording, rms_s2s_deg: float, draw: int) -> Recording:
    """Add white noise of this RMS sample to sample."""
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
    return replace(recording, direction=shaken)


def against_humans(recordings: Sequence[Recording], detect: Detector) -> Agreement:
    """Return a detector's agreement with the two raters, averaged."""
    found = [detect(r.t_ns, r.direction) for r in recordings]
    each = []
    for rater in RATERS:
        own = [r.by[rater] for r in recordings]
        each.append(
            agreement(
                [x.movement == Movement.FIXATION for x in own],
                [f.in_fixation for f in found],
                [x.fixations for x in own],
                [np.column_stack([f.first_row, f.last_row + 1]) for f in found],
            )
        )
    return averaged(each)


def between_humans(recordings: Sequence[Recording]) -> Agreement:
    """Return the raters' agreement with each other."""
    one, two = ([r.by[rater] for r in recordings] for rater in RATERS)
    return agreement(
        [x.movement == Movement.FIXATION for x in one],
        [x.movement == Movement.FIXATION for x in two],
        [x.fixations for x in one],
        [x.fixations for x in two],
    )


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
        ("500 Hz", 1, 0.0),
        ("250 Hz", 2, 0.0),
        ("125 Hz", 4, 0.0),
        ("62.5 Hz", 8, 0.0),
        *((f"125 Hz + {noise}°", 4, noise) for noise in (0.25, 0.5, 1.0)),
    ]
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
    recordings = list(SETS["lund images"](options.folder))
    if not recordings:
        print(f"{options.folder}: no *_img_*_labelled_*.mat files; give the Lund2013 folder")
        return 1
    rows = rows_of(recordings)
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
