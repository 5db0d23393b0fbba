"""Take in one session: every trial measured, every questionnaire read, and where they come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from visavis.analysis.gaze.targets import PartGaze, gaze_delay_ms
from visavis.analysis.own_streams import OwnStream, own_streams
from visavis.analysis.report import SessionSource
from visavis.analysis.report.sources import source_of
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DataError
from visavis.protocol.plan.questionnaires import (
    Questionnaire,
    load_questionnaire,
    read_answers,
    score,
    unanswered_questions,
)
from visavis.protocol.session.boards import NOTHING_IN_TIME
from visavis.protocol.session.gaze_setup import TARGETS
from visavis.recording.annotations import annotations_of
from visavis.recording.integrity import analysed_trials, damage_of
from visavis.recording.manifest import Manifest
from visavis.recording.page_clock import PAGE_ROLE
from visavis.recording.reader import Recording
from visavis.recording.remarks import Remark, exclusions_in_force, reason_of, remarks_of
from visavis.results.coding import span_rows
from visavis.results.picture_delay import LATE, LatePictures, answer_times_from_light
from visavis.results.reevaluation import ahead_ms, paired_by_arrival
from visavis.results.selection import HAND_PERSON, HAND_TRIAL
from visavis.study.exclusions import ANSWERED_COLUMN
from visavis.study.look_course import look_course
from visavis.study.look_measures import LOOK_COLUMNS, LooksOn
from visavis.study.look_order import fixation_order
from visavis.study.measures import CLOCK_JUMP, Measure, SessionGaze, TrialRecord, value_of


@dataclass(frozen=True)
class SessionIntake:
    """What one session gives to the analysis.

    `rows` has one row per performed trial with its measures; `person` holds the answers of
    questionnaires and the results of validations. `blocks` holds the answers and scores of
    questionnaires asked after blocks, `tables` further tables by name, of studies measured trial
    by trial. `sensitivity` are the main measures of looks by padding and minimum duration, `facts`
    the recording's answers to the eye-tracking reporting list.
    """

    rows: pd.DataFrame
    person: Mapping[str, Any]
    source: SessionSource
    manifest: Manifest = field(repr=False)
    sensitivity: pd.DataFrame = field(repr=False, default_factory=pd.DataFrame)
    facts: Mapping[str, str] = field(default_factory=dict)
    streams: tuple[OwnStream, ...] = field(repr=False, default=())
    """Recordings of the lab's own devices."""
    blocks: pd.DataFrame = field(repr=False, default_factory=pd.DataFrame)
    tables: Mapping[str, pd.DataFrame] = field(repr=False, default_factory=dict)
    remarks: tuple[Remark, ...] = ()
    """What was noted or excluded by hand after the session."""
    course: pd.DataFrame = field(repr=False, default_factory=pd.DataFrame)
    """Looks over time, a row for each trial and step of time."""
    fixations: pd.DataFrame = field(repr=False, default_factory=pd.DataFrame)
    """Every fixation of every trial, in order."""
    coding: pd.DataFrame = field(repr=False, default_factory=pd.DataFrame)
    """Spans that people coded afterwards."""

    def without_tables(self) -> "SessionIntake":
        """Return the intake without its tables, once they are joined with those of others."""
        empty = pd.DataFrame()
        intake = replace(self, rows=empty, sensitivity=empty, blocks=empty, tables={})
        return replace(intake, course=empty, fixations=empty, coding=empty)

    @property
    def planned_count(self) -> int:
        """How many trials were planned, practice not counted."""
        blocks = self.manifest.plan.get("blocks", ())
        return sum(not t["is_practice"] for b in blocks for t in b["trials"])


@dataclass(frozen=True)
class SimulatedStudy:
    """A study simulated without recordings, as the analysis takes it.

    `trials` has one row per trial; `people` one row per participant with the answers and scores
    of questionnaires, where something is correlated with them.
    """

    trials: pd.DataFrame
    people: pd.DataFrame


def questionnaire(
    name: str, folders: Sequence[Path], wording: Path | None = None, *, language: str = ""
) -> Questionnaire:
    """Return a questionnaire: one of the study's folders (NAME.yaml), or one of Visavis."""
    own = next((path for f in folders if (path := f / f"{name}.yaml").is_file()), None)
    return load_questionnaire(own or name, wording, language=language)


def take_in(
    recording: Recording,
    measures: Sequence[Measure],
    questionnaires: Sequence[Questionnaire],
    looks: Sequence[LooksOn] = (),
    after_block: Sequence[Questionnaire] = (),
    blocked_by: str | None = None,
    needs: Sequence[str] | None = (),
    answers: Sequence[str] = (),
    picture_delay_ms: float | None = None,
) -> SessionIntake:
    """Measure every finished and intact trial; the others keep their row without measures.

    With `picture_delay_ms`, gaze is compared with a picture from the moment its light reached the
    eye, and times to `answers` count from that moment (`visavis.results.picture_delay`).

    A measure that is a score of a questionnaire asked after blocks is the same in every row of
    the block. `needs` are the streams that a trial must have without loss (None: all streams).
    Where a trial lost samples of another stream, the measures that read it are missing.

    Raises:
        DataError: the session has no trial rows, or a measure cannot be computed.
    """
    # Looks and other measures of gaze read both streams, so neither may have lost samples.
    if needs is not None and (looks or any(m.needs_gaze for m in measures)):
        needs = (*needs, "gaze", "gaze_targets")
    rows = analysed_trials(recording, needs=needs)
    if "status" not in rows:
        raise DataError(
            f"{recording.path} holds no trial; was it ended before the first? Move it away, or "
            "go on with it: visavis resume"
        )
    rows = _without_limits(rows)
    gaze = SessionGaze(recording)
    trial_measures = [m for m in measures if m.of is not None]
    values: dict[str, list[Any]] = {m.column: [] for m in trial_measures}
    jumps_ms: list[float | None] = []
    look_rows: list[dict[str, Any]] = []
    sensitivity_rows: list[dict[str, Any]] = []
    course_rows: list[dict[str, Any]] = []
    fixation_rows: list[dict[str, Any]] = []
    rules = [(on, on.rules(recording.manifest.plan)) for on in looks]
    unreadable = {
        (t.part, t.trial_id, t.attempt): frozenset(t.streams) for t in damage_of(recording).trials
    }
    late = None if picture_delay_ms is None else LatePictures(recording, picture_delay_ms)
    if late is not None:
        rows = _from_light(rows, late, answers)
    for row in rows.to_dict("records"):
        is_complete = row["status"] == "complete"
        part = gaze.of_part(int(row["recording_part"])) if is_complete else None
        jumps_ms.append(None if part is None else _clock_jump_ms(part, row))
        record = TrialRecord(
            {str(k): v for k, v in row.items()},
            recording,
            None if part is None else part.targets,
            unreadable.get(
                (row["recording_part"], str(row["trial_id"]), row.get("attempt")), frozenset()
            ),
        )
        # A picture that reached the eye late was looked at late: shift gaze back by that time.
        if record.gaze is not None and (late_ms := record.number(LATE.name)) is not None:
            seen_ns = record.gaze.t_ns - round(late_ms * NS_PER_MS)
            record = replace(record, gaze=replace(record.gaze, t_ns=seen_ns))
        for measure in trial_measures:
            values[measure.column].append(value_of(measure, record) if is_complete else None)
        look_rows.append({})
        for number, (on, params) in enumerate(rules if is_complete else ()):
            frozen = np.zeros(0, np.bool_) if part is None else part.frozen
            columns, settings = on.measure(record, frozen, params)
            look_rows[-1] |= columns
            if not row["is_practice"]:
                key = {k: row[k] for k in ("participant", "session", "trial_id", "attempt")}
                sensitivity_rows += [{**key, **setting} for setting in settings]
                if number == 0 and record.gaze is not None:
                    steps = look_course(record.gaze, on.row_of(record), params=params)
                    course_rows += [{**key, **step} for step in steps]
                    order = fixation_order(record.gaze, on.row_of(record), params=params)
                    fixation_rows += [{**key, **fixation} for fixation in order]
    new_columns = pd.DataFrame(values, index=rows.index)
    if looks or any(m.needs_gaze for m in measures):
        new_columns[CLOCK_JUMP.name] = jumps_ms
    # The columns of looks are there even where no trial has a value.
    if rules:
        look_names = [c.name for c in LOOK_COLUMNS]
        new_columns = pd.concat(
            [new_columns, pd.DataFrame(look_rows, index=rows.index, columns=look_names)], axis=1
        )
    rows = pd.concat(
        [rows.drop(columns=[c for c in new_columns if c in rows]), new_columns], axis=1
    )
    blocks = blocks_of(recording, after_block, blocked_by)
    score_columns = [m.column for m in measures if m.column in blocks]
    if score_columns:
        rows = rows.drop(columns=[c for c in score_columns if c in rows])
        rows = rows.merge(blocks[["block", *score_columns]], on="block", how="left")
    rows.insert(0, "is_simulated", recording.is_simulated)
    return SessionIntake(
        rows,
        person_of(recording, questionnaires),
        source_of(recording),
        recording.manifest,
        pd.DataFrame(sensitivity_rows),
        gaze_facts(recording, rows),
        own_streams(recording),
        blocks,
        course=pd.DataFrame(course_rows),
        fixations=pd.DataFrame(fixation_rows),
    )


def with_remarks(intake: SessionIntake, recording: Recording) -> SessionIntake:
    """Return an intake whose rows bear the exclusions by hand of its session and person.

    Raises:
        RecordingError: the list of remarks is damaged.
    """
    remarks = remarks_of(recording.path.resolve().parent)
    number = recording.manifest.session
    mine = tuple(r for r in remarks if r.session in (0, number))
    rows = intake.rows
    for exclusion in exclusions_in_force(mine):
        name = HAND_TRIAL if exclusion.trial_id else HAND_PERSON
        column = rows[name] if name in rows else pd.Series("", index=rows.index, dtype=object)
        is_meant = rows["trial_id"] == exclusion.trial_id if exclusion.trial_id else column == ""
        rows = rows.assign(**{name: column.mask(is_meant, reason_of(exclusion))})
    return replace(intake, rows=rows, remarks=mine)


def with_coding(intake: SessionIntake, recording: Recording) -> SessionIntake:
    """Return an intake with the spans that people coded in its session.

    Raises:
        DataError: the file of spans cannot be read.
    """
    spans = annotations_of(recording.path.resolve().parent)
    manifest = recording.manifest  # the label may have been corrected since
    mine = [
        replace(one, participant=manifest.participant)
        for one in spans
        if one.session == manifest.session
    ]
    return replace(intake, coding=span_rows(mine, intake.rows))


def _without_limits(rows: pd.DataFrame) -> pd.DataFrame:
    """Return trials in which an answer that nobody gave in time has no time: earlier versions
    recorded the limit.
    """
    for by in [str(name) for name in rows if str(name).endswith("_by")]:
        ms = f"{by.removesuffix('_by')}_ms"
        if ms in rows:
            rows = rows.assign(**{ms: rows[ms].mask(rows[by] == NOTHING_IN_TIME)})
    return rows


def _clock_jump_ms(gaze: PartGaze, row: Mapping[Any, Any]) -> float | None:
    """Return the jump of the tracker's clock that a trial suffers from; None without times."""
    start, end = row.get("t_start_ns"), row.get("t_end_ns")
    if start is None or end is None or start != start or end != end:
        return None
    return gaze.clock_jump_ms(int(start), int(end))


def _from_light(rows: pd.DataFrame, late: LatePictures, answers: Sequence[str]) -> pd.DataFrame:
    """Return trials with the delay of their pictures and with times to answer from their light."""
    rows = rows.copy()
    delays_ns = [late.late_ns(row) for row in rows.to_dict("records")]
    rows[LATE.name] = [None if ns is None else ns / NS_PER_MS for ns in delays_ns]
    for index, row, late_ns in zip(rows.index, rows.to_dict("records"), delays_ns, strict=True):
        if late_ns is None:
            continue
        for column, ms in answer_times_from_light(row, answers, late_ns).items():
            rows.loc[index, column] = ms
    return rows


def _answers(recording: Recording) -> dict[str, dict[str, Any]]:
    """Return the answers by questionnaire (NAME, or NAME@BLOCK) and question."""
    events = recording.events()
    answers: dict[str, dict[str, Any]] = {}
    for payload in events.loc[events["name"] == "answer", "payload"]:
        answers.setdefault(payload["questionnaire"], {})[payload["question"]] = payload["answer"]
    return answers


def blocks_of(
    recording: Recording, after_block: Sequence[Questionnaire], blocked_by: str | None = None
) -> pd.DataFrame:
    """Return one row per block with the answers and scores of questionnaires asked after it."""
    answers_by_name, rows = _answers(recording), []
    for block in recording.manifest.plan["blocks"]:
        row: dict[str, Any] = {
            "participant": recording.manifest.participant,
            "block": block["index"],
        }
        if blocked_by is not None:
            row[blocked_by] = block["trials"][0]["factors"][blocked_by]
        block_questionnaires = [
            q for q in after_block if f"{q.name}@{block['index']}" in answers_by_name
        ]
        for one in block_questionnaires:
            answers = answers_by_name[f"{one.name}@{block['index']}"]
            row |= read_answers(one, answers) | score(one, answers)
        rows += [row] if block_questionnaires else []
    return pd.DataFrame(rows)


def person_of(recording: Recording, questionnaires: Sequence[Questionnaire]) -> dict[str, Any]:
    """Return a participant's answers and scores; a questionnaire asked twice has both, numbered."""
    events, answers_by_name = recording.events(), _answers(recording)
    person: dict[str, Any] = {
        "participant": recording.manifest.participant,
        **validations_of(events),
    }
    required_count = missing = 0
    for form in questionnaires:
        answers = read_answers(form, answers_by_name.get(form.name, {}))
        required_count += sum(q.item.required for q in form.questions())
        missing += len(unanswered_questions(form, answers))
        person |= answers
        person |= {f"{form.name}_{name}": value for name, value in score(form, answers).items()}
    if required_count:
        person[ANSWERED_COLUMN] = (required_count - missing) / required_count
    return person


def validations_of(events: pd.DataFrame) -> dict[str, Any]:
    """Return the error at the end of a session, its drift and the number of rejected validations.

    Empty where no tracker was validated.
    """
    validations = list(events.loc[events["name"] == "validation", "payload"])
    if not validations:
        return {}
    starts = [
        v for v in validations if v["moment"] == "block_start" and v["accuracy_deg"] is not None
    ]
    ends = [v for v in validations if v["moment"] == "end" and v["accuracy_deg"] is not None]
    end_deg = ends[-1]["accuracy_deg"] if ends else None
    return {
        "end_accuracy_deg": end_deg,
        "drift_deg": end_deg - starts[-1]["accuracy_deg"] if ends and starts else None,
        "rejected_validations": sum(not v["accepted"] for v in validations if v["moment"] != "end"),
    }


def gaze_facts(recording: Recording, rows: pd.DataFrame) -> dict[str, str]:
    """Return a recording's answers to the reporting list for eye tracking; {} without gaze."""
    devices = {d["role"]: d for d in recording.manifest.devices}
    tracker, headset = devices.get("eye_tracker", {}), devices.get("headset", {})
    is_recorded = "gaze" in recording.stream_names
    gaze = recording.stream_schema("gaze") if is_recorded else None
    if not tracker and gaze is None:
        return {}
    is_calibrated = (recording.events()["name"] == "calibration").any()
    facts = {
        "eyes": "both recorded; the combined ray used, one eye's when the other is lost",
        "calibration": ""
        if not is_calibrated
        else (
            f"tracker's own 3-D calibration, then validation at {len(TARGETS)} points up to 15°, "
            f"{_when_calibrated(recording.manifest.plan)}; validation again at the end; accepted "
            "up to 1.5° mean and 3° at the worst point"
        ),
        "filter": "none; raw samples with the tracker's own validity",
    }
    facts |= _timing_facts(recording, rows)
    tracking_devices = [d for role, d in devices.items() if role in ("headset", "body_tracker")]
    facts["tracking"] = "; ".join(
        f"{d['vendor']} {d['model']} ({_role_with_rate(recording, d['role'])})"
        for d in tracking_devices
    )
    if tracker:
        made_up = " (SIMULATED)" if tracker.get("is_simulated") else ""
        facts["eye_tracker"] = f"{tracker['vendor']} {tracker['model']}{made_up}"
    if headset:
        frames = recording.stream_schema("frames")
        rate = f", {frames.nominal_rate_hz:g} Hz" if frames is not None else ""
        facts["display"] = f"{headset['vendor']} {headset['model']}{rate}"
    finished_trials = rows[rows["status"] == "complete"]
    if gaze is not None and len(finished_trials):
        facts["sampling_rate"] = (
            f"{gaze.nominal_rate_hz:g} Hz nominal, "
            f"{_rate_in_trials_hz(recording, 'gaze', finished_trials):.1f} Hz effective"
        )
    return facts


def _when_calibrated(plan: Mapping[str, Any]) -> str:
    """Return in words before which blocks of a recorded plan the tracker was calibrated."""
    blocks = plan.get("blocks", ())
    often = sum(bool(block.get("calibrate")) for block in blocks)
    return "before the first block" if often < max(len(blocks), 2) else "before every block"


def _role_with_rate(recording: Recording, role: str) -> str:
    """Return the role of a tracker of head or body, with its nominal rate if it has one."""
    stream = {"headset": "head", "body_tracker": "body"}[role]
    schema = recording.stream_schema(stream) if stream in recording.stream_names else None
    rate_hz = 0.0 if schema is None else schema.nominal_rate_hz
    return role.replace("_", " ") + (f", {rate_hz:g} Hz" if rate_hz else "")


def _rate_in_trials_hz(recording: Recording, stream: str, trials: pd.DataFrame) -> float:
    """Return how many samples of a stream came in a second of finished trials."""
    columns = recording.stream_arrays(stream)
    parts, at_ns = columns["recording_part"], columns["t_host_ns"]
    count = duration_s = 0.0
    for part, start_ns, end_ns in zip(
        trials["recording_part"], trials["t_start_ns"], trials["t_end_ns"], strict=True
    ):
        in_trial = (parts == part) & (at_ns >= start_ns) & (at_ns < end_ns)
        count += float(in_trial.sum())
        duration_s += float(end_ns - start_ns) / NS_PER_S
    return count / duration_s if duration_s else float("nan")


def _timing_facts(recording: Recording, rows: pd.DataFrame) -> dict[str, str]:
    """Return facts about the latency of gaze and about missed frames."""
    facts = {}
    events = recording.events()
    trips_ms = [
        (receive - send) / NS_PER_MS
        for payload in events.loc[events["name"] == "clock_exchanges", "payload"]
        if payload["role"] != PAGE_ROLE
        for send, _, receive in payload["send_device_receive_ns"]
    ]
    if trips_ms:
        delay_ms = gaze_delay_ms(recording)
        own = (
            "the delay within the tracker is not known and not in it"
            if delay_ms is None
            else f"the tracker's own delay, {delay_ms:g} ms, is taken off every sample's time"
        )
        facts["latency"] = (
            f"transport {float(np.median(trips_ms)) / 2:.1f} ms one way, half the median of "
            f"{len(trips_ms)} time exchanges; {own}"
        )
    if any(paired_by_arrival(recording, part.number) for part in recording.manifest.parts):
        facts["latency"] = "; ".join(
            (
                *filter(None, [facts.get("latency")]),
                "gaze was recorded as turned by the head foreseen for the picture, "
                f"{ahead_ms(recording):.1f} ms ahead, and is evaluated again with the head of its "
                "own time",
            )
        )
    if LATE.name in rows and rows[LATE.name].notna().any():
        late_ms = float(rows[LATE.name].median())
        facts["latency"] = "; ".join(
            (
                *filter(None, [facts.get("latency")]),
                f"pictures reached the eye {late_ms:.1f} ms (median) after their frame began, by "
                "the display's prediction and the delay measured in the room, and gaze is held "
                "against them then",
            )
        )
    if len(rows) and {"frames", "frames_dropped"} <= set(rows):
        frames, missed_frames = int(rows["frames"].sum()), int(rows["frames_dropped"].sum())
        if frames:
            facts["frames"] = f"{missed_frames} of {frames + missed_frames} missed in trials"
    return facts
