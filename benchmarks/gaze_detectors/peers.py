"""Other packages' detectors, as their authors set them, on the same recordings."""

import importlib.util
import warnings
from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

from analysis.gaze.movements.kinds import Movement
from benchmarks.gaze_detectors.sets import Labels, Recording
from lab.geometry import Vector

Detect = Callable[[Recording], Labels]


def _degrees(r: Recording) -> Vector:
    """Return (n, 2) degrees right and up."""
    x, y, z = r.direction.T
    return np.degrees(np.column_stack([np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))]))


def _rate_hz(r: Recording) -> float:
    return 1e9 / float(np.median(np.diff(r.t_ns)))


def _pymovements(r: Recording) -> Labels:
    import pymovements as pm

    seconds = (r.t_ns - r.t_ns[0]) / 1e9
    velocity = np.gradient(_degrees(r), seconds, axis=0)
    found = pm.events.ivt(
        velocities=velocity,
        timesteps=np.arange(len(seconds)),
        minimum_duration=max(1, round(0.1 * _rate_hz(r))),
    )
    return _labels(len(seconds), found.frame["onset"].to_numpy(), found.frame["offset"].to_numpy())


def _labels(n: int, first: Vector, last: Vector) -> Labels:
    out = np.zeros(n, np.int8)
    for a, b in zip(first, last, strict=True):
        out[int(a) : int(b) + 1] = Movement.FIXATION
    return out


REMODNAV_KINDS = {
    "FIXA": Movement.FIXATION, "SACC": Movement.SACCADE, "ISAC": Movement.SACCADE,
    "PURS": Movement.PURSUIT, "HPSO": Movement.OSCILLATION, "LPSO": Movement.OSCILLATION,
    "IHPS": Movement.OSCILLATION, "ILPS": Movement.OSCILLATION,
}  # fmt: skip


def _remodnav(r: Recording) -> Labels:
    from remodnav.clf import EyegazeClassifier

    rate = _rate_hz(r)
    place = _degrees(r)
    data = np.rec.fromarrays([place[:, 0], place[:, 1]], names="x,y")
    out = np.zeros(len(place), np.int8)
    classifier = EyegazeClassifier(px2deg=1.0, sampling_rate=rate)
    try:
        for event in classifier(classifier.preproc(data)):
            kind = REMODNAV_KINDS[event["label"]]
            out[round(event["start_time"] * rate) : round(event["end_time"] * rate)] = kind
    except (ValueError, IndexError, np.linalg.LinAlgError):
        out[:] = Movement.UNKNOWN  # the package fails on some recordings; that counts
    return out


def _i2mc(r: Recording) -> Labels:
    import I2MC

    place = _degrees(r)
    table = pd.DataFrame(
        {"time": (r.t_ns - r.t_ns[0]) / 1e6, "L_X": place[:, 0], "L_Y": place[:, 1]}
    )
    table = table.fillna(-1e4)
    try:
        found, *_ = I2MC.I2MC(
            table,
            {
                "xres": 60.0, "yres": 40.0, "missingx": -1e4, "missingy": -1e4,
                "freq": round(_rate_hz(r)), "scrSz": [], "disttoscreen": [],
            },
            logging=False,
        )  # fmt: skip
    except Exception as why:  # a peer's failure is a result, not ours to mend
        print(f"  I2MC failed on {r.name}: {why}")
        return np.zeros(len(place), np.int8)
    if not found:
        return np.zeros(len(place), np.int8)
    return _labels(len(place), found["start"], found["end"])


def _quiet(detect: Detect) -> Detect:
    def run(r: Recording) -> Labels:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return detect(r)

    return run


PEERS = {
    "pymovements I-VT": ("pymovements", _pymovements),
    "remodnav": ("remodnav", _remodnav),
    "i2mc package": ("I2MC", _i2mc),
}


def available_peers() -> Mapping[str, Detect]:
    """Return the peers that are installed; the others are named on the screen."""
    there = {name: _quiet(d) for name, (m, d) in PEERS.items() if importlib.util.find_spec(m)}
    for name in PEERS.keys() - there.keys():
        print(f"{name}: not installed (pip install visavis[peers])")
    return there
