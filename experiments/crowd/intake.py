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
from protocol.questionnaires import Questionnaire, load_questionnaire, read_answers, score
from recording.integrity import analysed_trials
from recording.manifest import Manifest
from recording.reader import Recording
from stimuli.scenes.station_crowd import DENSITY_PER_M2


@dataclass(frozen=True, eq=False)
class SessionIntake:
    """One session measured; travels between processes.

    `person` holds what was asked at the end, `blocks` one row of scores per block, `pulses` one
    row per vibration, `unmeasured` one row per walk that was not finished or cannot be read.
    """

    participant: str
    is_simulated: bool
    manifest: Manifest
    source: SessionSource
    person: dict[str, Any]
    walks: list[MeasuredWalk]
    pulses: list[dict[str, Any]]
    blocks: list[dict[str, Any]] = field(default_factory=list)
    unmeasured: list[dict[str, Any]] = field(default_factory=list)


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

    def about(row: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "block_walks": planned.get(str(row["condition"])),
            "is_simulated": recording.is_simulated,
            "measure_rule": params.rule,
            "measure_surface": params.surface,
            "crowd_density_per_m2": manifest.plan["parameters"].get(
                "density_per_m2", DENSITY_PER_M2
            ),
        }

    for one in measured:
        one.row.update(about(one.row))
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
    left = [
        {str(name): value for name, value in row.items()}
        for row in analysed_trials(recording).to_dict("records")
        if row["status"] != "complete" and not row["is_practice"]
    ]
    return SessionIntake(
        participant=manifest.participant,
        is_simulated=recording.is_simulated,
        manifest=manifest,
        source=source_of(recording),
        person={"participant": manifest.participant, "group": manifest.plan["group"], **person},
        walks=measured,
        pulses=pulses,
        blocks=blocks,
        unmeasured=[{**row, **about(row)} for row in left],
    )


def condition_of(block: Mapping[str, Any]) -> str:
    """Return the condition of a planned block, whatever the lab calls it."""
    return str(block["trials"][0]["factors"]["condition"])


def _labelled(asked: Questionnaire, answers: Mapping[str, Any]) -> dict[str, Any]:
    """Return answers by what the questionnaire itself calls them, in whatever words it was read."""
    found = read_answers(asked, answers)
    return {
        q.question_id: q.scale.options.get(value, answers[q.question_id])
        if isinstance(value := found[q.question_id], int)
        else answers[q.question_id]
        for q in asked.questions()
        if q.question_id in answers
    }


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
            person |= _labelled(load_questionnaire(name), answers)
    rows = []
    for block in recording.manifest.plan["blocks"]:
        row: dict[str, Any] = {
            "participant": recording.manifest.participant,
            "block": block["index"],
            "condition": condition_of(block),
        }
        found = False
        for name in AFTER_BLOCK:
            asked = f"{name}@{block['index']}"
            if asked not in given:
                continue
            found, answers = True, given[asked]
            questionnaire = load_questionnaire(name)
            row |= read_answers(questionnaire, answers) | score(questionnaire, answers)
        if found:
            rows.append(row)
    return person, rows
