"""Other packages' detectors on the same recordings, in every setting that is ordinary for them.

A package whose result hangs on how velocity is smoothed is tried with the usual ways; the table
shows the best of them for each set, which favours it.
"""

import importlib.util
import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from itertools import product

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

from benchmarks.gaze_detectors.sets import Labels, Recording
from benchmarks.gaze_detectors.smoothed import SMOOTHED
from benchmarks.gaze_detectors.smoothed import Detect as OfWorld
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.lab.geometry import Vector

Detect = Callable[[Recording], Labels]


SCREEN_CM, PIXELS_A_CM, MISSING = (80.0, 60.0), 40.0, -1e6
DEGREE_IS_CM_AT_CM = 57.3
"""A made-up screen for a package that asks for one."""


def _degrees(r: Recording) -> Vector:
    """Return (n, 2) degrees right and up."""
    x, y, z = r.direction.T
    place: Vector = np.degrees(np.column_stack([np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))]))
    return place


def _rate_hz(r: Recording) -> float:
    return 1e9 / float(np.median(np.diff(r.t_ns)))


PYMOVEMENTS_SMOOTHED_MS = (0, 20, 40, 60)
PYMOVEMENTS_DEG_S = (20.0, 30.0, 45.0)
MIN_S = 0.06


def _pymovements(r: Recording, *, window_ms: float, threshold_deg_s: float) -> Labels:
    """I-VT on velocity by five points (0 ms: its default) or by its Savitzky-Golay filter."""
    import pymovements as pm

    place, rate = _degrees(r), _rate_hz(r)
    velocity = np.full(place.shape, np.nan)
    width = round(window_ms / 1000 * rate) | 1
    if width >= 5:
        velocity = savgol_filter(place, width, 2, deriv=1, delta=1 / rate, axis=0, mode="nearest")
    else:
        velocity[2:-2] = (place[4:] + place[3:-1] - place[1:-3] - place[:-4]) * rate / 6
    found = pm.events.ivt(
        velocity, minimum_duration=round(MIN_S * rate), velocity_threshold=threshold_deg_s
    )
    return _labels(len(place), found.frame["onset"].to_numpy(), found.frame["offset"].to_numpy())


def _smoothed(r: Recording, *, detect: OfWorld) -> Labels:
    return detect(r.t_ns, r.direction)


def _labels(n: int, first: Vector, last: Vector) -> Labels:
    out = np.zeros(n, np.int8)
    for a, b in zip(first, last, strict=True):
        out[int(a) : int(b) + 1] = Movement.FIXATION
    return out


@cache
def _told(package: str, why: str) -> None:
    print(f"  {package} failed, counted as nothing found (told once): {why}")


def _tell(package: str, why: Exception) -> None:
    _told(package, f"{type(why).__name__}: {why}")


REMODNAV_KINDS = {
    "FIXA": Movement.FIXATION,
    "SACC": Movement.SACCADE,
    "ISAC": Movement.SACCADE,
    "PURS": Movement.PURSUIT,
    "HPSO": Movement.OSCILLATION,
    "LPSO": Movement.OSCILLATION,
    "IHPS": Movement.OSCILLATION,
    "ILPS": Movement.OSCILLATION,
}


REMODNAV_SMOOTHED_S = 0.019
"""The package's own; it refuses rates of which this is an even number of samples."""


def _remodnav(r: Recording) -> Labels:
    from remodnav.clf import EyegazeClassifier

    rate = _rate_hz(r)
    place = _degrees(r)
    out = np.zeros(len(place), np.int8)
    seen = np.flatnonzero(np.isfinite(place).all(axis=1))
    if not seen.size:
        return out
    first, end = int(seen[0]), int(seen[-1]) + 1  # it fails on losses at either end
    data = np.rec.fromarrays([*place[first:end].T], dtype=[("x", "f8"), ("y", "f8")])
    smoothed = max(3, 2 * int(REMODNAV_SMOOTHED_S * rate / 2) + 1)
    classifier = EyegazeClassifier(px2deg=1.0, sampling_rate=rate)
    try:
        for event in classifier(classifier.preproc(data, savgol_length=(smoothed + 0.5) / rate)):
            a, b = (first + round(event[name] * rate) for name in ("start_time", "end_time"))
            out[a:b] = REMODNAV_KINDS[event["label"]]
    except Exception as why:  # a peer's failure is a result, not ours to mend
        _tell("remodnav", why)
        out[:] = Movement.UNKNOWN
    return out


def _i2mc(r: Recording) -> Labels:
    import I2MC

    pixel = (_degrees(r) + np.array(SCREEN_CM) / 2) * PIXELS_A_CM
    table = pd.DataFrame(
        {"time": (r.t_ns - r.t_ns[0]) / 1e6, "L_X": pixel[:, 0], "L_Y": pixel[:, 1]}
    ).fillna(MISSING)
    options = {
        "xres": SCREEN_CM[0] * PIXELS_A_CM,
        "yres": SCREEN_CM[1] * PIXELS_A_CM,
        "missingx": MISSING,
        "missingy": MISSING,
        "freq": round(_rate_hz(r)),
        "scrSz": list(SCREEN_CM),
        "disttoscreen": DEGREE_IS_CM_AT_CM,
    }
    try:
        found, *_ = I2MC.I2MC(table, options, logging=False)
    except Exception as why:  # a peer's failure is a result, not ours to mend
        _tell("i2mc package", why)
        found = None
    if not found:
        return np.zeros(len(pixel), np.int8)
    return _labels(len(pixel), found["start"], found["end"])


def _quiet(detect: Detect) -> Detect:
    def run(r: Recording) -> Labels:
        logging.disable(logging.CRITICAL)  # thousands of lines, which would hide the table
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return detect(r)
        finally:
            logging.disable(logging.NOTSET)

    return run


PEERS: Mapping[str, tuple[str, Sequence[Detect]]] = {
    "pymovements I-VT": (
        "pymovements",
        [
            partial(_pymovements, window_ms=ms, threshold_deg_s=deg_s)
            for ms, deg_s in product(PYMOVEMENTS_SMOOTHED_MS, PYMOVEMENTS_DEG_S)
        ],
    ),
    "I-VT, smoothed": ("scipy", [partial(_smoothed, detect=d) for d in SMOOTHED.values()]),
    "remodnav": ("remodnav", [_remodnav]),
    "i2mc package": ("I2MC", [_i2mc]),
}
"""By name: the package it needs, and its ordinary settings."""


def available_peers() -> Mapping[str, Sequence[Detect]]:
    """Return the settings of peers that are installed; the others are named on the screen."""
    there = {
        name: [_quiet(d) for d in settings]
        for name, (module, settings) in PEERS.items()
        if importlib.util.find_spec(module)
    }
    for name in PEERS.keys() - there.keys():
        print(f"{name}: not installed (pip install visavis[peers])")
    return there
