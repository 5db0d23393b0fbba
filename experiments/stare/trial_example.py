"""Take one trial's gaze out of a recording for the report's example figure."""

import numpy as np

from analysis.gaze.aoi import aoi_of_samples
from analysis.gaze.looks import looks_on
from experiments.stare.figures import TrialExample
from experiments.stare.measures import (
    DEFAULT_MEASURE_PARAMETERS,
    GazeTargets,
    MeasureParameters,
)
from lab.clock import NS_PER_MS
from lab.errors import DataError
from protocol.steps import Row
from recording.reader import Recording

SHOWN_CONDITION = "AD"


def example_of(
    recording: Recording, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> TrialExample | None:
    """Return the first finished trial in which a look made the agent look back, or None."""
    for record in recording.trials().to_dict("records"):
        row = {str(k): v for k, v in record.items()}
        if (
            row["status"] == "complete"
            and row["condition"] == SHOWN_CONDITION
            and row.get("switch_cause") == "look"
        ):
            columns = recording.stream_arrays("gaze_targets", part=int(row["recording_part"]))
            return trial_example(GazeTargets.from_columns(columns), row, params=params)
    return None


def trial_example(
    targets: GazeTargets, row: Row, *, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> TrialExample:
    """Return the gaze of a finished trial against its active agent.

    `targets` may hold the whole session. Raises DataError for a row without active agent or times.
    """
    active, start_ns, end_ns = (
        _whole(row, name) for name in ("active_index", "t_start_ns", "t_end_ns")
    )
    samples = targets.between(start_ns, end_ns)
    aoi = aoi_of_samples(
        samples.angle_deg,
        samples.radius_deg,
        samples.pad_limit_deg,
        samples.hit,
        pad_deg=params.pad_deg,
    )
    looks = looks_on(samples.t_ns, aoi, active, start_ns, end_ns, params=params.looks)
    reach = samples.radius_deg[:, active] + np.clip(
        samples.pad_limit_deg[:, active], 0.0, params.pad_deg
    )
    switch = row.get("switch_ns")
    switch_ms = None
    if isinstance(switch, int | float) and switch == switch:
        switch_ms = (int(switch) - start_ns) / NS_PER_MS
    return TrialExample(
        label=f"participant {row.get('participant')}, trial {row.get('trial_id')}, "
        f"{row.get('condition')}, {str(row.get('place', '')).replace('_', ' ')}",
        t_ms=(samples.t_ns - start_ns) / NS_PER_MS,
        angle_deg=np.where(samples.valid, samples.angle_deg[:, active], np.nan).astype(np.float64),
        radius_deg=float(np.nanmedian(reach)) if reach.size else 0.0,
        looks_ms=tuple(
            ((int(onset) - start_ns) / NS_PER_MS, int(duration) / NS_PER_MS, bool(fixation))
            for onset, duration, fixation in zip(
                looks.onset_ns, looks.duration_ns, looks.is_fixation, strict=True
            )
        ),
        switch_ms=switch_ms,
    )


def _whole(row: Row, name: str) -> int:
    value = row.get(name)
    if not isinstance(value, int | float) or value != value:
        raise DataError(
            f"trial {row.get('trial_id')}: {name} is missing; choose a finished trial as example"
        )
    return int(value)
