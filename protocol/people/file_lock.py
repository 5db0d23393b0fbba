"""Let one process at a time change a file; the system drops the lock when a process dies."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock

from visavis.lab.errors import LedgerError, RecordingError
from visavis.recording.durable import make_folder, modes_in


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock file `path`, created when missing, waiting for whoever holds it.

    Raises:
        LedgerError: the file cannot be opened, or its disk knows no locks (some network drives).
    """
    # Never a lock that is only the file's presence: a process that dies would leave it held.
    try:
        make_folder(path.parent, exist_ok=True)
        lock = FileLock(path, mode=modes_in(path.parent).file, fallback_to_soft=False)
        lock.acquire()
    except RecordingError as error:
        raise LedgerError(f"{path} cannot be locked: {error}") from error
    except OSError as error:
        raise LedgerError(
            f"{path} cannot be locked: {error.strerror}; check that the folder is there, that you "
            "may write to it, and that its disk can lock files"
        ) from error
    try:
        yield
    finally:
        lock.release()
