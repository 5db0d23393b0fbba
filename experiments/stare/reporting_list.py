"""The minimal reporting list for eye tracking (Dunn et al., 2024), answered from the data."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from analysis.report import Cell, Column, ReportProvenance, Table
from analysis.report.notation import MISSING, counted, decimal, percentage
from experiments.stare.analysis import StareAnalysis
from experiments.stare.methods_text import confidence_rule, stamp_rule
from experiments.stare.quality_table import DRIFT, END_ACCURACY, REJECTED, StareQuality
from stimuli.scenes.audience import PARTICIPANT_EYE_M, SEATS
from visavis.looks import DEFAULT_MEASURE_PARAMETERS, MeasureParameters

OPEN = "not recorded – to be filled in by the lab"
FILL_IN = "to be filled in by the lab"

PARTLY: Mapping[str, str] = {
    "display": "resolution and field of view",
}
"""What recordings cannot say of an item they answer in part."""

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
    rows: list[tuple[Cell | str, ...]] = [
        (label, _setup_cell(key, quality.facts, provenance.setup)) for key, label in SETUP_ITEMS
    ]
    flow, parameters = analysis.selection.flow, analysis.parameters
    table = quality.participants
    rows += [
        ("Accuracy, mean over participants (range)", _range(table, "accuracy_deg")),
        *_at_the_end(table),
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
            "Samples counted as lost",
            confidence_rule(),
        ),
        (
            "Time stamps that repeat or go back",
            stamp_rule(measures.looks),
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
    partly = sum(isinstance(r[1], Cell) and r[1].text.endswith(f": {FILL_IN}") for r in rows)
    open_items = [
        *([f"{counted(left, 'item')} left to the lab"] if left else []),
        *([f"{counted(partly, 'item')} partly open"] if partly else []),
    ]
    note = f"{', '.join(open_items)}." if open_items else "Every item is answered."
    return Table(
        (Column("Item"), Column("This study")),
        tuple((r[0], r[1] or MISSING) for r in rows),
        "Eye tracking, minimal reporting list (Dunn et al., 2024)",
        note,
    )


def _setup_cell(key: str, recorded: Mapping[str, str], given: Mapping[str, str]) -> Cell:
    """Return an item's answer; the lab's counts as whole, a recording's may be a part."""
    if given.get(key):
        return Cell(given[key])
    known = recorded.get(key, "")
    if key == "viewing":
        if known:
            return Cell(f"{known}; {_distances()}")
        return Cell(f"{_distances()}; posture and head restraint: {FILL_IN}", "differ")
    if not known:
        return Cell(OPEN, "differ")
    if key in PARTLY:
        return Cell(f"{known}; {PARTLY[key]}: {FILL_IN}", "differ")
    return Cell(known)


def _distances() -> str:
    eye_height_m = float(PARTICIPANT_EYE_M[1])
    far = [float(np.hypot(s.distance_m, s.head_height_m - eye_height_m)) for s in SEATS.values()]
    return (
        f"agents' heads {decimal(min(far), 1)} to {decimal(max(far), 1)} m from the eyes "
        "(seating plan)"
    )


def _at_the_end(table: pd.DataFrame) -> list[tuple[Cell | str, ...]]:
    rows: list[tuple[Cell | str, ...]] = []
    if END_ACCURACY in table:
        rows.append(("Accuracy at the end of the session (range)", _range(table, END_ACCURACY)))
    if DRIFT in table:
        rows.append(("Drift: error at the end minus error before (range)", _range(table, DRIFT)))
    if REJECTED in table:
        known = table[REJECTED].dropna().astype(float)
        people = counted(int((known > 0).sum()), "participant")
        text = f"{int(known.sum())}, of {people}" if len(known) else "not recorded"
        rows.append(("Validations rejected", text))
    return rows


def _range(table: pd.DataFrame, column: str, *, share: bool = False) -> str:
    known = table[column].dropna().astype(float)
    if known.empty:
        return "not recorded"
    low, mean, high = float(known.min()), float(known.mean()), float(known.max())
    if share:
        return f"{percentage(mean)} ({percentage(low)} to {percentage(high)})"
    return f"{decimal(mean)}° ({decimal(low)}° to {decimal(high)}°)"
