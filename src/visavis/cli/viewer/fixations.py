"""Fixations of trials in space: when, how long, and where on what is drawn."""

from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.events import IVT_HEADSET, detect_ivt

MIN_SAMPLES = 3
"""Fewer samples show no rate."""


def fixations_of(
    t_ns: npt.NDArray[np.int64],
    direction: npt.NDArray[np.float64],
    end_m: npt.NDArray[np.float64],
    hit: npt.NDArray[np.integer],
    on: npt.NDArray[np.object_],
) -> list[dict[str, Any]]:
    """Return fixations in order, by velocity with the thresholds for headsets.

    For n samples in order: `direction` (n, 3) in world, NaN where gaze was lost; `end_m` (n, 3)
    where it ended, NaN where nowhere; `hit` (n,) the agent whose area it was in, −1 for none; `on`
    (n,) the name of what it ended on. A fixation lies at the median of its ends, on what most of
    its samples were on; one that ends nowhere is left out.
    """
    _, rows = np.unique(t_ns, return_index=True)
    if len(rows) < MIN_SAMPLES:
        return []
    events = detect_ivt(t_ns[rows], direction[rows], IVT_HEADSET)
    fixations = []
    for k in range(len(events)):
        here = rows[events.first_row[k] : events.last_row[k] + 1]
        has_end = np.isfinite(end_m[here]).all(axis=1)
        if not has_end.any():
            continue
        agents, things = Counter(hit[here][has_end].tolist()), Counter(on[here][has_end].tolist())
        fixations.append(
            {
                "begin_ns": int(events.onset_ns[k]),
                "end_ns": int(events.onset_ns[k] + events.duration_ns[k]),
                "at": [round(float(v), 4) for v in np.median(end_m[here][has_end], axis=0)],
                "hit": agents.most_common(1)[0][0],
                "on": things.most_common(1)[0][0],
            }
        )
    return fixations
