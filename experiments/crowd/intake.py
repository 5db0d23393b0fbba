"""Take in one session of the crowd study: walks measured, pulses timed, answers scored."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from analysis.gait import step_length_m
from analysis.report import SessionSource
from analysis.report.sources import source_of
from experiments.crowd.design import AFTER_BLOCK
from experiments.crowd.measures import (
    DEFAULT_MEASURES,
    MeasuredWalk,
    MeasureParameters,
    measure_walk,
)
from experiments.crowd.pulses import pulse_rows
from experiments.crowd.replay import walks
from protocol.questionnaires import load_questionnaire, read_answer
from recording.manifest import Manifest
from recording.reader import Recording


@dataclass(frozen=True, eq=False)
class SessionIntake:
    """One session measured; travels between processes.

    `person` holds what was asked at the end, `blocks` one row of scores per block, `pulses` one
    row per vibration.
    """

    participant: str
    is_simulated: bool
    manifest: Manifest
    source: SessionSource
    person: dict[str, Any]
    walks: list[MeasuredWalk]
    pulses: list[dict[str, Any]]
    blocks: list[dict[str, Any]] = field(default_factory=list)


def take_in(
    recording: Recording,
    params: MeasureParameters = DEFAULT_MEASURES,
    *,
    measured: list[MeasuredWalk] | None = None,
) -> SessionIntake:
    """Measure every walk of a session from its recording, or take those `measured` before."""
    manifest = recording.manifest
    person, blocks = answers_of(recording)
    step_m = step_length_m(person.get("gender"))
    pulses = pulse_rows(recording)
    sex = person.get("gender")
    if measured is None:
        measured = [measure_walk(walk, step_m, params, sex=sex) for walk in walks(recording)]
    planned = {condition_of(block): len(block["trials"]) for block in manifest.plan["blocks"]}
    for one in measured:
        one.row["block_walks"] = planned.get(str(one.row["condition"]))
        one.row["is_simulated"] = recording.is_simulated
        walked = (one.row["trial_id"], one.row["attempt"])
        own = [p for p in pulses if (p["trial_id"], p["attempt"]) == walked]
        one.row["pulses"] = len(own)
        one.row["pulses_lost"] = sum(not p["acknowledged"] for p in own)
        flags = (
            *str(one.row.get("flags") or "").split(";"),
            *str(one.row.get("walk_flags") or "").split(";"),
            "pulse_lost" if one.row["pulses_lost"] else "",
        )
        one.row["flags"] = ";".join(dict.fromkeys(text for text in flags if text))
    return SessionIntake(
        participant=manifest.participant,
        is_simulated=recording.is_simulated,
        manifest=manifest,
        source=source_of(recording),
        person={"participant": manifest.participant, "group": manifest.plan["group"], **person},
        walks=measured,
        pulses=pulses,
        blocks=blocks,
    )


def condition_of(block: Mapping[str, Any]) -> str:
    """Return the condition of a planned block, whatever the lab calls it."""
    return str(block["trials"][0]["factors"]["condition"])


def answers_of(recording: Recording) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the answers of the end, and one row per block with answers and scale means.

    `gender` and other choices are labels; ratings are numbers; a question left out is None.
    """
    events = recording.events()
    given: dict[str, dict[str, Any]] = {}
    for payload in events.loc[events["name"] == "answer", "payload"]:
        given.setdefault(payload["questionnaire"], {})[payload["question"]] = payload["answer"]
    person: dict[str, Any] = {}
    for name, answers in given.items():
        if "@" not in name:
            person |= answers
    rows = []
    for block in recording.manifest.plan["blocks"]:
        row: dict[str, Any] = {
            "participant": recording.manifest.participant,
            "block": block["index"],
            "condition": condition_of(block),
        }
        found = False
        for name in AFTER_BLOCK:
            if f"{name}@{block['index']}" not in given:
                continue
            found = True
            answers = given[f"{name}@{block['index']}"]
            questionnaire = load_questionnaire(name)
            values = {
                q.question_id: read_answer(q, answers.get(q.question_id))
                for q in questionnaire.questions()
            }
            row |= values
            for score, rule in questionnaire.scores.items():
                wanted = [
                    values[q.question_id]
                    for q in questionnaire.questions()
                    if not rule.tags or set(rule.tags) & set(q.item.tags)
                ]
                known = [float(v) for v in wanted if v is not None]
                enough = len(wanted) - len(known) <= rule.missing_allowed and known
                row[score] = sum(known) / len(known) if enough else None
        if found:
            rows.append(row)
    return person, rows
