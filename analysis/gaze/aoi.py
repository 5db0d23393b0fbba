"""Decide which head the gaze is on: the padded, occlusion-aware area of interest."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.errors import UsageError

NONE = -1
"""The gaze is on no head."""
LOST = -2
"""The tracker gave no usable gaze."""

DEFAULT_PAD_DEG = 1.0
SENSITIVITY_PADS_DEG: tuple[float, ...] = (0.0, 0.5, 1.0, 1.5, 2.0)

# Angle and radius reach us rounded to float32, and the ray test has its own rounding: within
# this share of the radius the rim counts as outside, where no first surface is asked for.
_RIM_SHARE = 1e-5


@compiled
def _decide(
    angle_deg: npt.NDArray[np.floating],
    radius_deg: npt.NDArray[np.floating],
    pad_limit_deg: npt.NDArray[np.floating],
    hit: npt.NDArray[np.integer],
    pad_deg: float,
    out: npt.NDArray[np.int16],
) -> None:
    n, m = angle_deg.shape
    for i in range(n):
        if hit[i] == LOST:
            out[i] = LOST
            continue
        best, best_ratio, any_head_located = NONE, np.inf, m == 0
        for j in range(m):
            # The recording holds float32, so the online decision uses the same rounded values.
            angle = np.float64(np.float32(angle_deg[i, j]))
            radius = np.float64(np.float32(radius_deg[i, j]))
            if not np.isfinite(angle):
                continue
            any_head_located = True
            if not radius > 0.0:
                continue
            limit = np.float64(np.float32(pad_limit_deg[i, j]))
            pad = max(0.0, min(pad_deg, limit))
            if not angle <= radius + pad:
                continue
            # Within the radius the ray meets something else first: the head is hidden there.
            if angle < radius * (1.0 - _RIM_SHARE) and hit[i] != j:
                continue
            ratio = angle / radius
            if ratio < best_ratio:
                best, best_ratio = j, ratio
        out[i] = best if any_head_located else LOST


def aoi_of_samples(
    angle_deg: npt.NDArray[np.floating],
    radius_deg: npt.NDArray[np.floating],
    pad_limit_deg: npt.NDArray[np.floating],
    hit: npt.NDArray[np.integer],
    *,
    pad_deg: float = DEFAULT_PAD_DEG,
) -> npt.NDArray[np.int16]:
    """Return (n,) the index of the head whose padded area holds the gaze, `NONE` or `LOST`.

    For n samples and m heads: `angle_deg` (n, m) from the ray to each head's centre,
    `radius_deg` (n, m) each head's angular radius, `pad_limit_deg` (n, m) half the rim-to-rim
    gap to the nearest other head as seen (0 when they overlap), `hit` (n,) the first head along
    the ray, -1 none, -2 lost.

    A head holds the gaze when angle <= radius + min(pad, pad limit), unless the ray lies within
    its radius and something else comes first (`hit` is not it). Among several heads the smallest
    angle / radius wins, then the lowest index. Angles are rounded to float32 before anything is
    compared, so a decision made online and one made again from the recording are the same.

    Raises UsageError when the pad is negative or not finite, or shapes disagree. The first call
    loads machine code and takes longer; make it before a trial begins.
    """
    if not 0.0 <= pad_deg < np.inf:
        raise UsageError(f"pad_deg is {pad_deg}; give an angle of 0° or more")
    shape = angle_deg.shape
    if radius_deg.shape != shape or pad_limit_deg.shape != shape or hit.shape != shape[:1]:
        raise UsageError(
            f"angle {shape}, radius {radius_deg.shape}, pad limit {pad_limit_deg.shape} and hit "
            f"{hit.shape} disagree; give (n, m), (n, m), (n, m) and (n,)"
        )
    out = np.empty(shape[0], np.int16)
    _decide(
        np.ascontiguousarray(angle_deg),
        np.ascontiguousarray(radius_deg),
        np.ascontiguousarray(pad_limit_deg),
        np.ascontiguousarray(hit),
        pad_deg,
        out,
    )
    return out


def aoi_by_pad(
    angle_deg: npt.NDArray[np.floating],
    radius_deg: npt.NDArray[np.floating],
    pad_limit_deg: npt.NDArray[np.floating],
    hit: npt.NDArray[np.integer],
    *,
    pads_deg: Sequence[float] = SENSITIVITY_PADS_DEG,
) -> dict[float, npt.NDArray[np.int16]]:
    """Return `aoi_of_samples` for each pad, to show how far a result depends on it."""
    return {
        pad: aoi_of_samples(angle_deg, radius_deg, pad_limit_deg, hit, pad_deg=pad)
        for pad in pads_deg
    }


def pad_for_accuracy_deg(accuracy_deg: float | None) -> float:
    """Return the pad for a participant whose validation found this mean error.

    The error itself, kept within 0.5–1.5°; 1.0° when there was no validation (None or NaN).
    Below 0.5° jitter alone crosses rims, above 1.5° neighbours are counted.
    """
    if accuracy_deg is None or np.isnan(accuracy_deg):
        return DEFAULT_PAD_DEG
    return float(min(max(accuracy_deg, 0.5), 1.5))
