"""In which order somebody looked at what in a trial: fixations, and what each was on."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from visavis.analysis.gaze.aoi import LOST, NONE
from visavis.analysis.gaze.events import detect_ivt
from visavis.analysis.gaze.targets import GazeTargets
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import Row, Scalar
from visavis.study.look_measures import (
    DEFAULT_MEASURE_PARAMETERS,
    MeasureParameters,
    samples_in_order,
    span_of_row,
)

NUMBER: Final = "number"
ONSET_MS: Final = "onset_ms"
DURATION_MS: Final = "duration_ms"
ON: Final = "looks_at"
HEAD: Final = "head_index"
RIGHT_DEG: Final = "right_deg"
UP_DEG: Final = "up_deg"
AGENT, OTHERS, ELSEWHERE = "agent", "others", "elsewhere"
AREAS: Final = (AGENT, OTHERS, ELSEWHERE)
"""What a fixation is on: the agent's head, the head of somebody else, neither."""


def fixation_order(
    targets: GazeTargets, row: Row, *, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> Iterator[dict[str, Scalar | None]]:
    """Yield a trial's fixations by velocity (those that `ivt_fixation_count` counts), from 1 on.

    `row` is as in `trial_measures`. A fixation is on what most of its usable samples are on.
    Its direction is in the world: degrees to the right of −z, and upwards.
    """
    span = span_of_row(row)
    samples = samples_in_order(targets, span, params)
    direction = np.where(samples.valid[:, None], samples.direction_world, np.nan)
    events = detect_ivt(samples.t_ns, direction, params.ivt)
    areas = samples.areas(params.pad_deg)
    for k in range(len(events)):
        here = areas[events.first_row[k] : events.last_row[k] + 1]
        heads, counts = np.unique(here[here != LOST], return_counts=True)
        head = int(heads[np.argmax(counts)]) if heads.size else NONE
        x, y, z = (float(v) for v in events.direction[k])
        yield {
            NUMBER: k + 1,
            ONSET_MS: (int(events.onset_ns[k]) - span.start_ns) / NS_PER_MS,
            DURATION_MS: int(events.duration_ns[k]) / NS_PER_MS,
            ON: AGENT if head == span.active else ELSEWHERE if head == NONE else OTHERS,
            HEAD: None if head == NONE else head,
            RIGHT_DEG: round(float(np.degrees(np.arctan2(x, -z))), 3),
            UP_DEG: round(float(np.degrees(np.arctan2(y, np.hypot(x, z)))), 3),
        }
