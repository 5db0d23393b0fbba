"""One trial's gaze for the report's example figure."""

import numpy as np

from analysis.gaze.aoi import aoi_of_samples
from analysis.gaze.looks import looks_on
from experiments.stare.figures import TrialExample
from experiments.stare.measures import DEFAULT_MEASURE_PARAMETERS, GazeTargets, MeasureParameters
from lab.clock import NS_PER_MS
from recording.reader import Recording

SHOWN_CONDITION = "AD"


def example_of(
    recording: Recording, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> TrialExample | None:
    """Return a finished trial whose agent's gaze changed because of a look, or None."""
    trials = recording.trials()
    if "switch_cause" not in trials:
        return None
    fitting = trials[
        (trials["status"] == "complete")
        & (trials["condition"] == SHOWN_CONDITION)
        & (trials["switch_cause"] == "look")
    ]
    if fitting.empty:
        return None
    row = fitting.iloc[0]
    start_ns, end_ns = int(row["t_start_ns"]), int(row["t_end_ns"])
    active = int(row["active_index"])
    columns = recording.stream_arrays("gaze_targets", part=int(row["recording_part"]))
    samples = GazeTargets.from_columns(columns).between(start_ns, end_ns)
    aoi = aoi_of_samples(
        samples.angle_deg,
        samples.radius_deg,
        samples.pad_limit_deg,
        samples.hit,
        pad_deg=params.pad_deg,
    )
    looks = looks_on(samples.t_ns, aoi, active, start_ns, end_ns, params=params.looks)
    pad_deg = np.minimum(params.pad_deg, samples.pad_limit_deg[:, active])
    switch_ns = row["switch_ns"]
    return TrialExample(
        label=f"{row['participant']}, trial {row['trial_id']}, {row['place'].replace('_', ' ')}",
        t_ms=(samples.t_ns - start_ns) / NS_PER_MS,
        angle_deg=samples.angle_deg[:, active].astype(np.float64),
        radius_deg=float(np.median(samples.radius_deg[:, active] + pad_deg)),
        looks_ms=tuple(
            (
                (int(onset) - start_ns) / NS_PER_MS,
                int(duration) / NS_PER_MS,
                bool(is_fixation),
            )
            for onset, duration, is_fixation in zip(
                looks.onset_ns, looks.duration_ns, looks.is_fixation, strict=True
            )
        ),
        switch_ms=None if np.isnan(switch_ns) else (int(switch_ns) - start_ns) / NS_PER_MS,
    )
