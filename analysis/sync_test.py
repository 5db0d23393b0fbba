"""Find how late pictures, sounds and vibrations are, and how evenly, from what a sensor saw.

A stimulus has a time at which the recording says that it is there (a frame's predicted light, a
click's or a command's start); the sensor tells when it was. Their difference is the delay, which
analysis takes off, or adds, to compare streams.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.stats import theilslopes

from visavis.lab.clock import NS_PER_MS, NS_PER_S

Modality = Literal["picture", "sound", "vibration"]
EARLIEST_MS = -20.0
LATEST_MS = 350.0
BASELINE_MS = 40.0
"""Stretch before `EARLIEST_MS` by which the resting level and its noise are known."""
HALF_01 = 0.5
NOISE_SDS = 6.0
MAD_TO_SD = 1.4826
MIN_FOUND = 5
NS_PER_MIN = 60 * NS_PER_S


@dataclass(frozen=True)
class Delays:
    """Delays of one modality, in ms; NaN where too few stimuli were answered.

    `drift_ms_per_min` is the Theil-Sen slope over the test, with its 95 % limits; `sd_ms` is the
    jitter, drift included. `shown_wrong` counts flashes that lasted other than asked.
    """

    modality: Modality
    source: str
    asked: int
    answered: int
    median_ms: float
    mean_ms: float
    sd_ms: float
    p5_ms: float
    p95_ms: float
    min_ms: float
    max_ms: float
    drift_ms_per_min: float
    drift_low_ms_per_min: float
    drift_high_ms_per_min: float
    shown_wrong: int
    delays_ms: tuple[float, ...]

    @property
    def is_sound(self) -> bool:
        """Tell whether enough was answered to take the median for an offset."""
        return self.answered >= max(MIN_FOUND, 0.8 * self.asked)


def onset_ns(
    t_ns: npt.NDArray[np.int64],
    level: npt.NDArray[np.float64],
    asked_ns: int,
    *,
    is_oscillation: bool,
) -> float:
    """Return when the level left its rest after a stimulus was asked for, NaN if it did not.

    Light crosses half of its rise. An oscillation (sound, vibration) has no height of its own: its
    first sample beyond six standard deviations of the resting noise counts, interpolated from the
    sample before.
    """
    earliest_ns = asked_ns + round(EARLIEST_MS * NS_PER_MS)
    rest_ns = earliest_ns - round(BASELINE_MS * NS_PER_MS)
    latest_ns = asked_ns + round(LATEST_MS * NS_PER_MS)
    first, begin, end = np.searchsorted(t_ns, (rest_ns, earliest_ns, latest_ns))
    if begin - first < MIN_FOUND or end - begin < MIN_FOUND:
        return float("nan")
    rest = level[first:begin]
    baseline = float(np.median(rest))
    noise = MAD_TO_SD * float(np.median(np.abs(rest - baseline)))
    noise = max(noise, float(np.max(np.abs(rest - baseline))) / 2, 1e-9)
    height = np.abs(level[begin:end] - baseline) if is_oscillation else level[begin:end] - baseline
    threshold = NOISE_SDS * noise
    if not is_oscillation:
        threshold = max(threshold, HALF_01 * float(np.percentile(height, 99)))
    beyond = np.flatnonzero(height > threshold)
    if not beyond.size:
        return float("nan")
    i = int(beyond[0])
    if i == 0:
        return float("nan")  # it was there before it was asked for
    share = (threshold - height[i - 1]) / (height[i] - height[i - 1])
    before_ns, after_ns = t_ns[begin + i - 1], t_ns[begin + i]
    return float(before_ns + share * (after_ns - before_ns))


def flash_duration_ns(
    t_ns: npt.NDArray[np.int64], level: npt.NDArray[np.float64], asked_ns: int
) -> float:
    """Return how long a flash stayed above half of its height, NaN if there was none."""
    begin, end = np.searchsorted(
        t_ns,
        (asked_ns + round(EARLIEST_MS * NS_PER_MS), asked_ns + round(LATEST_MS * NS_PER_MS)),
    )
    part = level[begin:end]
    if part.size < MIN_FOUND:
        return float("nan")
    low, high = np.percentile(part, (1, 99))
    above = np.flatnonzero(part > low + HALF_01 * (high - low))
    if not above.size:
        return float("nan")
    return float(t_ns[begin + above[-1]] - t_ns[begin + above[0]])


def delays(
    modality: Modality,
    source: str,
    t_ns: npt.NDArray[np.int64],
    level: npt.NDArray[np.float64],
    asked_ns: Sequence[int],
    *,
    flash_ns: int = 0,
    frame_ns: int = 0,
) -> Delays:
    """Return the delays of every stimulus that was asked for at these session times.

    For pictures `flash_ns` and `frame_ns` say how long a flash should last and a frame lasts.
    """
    oscillates = modality != "picture"
    onsets_ns = np.array([onset_ns(t_ns, level, at, is_oscillation=oscillates) for at in asked_ns])
    request_ns = np.asarray(asked_ns, np.int64)
    late_ms = (onsets_ns - request_ns) / NS_PER_MS
    there = np.isfinite(late_ms)
    values, at_min = late_ms[there], (request_ns[there] - request_ns[:1].sum()) / NS_PER_MIN
    wrong = 0
    if modality == "picture" and flash_ns and frame_ns:
        durations_ns = np.array(
            [flash_duration_ns(t_ns, level, int(at)) for at in request_ns[there]]
        )
        wrong = int(np.sum(np.abs(durations_ns - flash_ns) > frame_ns / 2))
    nan = float("nan")
    slope = low = high = median = mean = sd = p5 = p95 = least = most = nan
    if values.size >= MIN_FOUND:
        slope, _, low, high = (float(v) for v in theilslopes(values, at_min))
        p5, median, p95 = (float(v) for v in np.percentile(values, (5, 50, 95)))
        mean, sd = float(np.mean(values)), float(np.std(values, ddof=1))
        least, most = float(values.min()), float(values.max())
    return Delays(
        modality=modality,
        source=source,
        asked=len(asked_ns),
        answered=int(values.size),
        median_ms=median,
        mean_ms=mean,
        sd_ms=sd,
        p5_ms=p5,
        p95_ms=p95,
        min_ms=least,
        max_ms=most,
        drift_ms_per_min=slope,
        drift_low_ms_per_min=low,
        drift_high_ms_per_min=high,
        shown_wrong=wrong,
        delays_ms=tuple(round(float(v), 4) for v in values),
    )


def offsets_ms(all_delays: Sequence[Delays]) -> dict[str, float]:
    """Return the delay of each source that analysis should apply: how early its stamps are.

    Sources that answered too few stimuli are left out. The key is the modality, with a band's role:
    "picture_delay_ms", "sound_delay_ms", "vibration_delay_ms.armband_left".
    """
    return {
        f"{one.modality}_delay_ms"
        + (f".{one.source}" if one.modality == "vibration" else ""): round(one.median_ms, 3)
        for one in all_delays
        if one.is_sound
    }
