"""Bound how late an eye tracker's stamps are: the light of a target against the sample that shows
the saccade to it.

No eye leaves for a target sooner than `MIN_LATENCY_MS` after its light, so the stamp of the first
sample that shows it gone is at most that much later than the light, and the tracker's delay on top.
Sources: express saccades begin 80 to 120 ms after a target (Fischer and Ramsperger 1984); what
comes sooner was begun in anticipation and is left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Vector, angle_deg, unit

MIN_LATENCY_MS = 80.0
LATEST_MS = 700.0
GONE_DEG = 2.0
"""Gaze this far from where it rested shows a saccade; two samples in a row must."""
REST_MS = 150.0
"""Stretch before the light in which gaze rests."""
EARLY_PERCENTILE = 5.0
MIN_ANSWERED = 10

Int = npt.NDArray[np.int64]


@dataclass(frozen=True)
class GazeDelayBound:
    """What saccades to targets say of a tracker's delay; NaN where too few were seen.

    `at_most_ms` is the bound: the 5th percentile of the latencies, less the least that an eye
    needs. `min_latency_ms` is 0 for an artificial eye that moves with the light.
    """

    role: str
    target_count: int
    answer_count: int
    latency_ms: float
    early_latency_ms: float
    min_latency_ms: float
    at_most_ms: float

    @property
    def is_known(self) -> bool:
        """Tell whether enough saccades were seen."""
        return self.answer_count >= MIN_ANSWERED


def saccade_latencies_ms(
    t_ns: Int, gaze: Vector, valid: npt.NDArray[np.bool_], light_ns: Sequence[int]
) -> npt.NDArray[np.float64]:
    """Return from each light to the first of two samples that show gaze gone; NaN without one.

    `gaze` (n, 3) are unit directions at session times `t_ns`, as the tracker stamps them.
    """
    latencies = np.full(len(light_ns), np.nan)
    for i, at_ns in enumerate(light_ns):
        begin, light, end = np.searchsorted(
            t_ns, (at_ns - REST_MS * NS_PER_MS, at_ns, at_ns + LATEST_MS * NS_PER_MS)
        )
        rest = gaze[begin:light][valid[begin:light]]
        after = np.flatnonzero(valid[light:end]) + light
        if not rest.size or after.size < 2:
            continue
        where = unit(np.median(rest, axis=0))
        is_gone = angle_deg(gaze[after], where) > GONE_DEG
        both = np.flatnonzero(is_gone[:-1] & is_gone[1:])
        if both.size:
            latencies[i] = (t_ns[after[both[0]]] - at_ns) / NS_PER_MS
    return latencies


def gaze_delay_bound(
    role: str,
    latencies_ms: npt.NDArray[np.float64],
    *,
    min_latency_ms: float = MIN_LATENCY_MS,
) -> GazeDelayBound:
    """Return the bound on a tracker's delay from saccades' latencies."""
    latencies = latencies_ms[np.isfinite(latencies_ms) & (latencies_ms >= min_latency_ms)]
    nan = float("nan")
    latency = early = at_most = nan
    if latencies.size >= MIN_ANSWERED:
        early, latency = (float(v) for v in np.percentile(latencies, (EARLY_PERCENTILE, 50)))
        at_most = early - min_latency_ms
    return GazeDelayBound(
        role=role,
        target_count=int(latencies_ms.size),
        answer_count=int(latencies.size),
        latency_ms=latency,
        early_latency_ms=early,
        min_latency_ms=min_latency_ms,
        at_most_ms=at_most,
    )
