"""One trial's gaze out of a recording, as the report shows it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from visavis.analysis.gaze.looks import looks_on
from visavis.analysis.gaze.targets import GazeTargets
from visavis.analysis.plots import BLUE, VERMILION, ReportFigure, draw, new_figure
from visavis.analysis.plots.style import BLACK, GREY
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DataError
from visavis.protocol.plan.steps import Row
from visavis.recording.reader import Recording
from visavis.study.look_measures import (
    DEFAULT_MEASURE_PARAMETERS,
    MeasureParameters,
)
from visavis.study.measures import SessionGaze

SHOWN_CONDITION = "AD"
TOLERANCE_MS = 1.0
"""Far below the time between samples: the same sample, counted from the trial's start."""


@dataclass(frozen=True)
class TrialExample:
    """The gaze of one trial against its active agent.

    `t_ms` (n,) from the trial's start; `angle_deg` (n,) from the gaze to the head's centre, NaN
    where lost; `radius_deg` the head's angular radius with padding; `looks_ms` onset and duration
    of each look, with whether it is a fixation; `switch_ms` when the agent's gaze changed;
    `end_ms` when the trial ended (None: with the last sample).
    """

    label: str
    t_ms: npt.NDArray[np.float64]
    angle_deg: npt.NDArray[np.float64]
    radius_deg: float
    looks_ms: Sequence[tuple[float, float, bool]]
    switch_ms: float | None = None
    end_ms: float | None = None


def example_of(
    recording: Recording, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> TrialExample | None:
    """Return the trial in which a look made the agent look back and then lasted longest.

    Looks through finished main trials under averted-then-directed gaze; None if no look caused a
    change. Among equals the first is taken.
    """
    best, longest_ms = None, -1.0
    gaze = SessionGaze(recording)
    for record in recording.trials().to_dict("records"):
        row = {str(k): v for k, v in record.items()}
        if (
            row["status"] == "complete"
            and not row["is_practice"]
            and row["condition"] == SHOWN_CONDITION
            and row.get("switch_cause") == "look"
        ):
            samples = gaze.of_part(int(row["recording_part"]))
            if samples is None:
                return None
            example = trial_example(samples.targets, row, params=params)
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
    aoi = samples.areas(params.pad_deg)
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


def trial_figure(example: TrialExample, *, is_simulated: bool) -> ReportFigure:
    """Return the angle between gaze and the active agent's head over a trial, and its looks."""
    return draw(
        "trial",
        lambda: _trial(example),
        title=f"Gaze in one trial ({example.label})",
        caption="Angle from the gaze to the centre of the active agent's head; gaze "
        "within the shaded band is on the head. Bars: looks, filled when they are "
        "fixations. Gaps: lost gaze.",
        alternative="Angle between gaze and the active agent's head over one trial.",
        is_simulated=is_simulated,
    )


def _trial(example: TrialExample) -> Figure:
    figure = new_figure(9.6, 3.3)
    axes = figure.add_subplot()
    seconds = example.t_ms / 1000
    axes.axhspan(0, example.radius_deg, color=VERMILION, alpha=0.15, linewidth=0)
    axes.plot(seconds, example.angle_deg, color=BLUE, linewidth=0.9)
    top = float(np.nanmax(example.angle_deg)) if np.isfinite(example.angle_deg).any() else 10.0
    for onset, duration, is_fixation in example.looks_ms:
        axes.barh(
            -0.07 * top,
            duration / 1000,
            left=onset / 1000,
            height=0.06 * top,
            facecolor=VERMILION if is_fixation else "white",
            edgecolor=VERMILION,
            linewidth=0.9,
        )
    if example.switch_ms is not None:
        x = example.switch_ms / 1000
        axes.axvline(x, color=BLACK, linestyle=(0, (4, 3)), linewidth=1)
        axes.text(x, 1.04 * top, " gaze changes", va="top", fontsize=9.5)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.set_ylim(-0.13 * top, 1.08 * top)
    end_ms = example.end_ms
    if end_ms is None and example.t_ms.size:
        end_ms = float(example.t_ms[-1])
    axes.set_xlim(0, None if end_ms is None else end_ms / 1000)
    axes.set_xlabel("Time from the start of the trial (s)")
    axes.set_ylabel("Angle to the head (°)")
    return figure
