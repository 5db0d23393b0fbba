"""When in a trial somebody looked: shares of gaze on the agent in steps of time."""

from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.targets import GazeTargets
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import Row, Scalar
from visavis.study.look_measures import DEFAULT_MEASURE_PARAMETERS, MeasureParameters, span_of_row

STEP_MS: Final = 250
T_MS: Final = "t_ms"
ON_01: Final = "on_agent_01"
"""The share; of a walk through a crowd that on anybody."""


def look_course(
    targets: GazeTargets, row: Row, *, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> Iterator[dict[str, Scalar | None]]:
    """Yield the middle of every step of a trial, and the share of its usable samples on the agent.

    `row` is as in `trial_measures`. The share is None where a step has no usable sample; a last
    step that the trial's end cuts by more than half is left out.
    """
    span = span_of_row(row)
    samples = targets.between(span.start_ns, span.end_ns)
    is_usable = samples.valid & (samples.t_ns >= span.start_ns)
    is_on = samples.areas(params.pad_deg)[is_usable] == span.active
    yield from shares_in_steps(
        samples.t_ns[is_usable] - span.start_ns, is_on, span.end_ns - span.start_ns
    )


def shares_in_steps(
    since_ns: npt.NDArray[np.int64], is_on: npt.NDArray[np.bool_], length_ns: int
) -> Iterator[dict[str, Scalar | None]]:
    """Yield steps as `look_course` does; `since_ns` (n,) and `is_on` (n,) are of usable samples of
    a stretch of so long, from its start.
    """
    step_ns = STEP_MS * NS_PER_MS
    step, steps = since_ns // step_ns, (length_ns + step_ns // 2) // step_ns
    within = step < steps
    usable_count = np.bincount(step[within], minlength=steps)
    on_count = np.bincount(step[within], weights=is_on[within], minlength=steps)
    for i in range(steps):
        share = float(on_count[i] / usable_count[i]) if usable_count[i] else None
        yield {T_MS: (i + 0.5) * STEP_MS, ON_01: share}
