"""Take a session's recording in: measured trials, scored answers, where they come from."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from analysis.gaze.targets import targets_of_part
from analysis.report import ReportProvenance, SessionSource
from analysis.report.sources import source_of
from experiments.stare.study import QUESTIONNAIRES
from protocol.gaze_setup import TARGETS
from protocol.questionnaires import load_questionnaire, read_answers, score
from recording.integrity import analysed_trials
from recording.manifest import Manifest
from recording.reader import Recording
from visavis.looks import (
    DEFAULT_MEASURE_PARAMETERS,
    MeasureParameters,
    second_view,
    sensitivity_rows,
    trial_measures,
)

ANXIETY = "social_anxiety"


@dataclass(frozen=True)
class SessionIntake:
    """What one session gives to analysis.

    `rows` has one row per performed trial, `sensitivity` the measures by padding and minimum
    duration, `person` the questionnaire scores and answers of the participant, `facts` what the
    recording says for the eye-tracking reporting list.
    """

    rows: pd.DataFrame
    sensitivity: pd.DataFrame
    person: Mapping[str, Any]
    source: SessionSource
    manifest: Manifest = field(repr=False)
    facts: Mapping[str, str] = field(default_factory=dict)


def measure_parameters_of(plan: Mapping[str, Any]) -> MeasureParameters:
    """Return the thresholds of a session's measures: padding as its trials decided looks online."""
    pad_deg = plan.get("parameters", {}).get("pad_deg", DEFAULT_MEASURE_PARAMETERS.pad_deg)
    return replace(DEFAULT_MEASURE_PARAMETERS, pad_deg=float(pad_deg))


def take_in(
    recording: Recording, params: MeasureParameters = DEFAULT_MEASURE_PARAMETERS
) -> SessionIntake:
    """Measure every finished and intact trial; the others keep their row unmeasured."""
    trials = analysed_trials(recording, needs=("gaze", "gaze_targets"))
    rows: list[dict[str, Any]] = []
    sensitivity: list[dict[str, Any]] = []
    done = trials.loc[trials["status"] == "complete", "recording_part"]
    targets = {int(p): targets_of_part(recording, int(p)) for p in done.unique()}
    for row in _records(trials):
        if row["status"] != "complete":
            rows.append(row)
            continue
        samples, frozen = targets[int(row["recording_part"])]
        within = (samples.t_ns >= int(row["t_start_ns"])) & (samples.t_ns < int(row["t_end_ns"]))
        measured = trial_measures(samples, row, params=params)
        second = second_view(samples, row, params=params)
        rows.append({**row, **measured, "frozen_samples": int(frozen[within].sum()), **second})
        if not row["is_practice"]:
            key = {k: row[k] for k in ("participant", "session", "trial_id", "attempt")}
            key["condition"] = row["condition"]
            sensitivity += [{**key, **v} for v in sensitivity_rows(samples, row, params=params)]
    frame = pd.DataFrame(rows)
    frame.insert(0, "is_simulated", recording.is_simulated)
    return SessionIntake(
        rows=frame,
        sensitivity=pd.DataFrame(sensitivity),
        person=_person(recording),
        source=source_of(recording),
        manifest=recording.manifest,
        facts=_facts(recording, frame),
    )


def _records(frame: pd.DataFrame) -> Iterator[dict[str, Any]]:
    for record in frame.to_dict("records"):
        yield {str(k): v for k, v in record.items()}


def _person(recording: Recording) -> dict[str, Any]:
    events = recording.events()
    given: dict[str, dict[str, Any]] = {}
    for payload in events.loc[events["name"] == "answer", "payload"]:
        given.setdefault(payload["questionnaire"], {})[payload["question"]] = payload["answer"]
    person: dict[str, Any] = {
        "participant": recording.manifest.participant,
        **_validations(events),
    }
    for name in QUESTIONNAIRES:
        questionnaire = load_questionnaire(name)
        answers = given.get(name, {})
        if name == ANXIETY:
            scores = score(questionnaire, answers)
            person |= {f"anxiety_{key}": value for key, value in scores.items()}
        else:
            person |= read_answers(questionnaire, answers)
    return person


def _validations(events: pd.DataFrame) -> dict[str, Any]:
    found = list(events.loc[events["name"] == "validation", "payload"])
    starts = [v for v in found if v["moment"] == "block_start" and v["accuracy_deg"] is not None]
    ends = [v for v in found if v["moment"] == "end" and v["accuracy_deg"] is not None]
    end_deg = ends[-1]["accuracy_deg"] if ends else None
    return {
        "end_accuracy_deg": end_deg,
        "drift_deg": end_deg - starts[-1]["accuracy_deg"] if ends and starts else None,
        "rejected_validations": sum(not v["accepted"] for v in found if v["moment"] != "end"),
    }


def _facts(recording: Recording, rows: pd.DataFrame) -> dict[str, str]:
    devices = {d["role"]: d for d in recording.manifest.devices}
    tracker, headset = devices.get("eye_tracker", {}), devices.get("headset", {})
    gaze = recording.stream_schema("gaze")
    facts = {
        "eyes": "both recorded; the combined ray used, one eye's when the other is lost",
        "calibration": (
            f"tracker's own 3-D calibration, then validation at {len(TARGETS)} points up to 15°, "
            "before every block and at the end; accepted up to 1.5° mean and 3° at the worst point"
        ),
        "filter": "none; raw samples with the tracker's own validity",
        "viewing": "seated, head free",
    }
    if tracker:
        made_up = " (SIMULATED)" if tracker.get("is_simulated") else ""
        facts["eye_tracker"] = f"{tracker['vendor']} {tracker['model']}{made_up}"
    if headset:
        frames = recording.stream_schema("frames")
        rate = f", {frames.nominal_rate_hz:g} Hz" if frames is not None else ""
        facts["display"] = f"{headset['vendor']} {headset['model']}{rate}"
    done = rows[rows["status"] == "complete"]
    if gaze is not None and len(done):
        duration_s = float((done["t_end_ns"] - done["t_start_ns"]).sum()) / 1e9
        effective = float(done["gaze_samples"].sum()) / duration_s if duration_s else float("nan")
        facts["sampling_rate"] = (
            f"{gaze.nominal_rate_hz:g} Hz nominal, {effective:.1f} Hz effective"
        )
    return facts


def provenance_of(sessions: Sequence[SessionIntake], commands: tuple[str, ...]) -> ReportProvenance:
    """Return where a study's numbers come from."""
    first = sessions[0].manifest
    dates = sorted({s.manifest.created_wall_iso[:10] for s in sessions})
    span = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"
    plans = json.dumps([s.manifest.plan for s in sessions], sort_keys=True)
    return ReportProvenance(
        study="stare",
        study_version=str(first.plan["study_version"]),
        data_date="virtual time" if first.is_simulated and dates == ["2000-01-01"] else span,
        versions={"python": first.provenance.python, **first.provenance.packages},
        sessions=tuple(s.source for s in sessions),
        configuration_sha256=first.configuration_sha256,
        plan_sha256=hashlib.sha256(plans.encode()).hexdigest(),
        seed=first.seed,
        commands=commands,
    )
