"""Who takes part in a lab's studies today, how far they are, and whether they can leave."""

import datetime
import shlex
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import Any

from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import SessionCheck
from visavis.cli.commands.checking import ANSWER
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import LabError
from visavis.protocol.people.ledger import Ledger, Participant
from visavis.recording.folder import REAL_ROOT, SIMULATED_ROOT
from visavis.recording.manifest import PartStatus, read_manifest
from visavis.recording.reader import Recording
from visavis.running.sessions.device_setup import is_simulated
from visavis.running.sessions.folder_check import is_study
from visavis.running.sessions.study_folder import SIMULATED_PREFIX
from visavis.study.catalogue import SHIPPED_STUDIES


class Verdicts:
    """Status and verdict of sessions, read once for each state of a session's files."""

    def __init__(self) -> None:
        self._by_session: dict[Path, tuple[int, PartStatus, SessionCheck]] = {}

    def of(self, session: Path) -> tuple[PartStatus, SessionCheck]:
        """Return a session's status and the verdict on it.

        Both read every file of it. A running session is read anew each time, because its manifest
        does not change when its process dies.

        Raises:
            LabError: the session cannot be read.
        """
        changed_ns = (session / "manifest.json").stat().st_mtime_ns
        entry = self._by_session.get(session)
        if entry is None or entry[0] != changed_ns or entry[1] == "running":
            recording = Recording(session)
            entry = (changed_ns, recording.status, check_session(recording))
            self._by_session[session] = entry
        return entry[1:]


def people_today(
    lab: LabConfig, verdicts: Verdicts, running: Collection[str] = ()
) -> list[dict[str, Any]]:
    """Return per study who was here today, who is still to come or to go on, and how many are done.

    `running` are the folders of sessions that go on. No other session is checked meanwhile, because
    that takes computing time.
    """
    root = lab.data_root / (SIMULATED_ROOT if is_simulated(lab) else REAL_ROOT)
    prefix = SIMULATED_PREFIX if is_simulated(lab) else ""
    studies = []
    for folder in sorted(path for path in root.glob("*") if is_study(path)):
        is_known = folder.name in SHIPPED_STUDIES or folder.name in lab.studies
        study = folder.name if is_known else f"./{folder.name}.py"
        summary: dict[str, Any] = {"study": folder.name, "people": [], "before": 0, "problem": ""}
        try:
            entries = Ledger(folder, SystemClock(), prefix=prefix).list()
        except LabError as error:
            summary["problem"] = str(error)
            entries = ()
        for entry in entries:
            if entry.status != "active":
                continue
            person = _person(folder, study, entry, verdicts, running)
            if person is None:
                summary["before"] += 1
            else:
                summary["people"].append(person)
        summary["people"].sort(key=lambda person: person["order"])
        studies.append(summary)
    return studies


def verdict_of(verdict: SessionCheck) -> dict[str, Any]:
    """Return what a desk shows of a verdict."""
    return {
        "level": verdict.level.name.lower(),
        "answer": ANSWER[verdict.level],
        "redo": list(verdict.redo),
        "findings": [{**asdict(f), "level": f.level.name.lower()} for f in verdict.findings],
        "done": sum(t.status == "complete" for t in verdict.trials),
        "planned": len(verdict.trials),
    }


def _person(
    folder: Path, study: str, entry: Participant, verdicts: Verdicts, running: Collection[str]
) -> dict[str, Any] | None:
    """Return a person's state today; None for people who were done on an earlier day."""
    sessions = sorted(
        path.parent for path in (folder / f"sub-{entry.label}").glob("ses-*/manifest.json")
    )
    fields: dict[str, Any] = {"label": entry.label, "session": len(sessions), "verdict": None}
    if not sessions:
        command = f"visavis run {shlex.quote(study)} --participant {entry.label}"
        return {**fields, "state": "to come", "command": command, "order": 1}
    session = sessions[-1]
    fields["path"] = str(session.resolve())  # as the session itself says it
    if fields["path"] in running:
        return {**fields, "state": "running", "command": "", "order": 0}
    try:
        parts = read_manifest(session).parts
        is_whole = bool(parts) and parts[-1].status == "complete"
        if is_whole and not _is_today((session / "manifest.json").stat().st_mtime):
            return None
        if running:
            verdict, status = None, "complete" if is_whole else "aborted"
        else:
            status, check = verdicts.of(session)
            verdict = verdict_of(check)
    except LabError as error:
        return {**fields, "state": f"damaged: {error}", "command": "", "order": 0}
    fields["verdict"] = verdict
    if status == "complete":
        return {**fields, "state": "complete", "command": "", "order": 2}
    if status == "running":
        return {**fields, "state": "running", "command": "", "order": 0}
    command = f"visavis resume {shlex.quote(str(session))}"
    return {**fields, "state": "interrupted", "command": command, "order": 0}


def _is_today(changed_s: float) -> bool:
    """Tell whether a session was begun, gone on with or ended on this day of the lab's calendar.

    The manifest file changes at each of these. The dates in it give only the beginning, and on the
    virtual clock no day at all.
    """
    now = datetime.datetime.fromisoformat(SystemClock().wall_iso()).astimezone()
    changed_at = datetime.datetime.fromtimestamp(changed_s, datetime.UTC).astimezone()
    return changed_at.date() == now.date()
