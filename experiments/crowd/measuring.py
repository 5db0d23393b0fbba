"""How walks are measured one by one, and what only the whole session shows of them."""

import json
from typing import Any, Final

import numpy as np

from visavis.analysis.gait import step_length_m
from visavis.experiments.crowd.columns import TABLES
from visavis.experiments.crowd.looks import looks_of
from visavis.experiments.crowd.measures import (
    DEFAULT_MEASURES,
    MeasureParameters,
    measure_walk,
)
from visavis.experiments.crowd.pulses import pulse_rows
from visavis.experiments.crowd.walks import walk_of, walk_records
from visavis.protocol.plan.questionnaires import load_questionnaire
from visavis.recording.reader import Recording
from visavis.results.intake import person_of
from visavis.results.time_course import TIME_COURSE
from visavis.stimuli.scenes.station_crowd import DENSITY_PER_M2
from visavis.study.pieces import MeasuredTrial, Pieces, Rows

VERSION: Final = 9
"""Raise it when measures change, so that stored measures are computed again."""


def sex_of(recording: Recording) -> str | None:
    """Return what the participant said they are, in the questionnaire's own words."""
    questionnaire = load_questionnaire("demographics")
    options = next(q.scale.options for q in questionnaire.questions() if q.question_id == "gender")
    answer = person_of(recording, [questionnaire]).get("gender")
    return options.get(answer) if isinstance(answer, int) else answer


def trials_of(recording: Recording) -> tuple[str, ...]:
    """Return the intact walks of a session, training left out."""
    return tuple(record.trial_id for record in walk_records(recording, intact=True))


def measure_trial(recording: Recording, trial_id: str, how: MeasureParameters) -> MeasuredTrial:
    """Measure one walk from its recording alone."""
    sex = sex_of(recording)
    walk = walk_of(recording, trial_id)
    measures = measure_walk(walk, step_length_m(sex), how, sex=sex)
    path_columns = {
        "cells": json.dumps(measures.cells),
        "track_m": json.dumps(np.round(measures.track_m, 6).tolist()),
    }
    tables = {
        "collisions": measures.collisions,
        "crossings": measures.crossings,
        "cells": [path_columns],
        TIME_COURSE: looks_of(recording, walk),
    }
    return MeasuredTrial.plain(measures.row, tables)


def of_session(
    recording: Recording, rows: Rows, tables: dict[str, Rows], how: MeasureParameters
) -> tuple[Rows, dict[str, Rows]]:
    """Add vibrations, what the plan says of each walk, and gaps that somebody squeezes through."""
    plan = recording.manifest.plan
    n_planned = {b["trials"][0]["factors"]["condition"]: len(b["trials"]) for b in plan["blocks"]}
    pulses = pulse_rows(recording)
    for row in rows:
        row["block_walks"] = n_planned.get(row["condition"])
        row["crowd_density_per_m2"] = plan["parameters"].get("density_per_m2", DENSITY_PER_M2)
        if row.get("tracked_s") is None:
            continue
        attempt_key = (row["trial_id"], row["attempt"])
        own = [p for p in pulses if (p["trial_id"], p["attempt"]) == attempt_key]
        row["pulses"] = len(own)
        row["pulses_lost"] = sum(not p["acknowledged"] for p in own)
        flags = (
            *str(row.get("flags") or "").split(";"),
            *str(row.get("walk_flags") or "").split(";"),
            "pulse_lost" if row["pulses_lost"] else "",
        )
        row["flags"] = ";".join(dict.fromkeys(text for text in flags if text))
        own_crossings = [c for c in tables["crossings"] if c["trial_id"] == row["trial_id"]]
        row |= narrow_gaps(row, own_crossings, how.narrow_gap_m)
    who = recording.manifest.participant
    tables["pulses"] = [{"participant": who, **pulse} for pulse in pulses]
    return rows, tables


def narrow_gaps(row: dict[str, Any], crossings: Rows, narrow_gap_m: float) -> dict[str, Any]:
    """Return how many gaps of at most `narrow_gap_m` a walk crossed, and the mean shoulder angle.

    Cells are Delaunay triangles, so the crowd's outline has edges of several metres between people
    whom nobody passes between; the published angle counts their crossings like any other. Without
    any narrow gap the angle is missing, without cells the count is, too.
    """
    narrow = [c for c in crossings if c["centres_apart_m"] <= narrow_gap_m]
    angles = [a for c in narrow if (a := c["shoulders_to_gap_deg"]) is not None and a == a]
    return {
        "shoulders_to_gap_narrow_deg": float(np.mean(angles)) if angles else None,
        "crossings_narrow": None if row.get("crossings") is None else len(narrow),
    }


PIECES: Final = Pieces(
    how=DEFAULT_MEASURES,
    trials=trials_of,
    measure=measure_trial,
    version=VERSION,
    kept_by=("rule", "surface"),
    of_session=of_session,
    tables=TABLES,
)
