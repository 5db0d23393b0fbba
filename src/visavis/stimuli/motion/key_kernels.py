"""Compiled places of times between keys, and paths through key places, for a few people a frame.

For twenty people a frame calls for arrays would take longer than the poses themselves.
"""

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.slerp_kernels import Index


@compiled
def locate_rows(
    t_s: Vector,
    first_s: float,
    starts_s: Vector,
    lasts_s: Vector,
    period_s: float,
    is_held: bool,
    segment: Index,
    h: Vector,
) -> bool:
    """Write segment and share h for times (n,); return whether all are finite.

    `starts_s` and `lasts_s` (segments,) count from the first key; `period_s` is 0 where the motion
    is open. `is_held`: before the first and after the last key it rests.
    """
    for r in range(t_s.shape[0]):
        t = t_s[r] - first_s
        if not np.isfinite(t):
            return False
        if period_s > 0.0:
            t = np.mod(t, period_s)
        s = max(np.searchsorted(starts_s, t, side="right") - 1, 0)
        share = (t - starts_s[s]) / lasts_s[s]
        if is_held:
            share = min(max(share, 0.0), 1.0)
        segment[r], h[r] = s, share
    return True


@compiled
def path_rows(
    places_m: Vector,
    slopes: Vector,
    lasts_s: Vector,
    is_smooth: bool,
    segment: Index,
    h: Vector,
    out: Vector,
) -> None:
    """Write places (n, 3) between keys (k, 3): straight, or by cubics with `slopes` (k, 3), 1/s."""
    for r in range(h.shape[0]):
        s, x = segment[r], h[r]
        following = (s + 1) % places_m.shape[0]
        for i in range(3):
            a, b = places_m[s, i], places_m[following, i]
            place = (1 - x) * a + x * b
            if is_smooth:
                leave, arrive = lasts_s[s] * slopes[s, i], lasts_s[s] * slopes[following, i]
                bend = (1 - x) * (leave - (b - a)) - x * (arrive - (b - a))
                place = place + x * (1 - x) * bend
            out[r, i] = place
