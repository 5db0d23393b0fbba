"""The minimal reporting list for eye tracking (Dunn et al., 2024), answered from the data.

Items of virtual reality are added: frames, tracking, fit of the headset.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from visavis.analysis.gaze.looks import LookParameters
from visavis.analysis.gaze.loss import DEFAULT_LOSS
from visavis.analysis.report import Cell, Column, ReportProvenance, Table
from visavis.analysis.report.notation import MISSING, count_of, decimal, percentage
from visavis.devices.registry import driver_spec
from visavis.results.quality import DRIFT, END_ACCURACY, REJECTED, Quality
from visavis.study.look_measures import DEFAULT_MEASURE_PARAMETERS, MeasureParameters

OPEN = "not recorded, because "
"""Beginning of the answer to an item without data; the reason follows."""

STAMPS_COUNTED = ". Counted by trial (repeated_samples, conflicting_samples, backward_samples)"
WHO_WAS_LEFT_OUT = "Participants"
"""The section of the report that shows what was left out."""
FILL_IN = "to be filled in by the lab"

PARTLY: Mapping[str, str] = {
    "display": "resolution and field of view",
}
"""What is missing from items that recordings answer only in part."""

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
    ("latency", "Latency of gaze, and how it was measured"),
    ("frames", "Frames: rate kept, frames missed in trials"),
    ("tracking", "Tracking of head and body: devices, rates"),
    ("fit", "Headset: fit, interpupillary distance, glasses under it"),
)

WHY_NOT: Mapping[str, str] = {
    "eye_tracker": "the manifest names no eye tracker",
    "sampling_rate": "no stream of gaze was recorded",
    "eyes": "no eye tracker was recorded",
    "display": "the manifest names no headset",
    "viewing": "no device sees posture or head restraint",
    "lighting": "no device measures the light of the room",
    "vision": "nobody was asked, or nobody answered",
    "operator": "operators are not named in recordings",
    "calibration": "no calibration was performed through Visavis",
    "filter": "the tracker does not say whether it filters",
    "latency": "the tracker exchanges no times with this computer",
    "frames": "no frames were counted",
    "tracking": "the manifest names no tracker",
    "fit": "nobody measured it with this headset",
}
"""Why an item has no answer; a lab answers it in the paper."""


@dataclass(frozen=True)
class ExclusionCounts:
    """How many people and trials there were, how many of them were excluded, by which limits."""

    people: int
    people_out: int
    trials: int
    trials_out: int
    limits: str


def confidence_rule() -> str:
    """Return which samples a tracker's confidence makes invalid, live and on import."""
    driver = driver_spec("pupil_core").options.model_fields["confidence_threshold_01"].default
    return (
        f"recorded live with a Pupil Core: confidence below {driver:g} (the driver's "
        "default, device option confidence_threshold_01) is invalid; other trackers: their own "
        "validity. Recordings imported from elsewhere: confidence below "
        f"{DEFAULT_LOSS.confidence_01:g} is lost"
    )


def stamp_rule(looks: LookParameters) -> str:
    """Return what happens to samples whose time stamps repeat or go back."""
    conflict_rule = (
        "the first is kept where repeats contradict each other"
        if looks.conflicts == "keep_first"
        else "repeats that contradict each other are refused"
    )
    backward = (
        "samples stamped earlier than the one before are sorted in"
        if looks.backward == "sort"
        else "samples stamped earlier than the one before are refused"
    )
    return f"samples that repeat a stamp are left out, {conflict_rule}; {backward}"


def reporting_table(
    counts: ExclusionCounts,
    quality: Quality,
    provenance: ReportProvenance,
    measures: MeasureParameters = DEFAULT_MEASURE_PARAMETERS,
    losses: Sequence[tuple[str, str]] = (),
    *,
    counts_stamps: bool = True,
) -> Table:
    """Return the list with every answer that the data give, or the reason why there is none.

    `losses` are conditions with the share of gaze that was lost in them; `counts_stamps` says
    whether the trial table counts samples that repeat a stamp.
    """
    # First what the lab and its devices say, then what was measured, then how it was analysed.
    rows: list[tuple[Cell | str, ...]] = [
        (label, _setup_cell(key, quality.facts, provenance.setup)) for key, label in SETUP_ITEMS
    ]
    table = quality.participants
    rows += [
        ("Accuracy, mean over participants (range)", _range(table, "accuracy_deg")),
        *_at_the_end(table),
        ("Precision, RMS sample to sample (range)", _range(table, "precision_deg")),
        (
            "Data loss, of the trial time (range)",
            _range(table, "lost_01", share=True),
        ),
        *((f"Data loss with {name}", share) for name, share in losses),
        (
            "Participants excluded, with reasons",
            f"{counts.people_out} of {counts.people}; see {WHO_WAS_LEFT_OUT}",
        ),
        (
            "Trials excluded, with reasons",
            f"{counts.trials_out} of {counts.trials}; see {WHO_WAS_LEFT_OUT}",
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
            stamp_rule(measures.looks) + (STAMPS_COUNTED if counts_stamps else ""),
        ),
        (
            "Exclusion limits, set before analysis",
            counts.limits,
        ),
        ("Analysis software", ", ".join(f"{k} {v}" for k, v in provenance.versions.items())),
        ("Recordings: SHA-256 of all together", _hash_of_all(provenance)),
    ]
    # The text of an answer shows whether the lab still has to complete it.
    left = sum(isinstance(r[1], Cell) and r[1].text.startswith(OPEN) for r in rows)
    partly = sum(isinstance(r[1], Cell) and r[1].text.endswith(f": {FILL_IN}") for r in rows)
    open_items = [
        *([f"{count_of(left, 'item')} not recorded"] if left else []),
        *([f"{count_of(partly, 'item')} partly open"] if partly else []),
    ]
    note = f"{', '.join(open_items)}." if open_items else "Every item is answered."
    return Table(
        (Column("Item"), Column("This study")),
        tuple((r[0], r[1] or MISSING) for r in rows),
        "Eye tracking, minimal reporting list (Dunn et al., 2024)",
        note,
    )


def _setup_cell(key: str, facts: Mapping[str, str], setup: Mapping[str, str]) -> Cell:
    """Return an item's answer. The lab's own is complete, a recording's may be partial."""
    if setup.get(key):
        return Cell(setup[key])
    answer = facts.get(key, "")
    if key == "viewing":
        whole = [part for part in (answer, facts.get("distances", "")) if part]
        if answer or not whole:
            return Cell("; ".join(whole)) if whole else _missing(key)
        return Cell(f"{whole[0]}; posture and head restraint: {FILL_IN}", "differ")
    if not answer:
        return _missing(key)
    if key in PARTLY:
        return Cell(f"{answer}; {PARTLY[key]}: {FILL_IN}", "differ")
    return Cell(answer)


def _missing(key: str) -> Cell:
    return Cell(f"{OPEN}{WHY_NOT[key]}", "differ")


def _hash_of_all(provenance: ReportProvenance) -> Cell | str:
    hashes = sorted(s.sha256 for s in provenance.sessions if s.sha256)
    if not hashes:
        return Cell(f"{OPEN}the analysis was given tables, no recordings", "differ")
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


def _at_the_end(table: pd.DataFrame) -> list[tuple[Cell | str, ...]]:
    rows: list[tuple[Cell | str, ...]] = []
    if END_ACCURACY in table:
        rows.append(("Accuracy at the end of the session (range)", _range(table, END_ACCURACY)))
    if DRIFT in table:
        rows.append(("Drift: error at the end minus error before (range)", _range(table, DRIFT)))
    if REJECTED in table:
        counts = table[REJECTED].dropna().astype(float)
        people = count_of(int((counts > 0).sum()), "participant")
        text = f"{int(counts.sum())}, of {people}" if counts.any() else "none"
        text = text if len(counts) else "not recorded"
        rows.append(("Validations rejected", text))
    return rows


def _range(table: pd.DataFrame, column: str, *, share: bool = False) -> str:
    values = table[column].dropna().astype(float)
    if values.empty:
        return "not recorded"
    low, mean, high = float(values.min()), float(values.mean()), float(values.max())
    if share:
        return f"{percentage(mean)} ({percentage(low)} to {percentage(high)})"
    return f"{decimal(mean)}° ({decimal(low)}° to {decimal(high)}°)"
