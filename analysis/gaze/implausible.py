"""Judge the values of a recording from elsewhere: gaze and pupils that no eye has.

What cannot be is refused with the likely reason where it is most of a recording; single samples are
taken as lost, and both are told.
"""

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.foreign import EyeSamples, GazeRecording
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector

Mask = npt.NDArray[np.bool_]

MAX_BEHIND_01: Final = 0.5
"""More gaze behind the head than this is an axis that points the other way."""
PUPIL_MM: Final = (1.0, 10.0)
"""No human pupil is smaller or larger."""
MIN_AHEAD_01, MIN_AHEAD_ROWS = 0.01, 10
"""So many samples exactly straight ahead are what a program writes for lost gaze."""
MIN_MARKED_ROWS: Final = 3
LOST_MARKS_PX: Final = frozenset({0.0, -1.0, -100.0, -1000.0, -9999.0, -32768.0, 1e8})
"""Trackers write one of these as x and as y where they lost the eye: EyeLink −32768 and 1e8, the
others 0 or −1."""


def without_lost_points(points_px: Vector) -> tuple[Vector, tuple[str, ...]]:
    """Return points (n, 2) on a screen without marks for lost gaze, such as 0, 0, and a remark.

    A mark stands in x and y alike and in three rows or more; a single row is a point.
    """
    x = points_px[:, 0]
    is_alike = x == points_px[:, 1]
    marks = {v: int((is_alike & (x == v)).sum()) for v in LOST_MARKS_PX if is_alike.any()}
    marks = {v: n for v, n in marks.items() if n >= MIN_MARKED_ROWS}
    if not marks:
        return points_px, ()
    is_lost = is_alike & np.isin(x, list(marks))
    texts = " and ".join(f"{v:g}, {v:g} in {n} rows" for v, n in sorted(marks.items()))
    return np.where(is_lost[:, None], np.nan, points_px), (
        f"{texts} is what a tracker writes where it lost the eye, and no point: read as lost",
    )


def plausible_samples(recording: GazeRecording) -> tuple[GazeRecording, tuple[str, ...]]:
    """Return a recording without what no eye does, and remarks on what that was.

    Gaze behind the head is not valid, a pupil of another unit is left out.

    Raises:
        DataError: most gaze lies behind the head.
    """
    remarks: list[str] = []
    eyes: dict[str, EyeSamples] = {}
    for name, eye in recording.eyes.items():
        if recording.space == "head":
            eye = _without_gaze_behind(recording.name, name, eye, remarks)
        eyes[name] = _with_human_pupil(name, eye, remarks)
    own = {name: eyes.get(name) for name in ("left", "right", "combined")}
    return replace(
        recording, left=own["left"], right=own["right"], combined=own["combined"]
    ), tuple(remarks)


def _without_gaze_behind(
    recording: str, name: str, eye: EyeSamples, remarks: list[str]
) -> EyeSamples:
    has_gaze = np.isfinite(eye.direction[:, 0]) & eye.valid
    behind = has_gaze & (eye.direction[:, 2] > 0)
    n_behind, n = int(behind.sum()), int(has_gaze.sum())
    if n_behind > MAX_BEHIND_01 * n:
        raise DataError(
            f"{recording}: {n_behind} of {n} samples of the {name} gaze look behind the head; does "
            "the axis that is called forward point backwards? Say so in the mapping: axes"
        )
    if n_behind:
        remarks.append(
            f"{n_behind} of {n} samples of the {name} gaze look behind the head, which no eye "
            "does: they are not valid"
        )
        eye = replace(eye, valid=eye.valid & ~behind)
    ahead = has_gaze & (eye.direction[:, :2] == 0).all(axis=1)
    n_ahead = int(ahead.sum())
    if n_ahead >= max(MIN_AHEAD_ROWS, MIN_AHEAD_01 * n):
        remarks.append(
            f"{n_ahead} of {n} samples of the {name} gaze look exactly straight ahead: is that "
            "what the program writes where gaze is lost?"
        )
    return eye


def _with_human_pupil(name: str, eye: EyeSamples, remarks: list[str]) -> EyeSamples:
    size = eye.pupil_mm[np.isfinite(eye.pupil_mm)]
    if not size.size:
        return eye
    low, high = PUPIL_MM
    middle = float(np.median(size))
    if not low <= middle <= high:
        likely = [
            unit
            for unit, per_mm in (("m", 1e-3), ("cm", 0.1), ("µm", 1e3))
            if low <= middle / per_mm <= high
        ]
        hint = f"; is the unit {' or '.join(likely)}?" if likely else "; it is in another unit"
        remarks.append(
            f"the pupil of the {name} eye is {middle:.4g} mm in the middle, and a human's is "
            f"{low:g} to {high:g}: it was left out{hint}"
        )
        return replace(eye, pupil_mm=np.full_like(eye.pupil_mm, np.nan))
    n_odd = int(((size < low) | (size > high)).sum())
    if n_odd:
        remarks.append(
            f"{n_odd} of {size.size} pupil sizes of the {name} eye are none of a human "
            f"({size.min():.3g} to {size.max():.3g} mm): blinks, or losses of the tracker"
        )
    return eye
