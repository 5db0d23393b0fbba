"""Velocity thresholds after smoothing, as people ordinarily set them for a noisy tracker."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from visavis.analysis.gaze.events import IVT_SCREEN, IvtParameters, detect_ivt
from visavis.lab.geometry import Vector, unit

Labels = npt.NDArray[np.int8]
Detect = Callable[[npt.NDArray[np.int64], Vector], Labels]


def savitzky_golay(t_ns: npt.NDArray[np.int64], direction: Vector, window_ms: float) -> Vector:
    """Return directions (n, 3) by parabolas over a window; losses are bridged, then lost again."""
    step_ms = float(np.median(np.diff(t_ns))) / 1e6
    width = max(3, round(window_ms / step_ms) | 1)
    is_lost = ~np.isfinite(direction).all(axis=1)
    rows = np.arange(len(t_ns))
    smooth = np.full(direction.shape, np.nan)
    if (~is_lost).sum() < width:
        return smooth
    for axis in range(3):
        bridged = np.interp(rows, rows[~is_lost], direction[~is_lost, axis])
        smooth[:, axis] = savgol_filter(bridged, width, 2)
    smooth = unit(smooth)
    smooth[is_lost] = np.nan
    return smooth


def _ivt(
    t_ns: npt.NDArray[np.int64], direction: Vector, *, window_ms: float, params: IvtParameters
) -> Labels:
    found = detect_ivt(t_ns, savitzky_golay(t_ns, direction, window_ms), params)
    return found.in_fixation.astype(np.int8)


SMOOTHED: Mapping[str, Detect] = {
    f"I-VT {threshold:.0f}°/s, smoothed {window_ms} ms": partial(
        _ivt, window_ms=window_ms, params=replace(IVT_SCREEN, threshold_deg_s=threshold)
    )
    for window_ms in (20, 40, 60, 100)
    for threshold in (30.0, 45.0)
}
"""Ordinary settings; a set's best one is what others reach there without knowing more."""
