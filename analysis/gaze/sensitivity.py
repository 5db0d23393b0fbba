"""Show how far look measures depend on the pad and on the minimum duration of a fixation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import SENSITIVITY_PADS_DEG, aoi_by_pad
from visavis.analysis.gaze.looks import (
    DEFAULT_LOOK_PARAMETERS,
    LookMeasures,
    LookParameters,
    measure_trial,
)
from visavis.analysis.gaze.stamps import Times

SENSITIVITY_MINIMA_MS: tuple[float, ...] = (100.0, 150.0, 200.0)


@dataclass(frozen=True, slots=True)
class SensitivityRow:
    """The measures of one trial under one choice of pad and minimum."""

    pad_deg: float
    minimum_fixation_ms: float
    measures: LookMeasures


def sensitivity_of_trial(
    t_ns: Times,
    angle_deg: npt.NDArray[np.floating],
    radius_deg: npt.NDArray[np.floating],
    pad_limit_deg: npt.NDArray[np.floating],
    hit: npt.NDArray[np.integer],
    target: int,
    t_start_ns: int,
    t_end_ns: int,
    *,
    switch_ns: int | None = None,
    pads_deg: Sequence[float] = SENSITIVITY_PADS_DEG,
    minima_ms: Sequence[float] = SENSITIVITY_MINIMA_MS,
    params: LookParameters = DEFAULT_LOOK_PARAMETERS,
) -> Iterator[SensitivityRow]:
    """Yield the trial's measures for every pad and minimum; arguments as for the two rules."""
    areas = aoi_by_pad(angle_deg, radius_deg, pad_limit_deg, hit, pads_deg=pads_deg)
    for pad_deg, aoi in areas.items():
        for minimum_ms in minima_ms:
            with_minimum = replace(params, minimum_fixation_ms=minimum_ms)
            yield SensitivityRow(
                pad_deg,
                minimum_ms,
                measure_trial(
                    t_ns,
                    aoi,
                    target,
                    t_start_ns,
                    t_end_ns,
                    switch_ns=switch_ns,
                    params=with_minimum,
                ),
            )
