"""Take in one session: every trial measured, every questionnaire read, and where they come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.report import SessionSource
from analysis.report.sources import source_of
from lab.errors import DataError
from protocol.questionnaires import Questionnaire, load_questionnaire, read_answers, score
from recording.integrity import analysed_trials
from recording.manifest import Manifest
from recording.reader import Recording
from visavis.measures import Measure, SessionGaze, TrialRecord, value_of


@dataclass(frozen=True)
class SessionIntake:
    """What one session gives to analysis: `rows` one per performed trial with its measures,
    `person` the answers of the questionnaires.
    """

    rows: pd.DataFrame
    person: Mapping[str, Any]
    source: SessionSource
    manifest: Manifest = field(repr=False)

    @property
    def planned(self) -> int:
        """How many trials were planned, practice not counted."""
        blocks = self.manifest.plan.get("blocks", ())
        return sum(not t["is_practice"] for b in blocks for t in b["trials"])


def questionnaire(name: str, folders: Sequence[Path], wording: Path | None = None) -> Questionnaire:
    """Return a questionnaire: one of the study's folders (NAME.yaml), or one of Visavis."""
    own = next((path for f in folders if (path := f / f"{name}.yaml").is_file()), None)
    return load_questionnaire(own or name, wording)


def take_in(
    recording: Recording, measures: Sequence[Measure], questionnaires: Sequence[Questionnaire]
) -> SessionIntake:
    """Measure every finished and intact trial; the others keep their row unmeasured.

    Raises:
        DataError: the session has no trial rows, or a measure cannot be computed.
    """
    needs = ("gaze", "gaze_targets") if any(m.needs_gaze for m in measures) else ()
    rows = analysed_trials(recording, needs=needs)
    if "status" not in rows:
        raise DataError(
            f"{recording.path} holds no trial; was it ended before the first? Move it away, or "
            "go on with it: visavis resume"
        )
    gaze = SessionGaze(recording)
    wanted = [m for m in measures if m.of is not None]
    values: dict[str, list[Any]] = {m.column: [] for m in wanted}
    for row in rows.to_dict("records"):
        measured = row["status"] == "complete"
        record = TrialRecord(
            {str(k): v for k, v in row.items()},
            recording,
            gaze.of_part(int(row["recording_part"])) if measured else None,
        )
        for measure in wanted:
            values[measure.column].append(value_of(measure, record) if measured else None)
    added = pd.DataFrame(values, index=rows.index)
    rows = pd.concat([rows.drop(columns=[c for c in added if c in rows]), added], axis=1)
    rows.insert(0, "is_simulated", recording.is_simulated)
    return SessionIntake(
        rows, person_of(recording, questionnaires), source_of(recording), recording.manifest
    )


def person_of(recording: Recording, questionnaires: Sequence[Questionnaire]) -> dict[str, Any]:
    """Return a participant's answers and scores; a questionnaire asked twice has both, numbered."""
    events = recording.events()
    given: dict[str, dict[str, Any]] = {}
    for payload in events.loc[events["name"] == "answer", "payload"]:
        given.setdefault(payload["questionnaire"], {})[payload["question"]] = payload["answer"]
    person: dict[str, Any] = {"participant": recording.manifest.participant}
    for asked in questionnaires:
        answers = read_answers(asked, given.get(asked.name, {}))
        person |= answers
        person |= {f"{asked.name}_{name}": value for name, value in score(asked, answers).items()}
    return person
