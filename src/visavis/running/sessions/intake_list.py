"""Which sessions of a study an analysis measures, and who came and left nothing to measure."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from visavis.lab.errors import DataError, RecordingError
from visavis.recording.integrity import damage_of
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording
from visavis.running.page.board import STATES, state_of
from visavis.running.page.course import WITHDRAWN
from visavis.running.sessions.study_folder import one_per_participant


@dataclass(frozen=True)
class IntakeList:
    """The sessions that are measured, and why each of the others is not."""

    measured: tuple[Path, ...]
    left_out: tuple[tuple[Path, str], ...] = ()

    def lines(self) -> tuple[str, ...]:
        """Return a line on every session that is left out."""
        return tuple(
            f"left out: {path.parent.name}/{path.name}; {reason}" for path, reason in self.left_out
        )


def intake_list(sessions: Sequence[Path], names: Sequence[str] = ()) -> IntakeList:
    """Return what is measured: each person's first complete session, if it holds a trial.

    Where sessions are a factor with `names`, everybody's session of every name is measured.

    To come and leave, to decline, to break off before the first trial is ordinary, and no damage;
    damaged sessions stay on the list, so that their damage is reported.

    Raises:
        DataError: nobody has begun a trial.
    """
    reasons = {path: reason for path in sessions if (reason := _left_out_because(path))}
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


def _left_out_because(session: Path) -> str:
    """Return why there is nothing to measure; "" where there is, or nobody can tell."""
    try:
        recording = Recording(session)
        state = state_of(recording, recording.events())
        if state == WITHDRAWN:
            return "wanted their data deleted: visavis participant withdraw does it"
        if len(recording.trials()) or recording.status == "complete":
            return ""
        if damage_of(recording).is_damaged:
            return ""
        return f"holds no trial ({STATES[state]})"
    except (RecordingError, KeyError, OSError):
        return ""
