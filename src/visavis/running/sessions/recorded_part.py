"""Record a part of a session, and close it however it ends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from visavis.lab.clock import Clock
from visavis.lab.errors import ConfigError, RecordingError, SessionAborted
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.recording.folder import SessionFolder
from visavis.recording.journal import as_json
from visavis.recording.reader import Recording
from visavis.recording.writer import (
    REAL_TIME_BATCH_NS,
    VIRTUAL_TIME_BATCH_NS,
    CloseStatus,
    Recorder,
)
from visavis.running.sessions.session_list import list_session


def recorder_of(
    part_dir: Path, clock: Clock, *, is_simulated: bool, awaits_disk: bool = False
) -> Recorder:
    """Return the recorder of a part, in a thread and with short batches in real time."""
    return Recorder(
        part_dir,
        clock,
        threaded=not clock.is_virtual,
        max_batch_ns=VIRTUAL_TIME_BATCH_NS if clock.is_virtual else REAL_TIME_BATCH_NS,
        is_simulated=is_simulated,
        awaits_disk=awaits_disk,
    )


@contextmanager
def recorded_part(
    clock: Clock, folder: SessionFolder, make: Callable[[Path], Recorder], what_is_kept: str
) -> Iterator[Recorder]:
    """Record a part of a session; files and manifest say how the block ended.

    `make` gets the part's folder; `what_is_kept` ends the message after an interruption.

    Raises:
        SessionAborted: it ended early.
    """
    part_dir = begin_part(clock, folder)
    recorder: Recorder | None = None
    try:
        recorder = make(part_dir)
        yield recorder
    except KeyboardInterrupt as error:
        reason = "interrupted from the keyboard or by the system"
        end_part(clock, folder, recorder, "aborted", reason, error)
        raise SessionAborted(f"{reason}; {what_is_kept}") from error
    except SessionAborted as error:
        end_part(clock, folder, recorder, "aborted", str(error).partition(";")[0], error)
        raise
    except BaseException as error:
        end_part(clock, folder, recorder, "aborted", str(error) or repr(error), error)
        raise
    end_part(clock, folder, recorder, "complete", "", None)


def begin_part(clock: Clock, folder: SessionFolder) -> Path:
    """Put a session on its study's list, begin a part of it, and return the part's folder.

    Raises:
        RecordingError: the list is damaged or cannot be written; nothing was begun.
    """
    number = 1 + max((p.number for p in folder.manifest.parts), default=0)
    list_session(folder.path, number, "running", clock.wall_iso())
    return folder.begin_part(clock)


def end_part(
    clock: Clock,
    folder: SessionFolder,
    recorder: Recorder | None,
    status: CloseStatus,
    reason: str,
    cause: BaseException | None,
) -> None:
    """Close files and manifest; a failure here never hides an earlier error."""
    try:
        summary = recorder.close(status) if recorder is not None else None
        folder.end_part(clock, summary, reason=reason)
    except RecordingError as error:
        if cause is None:
            raise
        cause.add_note(str(error))
        return
    # The session is whole without this line, and its beginning is on the list; check reports a
    # list that cannot be written.
    with suppress(RecordingError):
        part = folder.manifest.parts[-1]
        list_session(folder.path, part.number, part.status, part.ended_wall_iso or "")


def refuse_other_plan(recording: Recording, plan: SessionPlan) -> None:
    """Refuse to go on with a session whose plan this version would not make.

    Raises:
        ConfigError: naming the session.
    """
    if as_json(plan) != recording.manifest.plan:
        raise ConfigError(
            f"{recording.path}: the plan recorded with this session differs from the plan this "
            "version of Visavis makes; check out the version named in manifest.json "
            "(provenance) and resume with that"
        )
