"""Take in one session of the waving study: its trials as answered, and who answered."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import pandas as pd

from analysis.report import ReportProvenance, SessionSource
from analysis.report.sources import source_of
from experiments.waving.design import QUESTIONNAIRES, STUDY
from protocol.questionnaires import Questionnaire, load_questionnaire, read_answers
from recording.integrity import analysed_trials
from recording.manifest import Manifest
from recording.reader import Recording

OWN_QUESTIONNAIRES: Final[Mapping[str, Path]] = {
    "strategy": Path(__file__).with_name("strategy.yaml")
}


@dataclass(frozen=True)
class SessionIntake:
    """What one session gives to analysis: `rows` one per performed trial, `person` the answers
    of the end.
    """

    rows: pd.DataFrame
    person: Mapping[str, Any]
    source: SessionSource
    manifest: Manifest = field(repr=False)


def questionnaire(name: str, wording: Path | None = None) -> Questionnaire:
    """Return one of the study's questionnaires, in a lab's wording where it has one."""
    return load_questionnaire(OWN_QUESTIONNAIRES.get(name, name), wording)


def take_in(recording: Recording) -> SessionIntake:
    """Read the trials and answers of a session."""
    rows = analysed_trials(recording, needs=())
    rows.insert(0, "is_simulated", recording.is_simulated)
    return SessionIntake(rows, _person(recording), source_of(recording), recording.manifest)


def _person(recording: Recording) -> dict[str, Any]:
    events = recording.events()
    given: dict[str, dict[str, Any]] = {}
    for payload in events.loc[events["name"] == "answer", "payload"]:
        given.setdefault(payload["questionnaire"], {})[payload["question"]] = payload["answer"]
    person: dict[str, Any] = {"participant": recording.manifest.participant}
    for name in QUESTIONNAIRES:
        person |= read_answers(questionnaire(name), given.get(name, {}))
    return person


def provenance_of(sessions: Sequence[SessionIntake], commands: tuple[str, ...]) -> ReportProvenance:
    """Return where a study's numbers come from."""
    first = sessions[0].manifest
    dates = sorted({s.manifest.created_wall_iso[:10] for s in sessions})
    span = dates[0] if len(dates) == 1 else f"{dates[0]} to {dates[-1]}"
    plans = json.dumps([s.manifest.plan for s in sessions], sort_keys=True)
    return ReportProvenance(
        study=STUDY,
        study_version=str(first.plan["study_version"]),
        data_date="virtual time" if first.is_simulated and dates == ["2000-01-01"] else span,
        versions={"python": first.provenance.python, **first.provenance.packages},
        sessions=tuple(s.source for s in sessions),
        configuration_sha256=first.configuration_sha256,
        plan_sha256=hashlib.sha256(plans.encode()).hexdigest(),
        seed=first.seed,
        commands=commands,
    )
