"""Take one trial's gaze out of a recording for the report's example figure."""

import numpy as np

from analysis.gaze.aoi import aoi_of_samples
from analysis.gaze.looks import looks_on
from analysis.gaze.targets import GazeTargets
from experiments.stare.figures import TrialExample
from experiments.stare.gaze_changes import TOLERANCE_MS
from lab.clock import NS_PER_MS
from lab.errors import DataError
from protocol.steps import Row
from recording.reader import Recording
from visavis.looks import (
    DEFAULT_MEASURE_PARAMETERS,
    MeasureParameters,
)

SHOWN_CONDITION = "AD"


def example_of(
    recording: Recording, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> TrialExample | None:
    """Return the trial in which a look made the agent look back and then lasted longest.

    Of finished main trials under averted-then-directed gaze; None without one that changed by a
    look. The first of several equals is taken.
    """
    best, longest_ms = None, -1.0
    targets: dict[int, GazeTargets] = {}
    for record in recording.trials().to_dict("records"):
        row = {str(k): v for k, v in record.items()}
        if (
            row["status"] == "complete"
            and not row["is_practice"]
            and row["condition"] == SHOWN_CONDITION
            and row.get("switch_cause") == "look"
        ):
            part = int(row["recording_part"])
            if part not in targets:
                columns = recording.stream_arrays("gaze_targets", part=part)
                targets[part] = GazeTargets.from_columns(columns)
            example = trial_example(targets[part], row, params=params)
            lasted_ms = causing_look_ms(example, (row["look_ns"] - row["t_start_ns"]) / NS_PER_MS)
            if lasted_ms > longest_ms:
                best, longest_ms = example, lasted_ms
    return best


def causing_look_ms(example: TrialExample, cause_ms: float) -> float:
    """Return how long the look that holds the causing sample lasted, 0 when none does."""
    return max(
        (
            duration
            for onset, duration, _ in example.looks_ms
            if onset - TOLERANCE_MS <= cause_ms <= onset + duration
        ),
        default=0.0,
    )


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
        end_ms=(end_ns - start_ns) / NS_PER_MS,
    )


def _whole(row: Row, name: str) -> int:
    value = row.get(name)
    if not isinstance(value, int | float) or value != value:
        raise DataError(
            f"trial {row.get('trial_id')}: {name} is missing; choose a finished trial as example"
        )
    return int(value)
