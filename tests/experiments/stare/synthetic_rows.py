"""Trial tables shaped like a study's, drawn from normal distributions at the published means."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from visavis.experiments.stare.comparisons import MEASURES
from visavis.experiments.stare.design import CONDITIONS
from visavis.experiments.stare.published import MEANS
from visavis.experiments.stare.study import study
from visavis.results.analysis import StudyAnalysis
from visavis.results.opened_study import OpenedStudy
from visavis.stimuli.scenes.audience import ACTIVE_PLACES, depth_of, zone_of

SPREAD = {"dwell_ms": 0.8, "fixation_count": 0.9}
"""Within-person standard deviation of a trial as a share of the condition's mean."""


def study_rows(
    participants: int, *, seed: int = 1, effect: bool = True, repetitions: int = 2
) -> pd.DataFrame:
    """Return one row per trial; without `effect` every condition has the averted means."""
    rng = np.random.default_rng(seed)
    rows = []
    for index in range(participants):
        lifted = {
            (c, m.column): MEANS[c if effect else "A"][m.column].mean
            + MEANS[c if effect else "A"][m.column].sd * rng.standard_normal()
            for c in CONDITIONS
            for m in MEASURES
        }
        order = list(product(CONDITIONS, ACTIVE_PLACES, range(repetitions)))
        for number, (condition, place, _) in enumerate(order, 1):
            row: dict[str, object] = {
                "participant": f"S{index + 1:02d}",
                "session": 1,
                "trial_id": f"T{number:02d}",
                "number": number,
                "is_practice": False,
                "attempt": 1,
                "status": "complete",
                "reason": None,
                "flags": "",
                "condition": condition,
                "place": place,
                "zone": zone_of(place),
                "depth": depth_of(place),
                "lost_01": float(np.clip(rng.gamma(2.0, 0.02), 0, 1)),
                "calibration_id": f"C{1 + number // 25}",
                "calibration_accuracy_deg": 0.7 + 0.2 * (index % 4),
                "calibration_precision_deg": 0.15 + 0.02 * (index % 3),
                "calibration_worst_point_deg": 1.4 + 0.1 * (index % 5),
                "calibration_lost_01": 0.02,
                "is_simulated": True,
            }
            for m in MEASURES:
                mean = max(0.2 * MEANS[condition][m.column].mean, lifted[condition, m.column])
                value = mean * max(0.05, 1 + SPREAD.get(m.column, 0.3) * rng.standard_normal())
                row[m.column] = float(max(0, round(value)))
            if row["fixation_count"] == 0:
                row |= {m.column: np.nan for m in MEASURES[2:]}
            elif row["fixation_count"] == 1:
                row |= {m.column: np.nan for m in MEASURES[4:]}
            row["ivt_on_active_count"] = row["fixation_count"]
            rows.append(row)
    return pd.DataFrame(rows)


def analysed(
    rows: pd.DataFrame,
    answers: pd.DataFrame,
    *,
    varied: pd.DataFrame | None = None,
    parameters: dict[str, Any] | None = None,
    **settings: float,
) -> StudyAnalysis:
    """Analyse trials as the study does; what a session adds to them is filled in."""
    added = {
        "session": 1,
        "attempt": 1,
        "status": "complete",
        "is_practice": False,
        "is_simulated": True,
    }
    whole = rows.assign(**{k: v for k, v in added.items() if k not in rows})
    people = answers if "participant" in answers else pd.DataFrame({"participant": []})
    opened = OpenedStudy(study)
    return opened.analysis_of_rows(
        opened.experiment(parameters or {}),
        whole,
        people,
        planned_counts={},
        settings=settings,
        sensitivity_rows=varied,
    )


def anxiety_answers(participants: int, *, seed: int = 1) -> pd.DataFrame:
    rng = np.random.default_rng(seed + 1000)
    return pd.DataFrame(
        {
            "participant": [f"S{i + 1:02d}" for i in range(participants)],
            "social_anxiety_total": rng.integers(5, 110, participants),
            "age": rng.integers(19, 50, participants),
        }
    )


def varied_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the same measures for a grid of paddings and minimum durations."""
    parts = []
    for pad_deg, minimum_ms in product((0.0, 0.5, 1.0, 1.5, 2.0), (100.0, 150.0, 200.0)):
        part = rows[["participant", "session", "trial_id", *(m.column for m in MEASURES)]].copy()
        part["dwell_ms"] *= 0.8 + 0.2 * pad_deg
        part["pad_deg"], part["minimum_fixation_ms"] = pad_deg, minimum_ms
        parts.append(part)
    return pd.concat(parts, ignore_index=True)
