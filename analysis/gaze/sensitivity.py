"""Show how far look measures depend on the pad and on the minimum duration of a fixation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.looks import (
    DEFAULT_LOOK_PARAMETERS,
    LookMeasures,
    LookParameters,
    measure_trial,
)
from visavis.analysis.gaze.stamps import Times, typical_step_ns
from visavis.lab.clock import NS_PER_S

SENSITIVITY_MINIMA_MS: tuple[float, ...] = (100.0, 150.0, 200.0)


@dataclass(frozen=True, slots=True)
class SensitivityRow:
    """The measures of one trial under one choice of pad and minimum."""

    pad_deg: float
    minimum_fixation_ms: float
    measures: LookMeasures


def sensitivity_of_trial(
    t_ns: Times,
    aoi_by_pad_deg: Mapping[float, npt.NDArray[np.integer]],
    target: int,
    t_start_ns: int,
    t_end_ns: int,
    *,
    switch_ns: int | None = None,
    minima_ms: Sequence[float] = SENSITIVITY_MINIMA_MS,
    params: LookParameters = DEFAULT_LOOK_PARAMETERS,
) -> Iterator[SensitivityRow]:
    """Yield the trial's measures for every pad and minimum duration of a fixation.

    `aoi_by_pad_deg` is what `aoi_by_pad` returns; other arguments are those of `measure_trial`.
    """
    if params.nominal_rate_hz is None and (np.diff(t_ns) > 0).all():
        # the period of stamps in order is the same for every choice: found once
        params = replace(params, nominal_rate_hz=NS_PER_S / typical_step_ns(t_ns))
    for pad_deg, aoi in aoi_by_pad_deg.items():
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
