"""Hold a session for one process at a time.

The operating system drops the lock when its process dies, however it dies, so a lock is never
stale. The lock file is empty, stands beside the session folder and is left there.
"""

import os
import sys
from pathlib import Path

from visavis.lab.errors import RecordingError, UsageError
from visavis.recording.durable import open_private, write_failure


def lock_path(session_dir: Path) -> Path:
    """Return where the lock of a session stands: beside its folder."""
    return session_dir.parent / f".{session_dir.name}.lock"


_WITHOUT_WAITING: int = getattr(os, "O_NONBLOCK", 0)
"""At a pipe, opening would wait for a writer."""
MAX_READERS = 64
"""How many may read a session at a time on Windows."""

if sys.platform == "win32":
    import msvcrt

    def _try_lock(fd: int, *, is_shared: bool) -> bool:
        """Lock one byte for reading, every byte for writing.

        Windows has exclusive locks only, so readers keep out of each other's way.
        """
        for place in range(MAX_READERS if is_shared else 1):
            os.lseek(fd, place, os.SEEK_SET)
            try:
                msvcrt.locking(fd, msvcrt.LK_NBLCK, 1 if is_shared else MAX_READERS)
            except OSError:
                continue
            return True
        return False

else:
    import fcntl

    def _try_lock(fd: int, *, is_shared: bool) -> bool:
        try:
            fcntl.flock(fd, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


class SessionLock:
    """The exclusive right to write to a session, from construction until `release`."""

    def __init__(self, session_dir: Path) -> None:
        path = lock_path(session_dir)
        try:
            self._fd: int | None = open_private(path, os.O_RDWR | os.O_CREAT)
        except OSError as error:
            raise write_failure(path, error) from error
        if not _try_lock(self._fd, is_shared=False):
            self.release()
            raise UsageError(
                f"session {session_dir} is in use by another Visavis process; "
                "end that one first, or run another session number"
            )

    def release(self) -> None:
        """Release the session; idempotent."""
        if self._fd is not None:
            fd, self._fd = self._fd, None
            os.close(fd)


def is_held(session_dir: Path) -> bool:
    """Tell whether some process, this one included, holds the session.

    Raises:
        RecordingError: something else stands where its lock does.
    """
    path = lock_path(session_dir)
    try:
        fd = os.open(path, os.O_RDONLY | _WITHOUT_WAITING)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be opened ({error.strerror}); it is an empty file that whoever records "
            "the session holds: delete it if nobody does"
        ) from error
    try:
        return not _try_lock(fd, is_shared=True)
    finally:
        os.close(fd)
