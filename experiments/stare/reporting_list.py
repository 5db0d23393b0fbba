"""The minimal reporting list for eye tracking (Dunn et al., 2024), answered from the data."""

from collections.abc import Mapping

import pandas as pd

from analysis.report import Cell, Column, ReportProvenance, Table
from analysis.report.notation import MISSING, counted, decimal, percentage
from experiments.stare.analysis import StareAnalysis
from experiments.stare.measures import DEFAULT_MEASURE_PARAMETERS, MeasureParameters
from experiments.stare.quality_table import StareQuality

OPEN = "not recorded – to be filled in by the lab"

SETUP_ITEMS = (
    ("eye_tracker", "Eye tracker: manufacturer, model, software"),
    ("sampling_rate", "Sampling rate, nominal and effective"),
    ("eyes", "Eye(s) recorded and used"),
    ("display", "Display: device, resolution, field of view, refresh rate"),
    ("viewing", "Viewing conditions: posture, head restraint, distance to the agents"),
    ("lighting", "Room and lighting"),
    ("vision", "Participants' vision and correction"),
    ("operator", "Who operated the tracker, with what training"),
    ("calibration", "Calibration: procedure, points, acceptance"),
    ("filter", "Filtering of the gaze signal"),
)


def reporting_table(
    analysis: StareAnalysis,
    quality: StareQuality,
    provenance: ReportProvenance,
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
) -> Table:
    """Return the list with every answer the data give, and what is left to the lab."""
    facts: Mapping[str, str] = {**quality.facts, **provenance.setup}
    rows: list[tuple[Cell | str, ...]] = [
        (label, Cell(facts[key]) if facts.get(key) else Cell(OPEN, "differ"))
        for key, label in SETUP_ITEMS
    ]
    flow, parameters = analysis.selection.flow, analysis.parameters
    table = quality.participants
    rows += [
        ("Accuracy, mean over participants (range)", _range(table, "accuracy_deg")),
        ("Precision, RMS sample to sample (range)", _range(table, "precision_deg")),
        (
            "Data loss, of the trial time (range)",
            _range(table, "lost_01", share=True),
        ),
        (
            "Participants excluded, with reasons",
            f"{flow.participants_out} of {flow.participants}; see Exclusions",
        ),
        (
            "Trials excluded, with reasons",
            f"{flow.lost + flow.with_participants} of {flow.complete}; see Exclusions",
        ),
        (
            "Areas of interest",
            f"agents' heads as seen, padded by {decimal(measures.pad_deg, 1)}° and at most half "
            "the gap to the nearest head, with occlusion",
        ),
        (
            "Event detection",
            "looks on areas of interest; fixation from "
            f"{decimal(measures.looks.minimum_fixation_ms, 0)} ms; gaps up to "
            f"{decimal(measures.looks.bridge_ms, 0)} ms bridged",
        ),
        (
            "Exclusion limits, set before analysis",
            f"{100 * parameters.max_trial_lost_01:.0f} % loss per trial; "
            f"{100 * parameters.max_bad_trials_01:.0f} % of trials; "
            f"{decimal(parameters.max_error_deg, 1)}° mean error",
        ),
        ("Analysis software", ", ".join(f"{k} {v}" for k, v in provenance.versions.items())),
    ]
    left = sum(isinstance(r[1], Cell) and r[1].text == OPEN for r in rows)
    note = f"{counted(left, 'item')} left to the lab." if left else "Every item is answered."
    return Table(
        (Column("Item"), Column("This study")),
        tuple((r[0], r[1] or MISSING) for r in rows),
        "Eye tracking, minimal reporting list (Dunn et al., 2024)",
        note,
    )


def _range(table: pd.DataFrame, column: str, *, share: bool = False) -> str:
    known = table[column].dropna().astype(float)
    if known.empty:
        return "not recorded"
    low, mean, high = float(known.min()), float(known.mean()), float(known.max())
    if share:
        return f"{percentage(mean)} ({percentage(low)} to {percentage(high)})"
    return f"{decimal(mean)}° ({decimal(low)}° to {decimal(high)}°)"
