"""Saccades and post-saccadic oscillations by thresholds that adapt to the recording's noise.

Own implementation of Nyström & Holmqvist (2010), Behavior Research Methods 42.
"""

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.velocity import Rows
from visavis.analysis.gaze.stamps import Times
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

FIRST_PEAK_DEG_S = 100.0
PEAK_SPREADS, ONSET_SPREADS = 6.0, 3.0
LOCAL_SHARE = 0.3
SACCADE, OSCILLATION = int(Movement.SACCADE), int(Movement.OSCILLATION)


@compiled
def _below(speed: Vector, limit: float) -> tuple[int, float, float]:
    """Return count, mean and standard deviation of the speeds below a limit."""
    count = 0
    total = 0.0
    squares = 0.0
    for s in speed:
        if s < limit:
            count += 1
            total += s
            squares += s * s
    if count == 0:
        return 0, np.nan, np.nan
    mean = total / count
    return count, mean, np.sqrt(max(0.0, squares / count - mean * mean))


@compiled
def adapted_thresholds(speed_deg_s: Vector, first_deg_s: float) -> tuple[float, float]:
    """Return the peak and the onset threshold in deg/s, NaN when no speed is below the first.

    The peak threshold is mean + 6 spreads of the speeds below it, repeated until it changes by
    less than 1 deg/s; the onset threshold is mean + 3 spreads of the same speeds.
    """
    peak = first_deg_s
    onset = np.nan
    for _ in range(100):
        count, mean, spread = _below(speed_deg_s, peak)
        if count == 0:
            return np.nan, np.nan
        # Peak = mean + 6 SD, onset = mean + 3 SD of the speeds below the last peak.
        before = peak
        peak = mean + PEAK_SPREADS * spread
        onset = mean + ONSET_SPREADS * spread
        if abs(peak - before) < 1.0:
            break
    return peak, onset


@compiled
def mark_saccades(
    t_ns: Times,
    speed: Vector,
    stretch: Rows,
    peak_deg_s: float,
    onset_deg_s: float,
    local_ns: int,
    minimum_ns: int,
    oscillation_ns: int,
    step_ns: int,
    out: npt.NDArray[np.int8],
) -> None:
    """Mark saccades and oscillations in `out` (n,).

    A saccade begins at the last local minimum below the onset threshold before a peak, and ends
    at the first local minimum below 0.7 onset threshold + 0.3 (mean + 3 spreads of the
    `local_ns` before it). Speed that crosses that end threshold again within `oscillation_ns` is
    an oscillation, until its last minimum.
    """
    n = t_ns.shape[0]
    i = 0
    while i < n:
        if not speed[i] > peak_deg_s:
            i += 1
            continue
        s = stretch[i]
        first = i
        while first > 0 and stretch[first - 1] == s and out[first - 1] == 0:
            falls = speed[first - 1] >= speed[first]
            if speed[first] < onset_deg_s and falls:
                break
            first -= 1
        # Noise of the `local_ns` before the onset, from rows that belong to no saccade.
        count = 0
        total = 0.0
        squares = 0.0
        j = first - 1
        while j >= 0 and stretch[j] == s and t_ns[first] - t_ns[j] <= local_ns:
            if speed[j] < peak_deg_s and out[j] == 0:
                count += 1
                total += speed[j]
                squares += speed[j] * speed[j]
            j -= 1
        # Without local rows, or with noisy ones, the onset threshold ends the saccade, too.
        limit = onset_deg_s
        if count > 2:
            mean = total / count
            spread = np.sqrt(max(0.0, squares / count - mean * mean))
            local = mean + ONSET_SPREADS * spread
            if local < peak_deg_s:
                limit = (1.0 - LOCAL_SHARE) * onset_deg_s + LOCAL_SHARE * local
        last = i
        while last < n - 1 and stretch[last + 1] == s:
            if speed[last] < limit and speed[last + 1] >= speed[last]:
                break
            last += 1
        if t_ns[last] - t_ns[first] + step_ns < minimum_ns:
            i = last + 1
            continue
        for j in range(first, last + 1):
            out[j] = SACCADE
        # An oscillation: speed rises above the end threshold again soon after the saccade.
        end = last
        j = last + 1
        while j < n and stretch[j] == s and t_ns[j] - t_ns[last] <= oscillation_ns:
            if speed[j] > limit:
                end = j
            j += 1
        if end > last:
            while end < n - 1 and stretch[end + 1] == s and speed[end + 1] < speed[end]:
                end += 1
            if t_ns[end] - t_ns[last] <= 2 * oscillation_ns:
                for j in range(last + 1, end + 1):
                    out[j] = OSCILLATION
            else:
                end = last
        i = end + 1
