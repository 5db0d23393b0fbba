"""Read the labelled sets of eye movements from a folder, as they are published.

None of them is part of Visavis; each has its own licence. They are recognised by their files:

- `lund images`, `lund dots`, `lund video`: Andersson et al. (2017), `*_labelled_MN.mat` and
  `*_labelled_RA.mat`, two raters, 500 Hz (a few files less);
- `hooge adults`, `hooge infants`: Hooge et al. (2018), `ETdata/*.txt` beside `coderSettings`,
  twelve coders of fixations, 300 Hz;
- `gazecom`: Startsev, Agtzidis & Dorr (2019) as tables `data_gazecom/CLIP/*.csv`, 250 Hz;
- `lookatpoint`: Zemblys, Niehorster, Komogortsev & Holmqvist (2018), `lookAtPoint_EL_S*.npy`,
  one expert, 1000 Hz;
- `hmr`: people with a head-mounted tracker before a moving target, as tables
  `data_hmr/USER/eye_*.csv` beside GazeCom's in elmadjian/OEMC, 200 Hz. Places are of the pupil in
  the camera's picture and not calibrated, so `HMR_DEG` is an estimate by how long saccades last
  (`benchmarks.gaze_detectors.hmr_scale`), and only comparisons count.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.io import loadmat

from benchmarks.gaze_detectors.agreement import Runs, runs_of
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.devices.drivers.pupil.codec import CONFIDENCE_THRESHOLD_01
from visavis.lab.geometry import Vector, unit

Labels = npt.NDArray[np.int8]

RATERS = ("MN", "RA")
HOOGE_PIXELS, HOOGE_CM, HOOGE_DISTANCE_CM = (1920, 1080), (50.9, 28.6), 65.0
GAZECOM_CM, GAZECOM_DISTANCE_CM, GAZECOM_RATE_HZ = (40.0, 22.5), 45.0, 250.0
GAZECOM_LABELS = {
    "F": Movement.FIXATION,
    "S": Movement.SACCADE,
    "P": Movement.PURSUIT,
    "B": Movement.BLINK,
}
HMR_DEG, HMR_RATE_HZ, HMR_CONFIDENCE_01 = 100.0, 200.0, CONFIDENCE_THRESHOLD_01
"""Degrees of the picture's width; rows below this confidence are lost, as in sessions."""
LOOKATPOINT_LABELS = (0, 1, 2, 3, 0, 5)


@dataclass(frozen=True)
class Labelling:
    """What one person labelled: a `Movement` per sample (n,), and the rows of fixations (k, 2)."""

    movement: Labels
    fixations: Runs


@dataclass(frozen=True)
class Recording:
    """One recording: stamps (n,), unit vectors with NaN where lost (n, 3), and its labellings."""

    name: str
    t_ns: npt.NDArray[np.int64]
    direction: Vector
    by: Mapping[str, Labelling]


def _stamps(n: int, rate_hz: float) -> npt.NDArray[np.int64]:
    stamps: npt.NDArray[np.int64] = np.rint(np.arange(n) * 1e9 / rate_hz).astype(np.int64)
    return stamps


def _directions(
    right: Vector, down: Vector, distance: float, lost: npt.NDArray[np.bool_]
) -> Vector:
    """Return unit vectors to points on a screen, measured from its middle."""
    ray: Vector = unit(np.column_stack([right, -down, np.full(len(right), -distance)]))
    ray[lost] = np.nan
    return ray


def labelling_of(movement: Labels) -> Labelling:
    """Return a labelling whose fixations are the runs of that kind."""
    return Labelling(movement, runs_of(movement == Movement.FIXATION))


def _lund(root: Path, task: str) -> Iterator[Recording]:
    paths = [
        p
        for p in sorted(root.rglob("*_labelled_*.mat"))
        if p.stem.rpartition("_labelled_")[2] in RATERS
        and not p.parts[-3].startswith("originally")
        and _lund_task(p) == task
    ]
    for name in sorted({p.stem.rpartition("_labelled_")[0] for p in paths}):
        by: dict[str, Labelling] = {}
        recording = None
        for path in (p for p in paths if p.stem.rpartition("_labelled_")[0] == name):
            recording = read_lund(path)
            by |= recording.by
        if recording is not None:
            n = min(len(b.movement) for b in by.values())
            by = {rater: labelling_of(b.movement[:n]) for rater, b in by.items()}
            yield Recording(name, recording.t_ns[:n], recording.direction[:n], by)


def _lund_task(path: Path) -> str:
    return next((t for t in ("img", "video", "trial") if f"_{t}" in path.stem), "")


def read_lund(path: Path) -> Recording:
    """Read one labelled file; pixel positions become unit vectors from the viewing distance."""
    data = loadmat(path, squeeze_me=True, struct_as_record=False)["ETdata"]
    pixel = np.asarray(data.pos[:, 3:5], float)
    lost = (pixel == 0).all(axis=1) | ~np.isfinite(pixel).all(axis=1)
    screen = np.asarray(data.screenRes, float)
    centred = (pixel - screen / 2) * (np.asarray(data.screenDim, float) / screen)
    ray = _directions(centred[:, 0], centred[:, 1], float(data.viewDist), lost)
    name, _, rater = path.stem.rpartition("_labelled_")
    movement = np.nan_to_num(data.pos[:, 5]).astype(np.int8)
    movement[movement > Movement.BLINK] = Movement.UNKNOWN
    t_ns = _stamps(len(pixel), float(data.sampFreq))
    return Recording(name, t_ns, ray, {rater: labelling_of(movement)})


def _hooge(root: Path, group: str) -> Iterator[Recording]:
    settings = [pd.read_csv(p, sep="\t") for p in sorted(root.rglob("coderSettings/*.txt"))]
    for path in sorted(root.rglob(f"ETdata/{group}_*.txt")):
        table = pd.read_csv(path, sep="\t")
        pixel = table[["x", "y"]].to_numpy(float)
        inside = np.isfinite(pixel).all(axis=1) & (pixel > -HOOGE_PIXELS[0]).all(axis=1)
        lost = ~inside | (pixel > 2 * HOOGE_PIXELS[0]).any(axis=1)
        centred = (pixel - np.array(HOOGE_PIXELS) / 2) * (
            np.array(HOOGE_CM) / np.array(HOOGE_PIXELS)
        )
        ms = table["time"].to_numpy(float)
        by = {}
        for number, coder in enumerate(settings):
            own = coder[coder["Trial"] == path.stem]
            starts = np.searchsorted(ms, own["FixStart"].to_numpy(float) - 0.5)
            ends = np.searchsorted(ms, own["FixEnd"].to_numpy(float) + 0.5)
            fixations = np.column_stack([starts, ends]).astype(np.int64)
            fixations = fixations[fixations[:, 1] > fixations[:, 0]]
            movement = np.zeros(len(ms), np.int8)
            for first, end in fixations:
                movement[first:end] = Movement.FIXATION
            by[f"coder {number + 1}"] = Labelling(movement, fixations)
        yield Recording(
            path.stem,
            np.rint(ms * 1e6).astype(np.int64),
            _directions(centred[:, 0], centred[:, 1], HOOGE_DISTANCE_CM, lost),
            by,
        )


def _gazecom(root: Path) -> Iterator[Recording]:
    for path in sorted(root.rglob("data_gazecom/*/*.csv")):
        table = pd.read_csv(path, sep="\t")
        place = table[["X_coord", "Y_coord"]].to_numpy(float)
        lost = (table["Confidence"].to_numpy(float) < HMR_CONFIDENCE_01) | ~np.isfinite(place).all(
            axis=1
        )
        centred = (place - 0.5) * np.array(GAZECOM_CM)
        code = table["Pattern"].map({k: int(v) for k, v in GAZECOM_LABELS.items()}).fillna(0)
        yield Recording(
            path.stem,
            _stamps(len(table), GAZECOM_RATE_HZ),
            _directions(centred[:, 0], centred[:, 1], GAZECOM_DISTANCE_CM, lost),
            {"experts": labelling_of(np.asarray(code, np.int8))},
        )


def _lookatpoint(root: Path) -> Iterator[Recording]:
    for path in sorted(root.rglob("lookAtPoint_EL_S*.npy")):
        table = np.load(path)
        right, up = np.radians(table["x"].astype(float)), np.radians(table["y"].astype(float))
        lost = ~table["status"] | ~np.isfinite(right) | ~np.isfinite(up)
        code = np.array(LOOKATPOINT_LABELS, np.int8)[np.minimum(table["evt"], 5)]
        yield Recording(
            path.stem,
            np.rint(table["t"] * 1e9).astype(np.int64),
            _directions(np.tan(right), -np.tan(up), 1.0, lost),
            {"expert": labelling_of(code)},
        )


def _hmr(root: Path) -> Iterator[Recording]:
    for path in sorted(root.rglob("data_hmr/*/*.csv")):
        table = pd.read_csv(path, sep="\t")
        place = table[["X_coord", "Y_coord"]].to_numpy(float)
        lost = (table["Confidence"].to_numpy(float) < HMR_CONFIDENCE_01) | ~np.isfinite(place).all(
            axis=1
        )
        turned = np.radians((place - np.nanmedian(place[~lost], axis=0)) * HMR_DEG)
        code = table["Pattern"].map({k: int(v) for k, v in GAZECOM_LABELS.items()}).fillna(0)
        yield Recording(
            f"{path.parent.name}_{path.stem}",
            _stamps(len(table), HMR_RATE_HZ),
            _directions(np.tan(turned[:, 0]), np.tan(turned[:, 1]), 1.0, lost),
            {"authors": labelling_of(np.asarray(code, np.int8))},
        )


SETS: Mapping[str, Callable[[Path], Iterator[Recording]]] = {
    "lund images": partial(_lund, task="img"),
    "lund dots": partial(_lund, task="trial"),
    "lund video": partial(_lund, task="video"),
    "hooge adults": partial(_hooge, group="adult"),
    "hooge infants": partial(_hooge, group="infant"),
    "gazecom": _gazecom,
    "lookatpoint": _lookatpoint,
    "hmr": _hmr,
}
"""Each set by name, and what reads it from a folder; a set that is not there has no recording."""

TUNING_SET = "gazecom"


def is_tuned_on(name: str, recording: Recording) -> bool:
    """Return whether weights were fitted on this recording: every second clip of `TUNING_SET`."""
    return name == TUNING_SET and recording.name.split("_", 1)[1] in TUNING_CLIPS


TUNING_CLIPS = frozenset(
    (
        "beach",
        "bridge_1",
        "bumblebee",
        "ducks_boat",
        "golf",
        "koenigstrasse",
        "roundabout",
        "st_petri_gate",
        "st_petri_mcdonalds",
    )
)
"""The clips of even place in alphabetical order, beginning with the first."""
