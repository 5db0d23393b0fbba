"""Which sessions of a study are analysed or shared, and who came and left nothing of either."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from visavis.analysis.report.notation import count_of
from visavis.lab.errors import DataError, RecordingError
from visavis.recording.integrity import damage_of
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.running.page.board import STATES, asks_for_deletion, state_of
from visavis.running.sessions.study_folder import one_per_participant

ANSWER_EVENTS: Final = ("answer", "answered")
"""Events of what a person answered, to a questionnaire or within a trial."""


@dataclass(frozen=True)
class IntakeList:
    """The sessions that are taken in, and why each of the others is not."""

    sessions: tuple[Path, ...]
    left_out: tuple[tuple[Path, str], ...] = ()

    def lines(self) -> tuple[str, ...]:
        """Return a line on every session that is left out."""
        return tuple(
            f"left out: {path.parent.name}/{path.name}; {reason}" for path, reason in self.left_out
        )

    def counts(self) -> tuple[str, ...]:
        """Return a line on every reason: how many sessions it leaves out, and whose."""
        paths_by_reason: dict[str, list[Path]] = {}
        for path, reason in self.left_out:
            paths_by_reason.setdefault(reason, []).append(path)
        return tuple(
            f"left out: {count_of(len(paths), 'session')}; {reason}: "
            + ", ".join(f"{path.parent.name}/{path.name}" for path in paths)
            for reason, paths in paths_by_reason.items()
        )


def intake_list(sessions: Sequence[Path], names: Sequence[str] = ()) -> IntakeList:
    """Return what is measured: each person's first complete session, if it holds a trial.

    Where sessions are a factor with `names`, everybody's session of every name is measured.

    To come and leave, to decline, to break off before the first trial is ordinary, and no damage;
    damaged sessions stay on the list, so that their damage is reported.

    Raises:
        DataError: nobody has begun a trial.
    """
    reasons = _reasons(sessions, "no trial", lambda recording: bool(len(recording.trials())))
    candidates = tuple(p for p in sessions if p not in reasons)
    if names:
        measured = tuple(p for p in candidates if read_manifest(p).session <= len(names))
        reason = f"the study has {len(names)} sessions: {', '.join(names)}"
    else:
        measured, _ = one_per_participant(candidates)
        reason = "of several sessions of one person the first complete one is analysed"
    reasons |= dict.fromkeys((p for p in candidates if p not in measured), reason)
    left_out = tuple((path, reasons[path]) for path in sessions if path in reasons)
    if not measured:
        raise DataError(
            "nobody has finished or begun a trial yet: "
            + "; ".join(f"{path.parent.name} {reason}" for path, reason in left_out)
        )
    return IntakeList(measured, left_out)


def share_list(sessions: Sequence[Path], *, keeps_empty: bool) -> IntakeList:
    """Return what is shared: sessions of people who gave something, a trial, answer or sample.

    Who opened a page and left, declined, or came too late gave nothing; `keeps_empty` shares these
    sessions, too. Who wants their data deleted is never shared. Damaged sessions stay on the list,
    so that their damage is reported.

    Raises:
        DataError: nothing is left to share.
    """

    def holds_something(recording: Recording) -> bool:
        return (
            keeps_empty
            or bool(len(recording.trials()))
            or bool(recording.events()["name"].isin(ANSWER_EVENTS).any())
            or any(len(recording.stream_arrays(name)["seq"]) for name in recording.stream_names)
        )

    reasons = _reasons(sessions, "neither trial nor answer", holds_something)
    shared_list = IntakeList(
        tuple(path for path in sessions if path not in reasons), tuple(reasons.items())
    )
    if not shared_list.sessions:
        raise DataError(
            f"nothing is there to share: {'; '.join(shared_list.counts())}. --tier raw copies a "
            "session as it was recorded, unless its participant wants it deleted"
        )
    return shared_list


def _reasons(
    sessions: Sequence[Path], lack: str, holds_enough: Callable[[Recording], bool]
) -> dict[Path, str]:
    """Return why sessions are left out that hold too little; `lack` says what they lack."""
    reasons = {path: _left_out_because(path, lack, holds_enough) for path in sessions}
    return {path: reason for path, reason in reasons.items() if reason}


def _left_out_because(session: Path, lack: str, holds_enough: Callable[[Recording], bool]) -> str:
    """Return why a session is left out; "" where it is not, or nobody can tell."""
    try:
        recording = Recording(session)
        events = recording.events()
        # Only who left reads on: a session's status takes all of its files.
        if asks_for_deletion(events) and recording.status != "complete":
            return "wanted their data deleted: visavis participant withdraw does it"
        if holds_enough(recording) or recording.status == "complete":
            return ""
        if damage_of(recording).is_damaged:
            return ""
        return f"holds {lack} ({STATES[state_of(recording, events)]})"
    except (RecordingError, KeyError, OSError):
        return ""
