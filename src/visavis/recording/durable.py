"""Write files that survive a crash: unbuffered, synced, replaced atomically."""

import errno
import hashlib
import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from visavis.lab.errors import RecordingError
from visavis.lab.plain_files import open_plain

_ADVICE = {
    errno.ENOSPC: "the disk is full: free some space, then resume the session",
    errno.EDQUOT: "the disk quota is used up: free some space, then resume the session",
    errno.EFBIG: "the file reached the largest size allowed here: raise the limit, then resume",
    errno.EROFS: "the disk is read-only: set data_root to a writable folder",
    errno.EACCES: "permission denied: set data_root to a folder you may write to",
    errno.EPERM: "not permitted: set data_root to a folder you may write to",
    errno.ENOENT: "the folder is gone: reconnect the disk or set another data_root, then resume",
    errno.EIO: "the disk reports a fault: save what is there and record on another disk",
    errno.ENOTDIR: "a file is in the place of a folder: move it or set another data_root",
    errno.ENAMETOOLONG: "the path is too long for this disk: choose a shorter data_root",
}


def write_failure(path: Path, error: OSError) -> RecordingError:
    """Return the error that names the file, the cause and what to do."""
    advice = _ADVICE.get(error.errno or 0, "check the disk, then resume the session")
    return RecordingError(f"cannot write {path}: {error.strerror or error}; {advice}")


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable; nothing to do where folders cannot be synced."""
    if os.name == "nt":
        return
    fd = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


@dataclass(frozen=True)
class Modes:
    """Access modes of a folder and of the files in it."""

    folder: int
    file: int

    @property
    def read_only(self) -> int:
        """The mode of a finished, read-only file."""
        return self.file & 0o444


PRIVATE = Modes(0o700, 0o600)
GROUP = Modes(0o2770, 0o660)


def modes_in(folder: Path) -> Modes:
    """Return the modes of what is made in a folder: for its owner alone.

    In a folder whose group is handed on (setgid, as `share_with_group` sets it), also for the
    group. On Windows, where access is inherited, modes change nothing.
    """
    try:
        return GROUP if folder.stat().st_mode & stat.S_ISGID else PRIVATE
    except OSError:
        return PRIVATE


def share_with_group(folder: Path, group: str) -> None:
    """Let a group read and write a folder and all that is made in it from now on.

    Raises RecordingError when there is no such group, or you are not in it.
    """
    try:
        if sys.platform != "win32":
            if modes_in(folder) is GROUP and folder.group() == group:
                return  # another of the group made it, and only that one may change it
            shutil.chown(folder, group=group)
            folder.chmod(GROUP.folder)
            if not folder.stat().st_mode & stat.S_ISGID:
                raise PermissionError(errno.EPERM, "you are not in it")
    except (LookupError, OSError) as error:
        raise RecordingError(
            f"{folder} cannot be given to the group {group!r}: {error}; correct privacy.group in "
            "the lab's configuration, or have an administrator add you to the group"
        ) from error


def protect(root: Path) -> None:
    """Remove the access of others to a folder and everything in it; links are left alone."""
    if os.name == "nt":
        return
    modes = modes_in(root)
    for folder, _, files in os.walk(root):
        Path(folder).chmod(modes.folder)
        protect_files([Path(folder, name) for name in files])


def protect_files(files: Iterable[Path]) -> None:
    """Remove the access of others to files just written; links are left alone."""
    for path in files if os.name != "nt" else ():
        if not path.is_symlink():
            modes = modes_in(path.parent)
            path.chmod(modes.file if path.stat().st_mode & 0o200 else modes.read_only)


def make_folder(folder: Path, *, exist_ok: bool = False) -> None:
    """Create a folder and its parents, durably and private; raises RecordingError with advice."""
    try:
        missing = [folder, *folder.parents]
        present = next(i for i, p in enumerate(missing) if p.exists())
        modes = modes_in(missing[present])
        if present == 0:
            folder.mkdir(exist_ok=exist_ok)
        for new in reversed(missing[:present]):
            new.mkdir(mode=modes.folder, exist_ok=exist_ok or new != folder)
            if os.name != "nt":
                new.chmod(modes.folder)
        for parent in missing[1 : present + 1]:
            sync_folder(parent)
    except FileExistsError as error:
        raise RecordingError(f"{folder} exists already; nothing was overwritten") from error
    except OSError as error:
        raise write_failure(folder, error) from error


def replace_file(path: Path, data: bytes) -> None:
    """Put `data` at `path` atomically: a reader sees the old or the new file, never a mixture."""
    temporary = path.with_name(path.name + ".new")
    try:
        _write_durably(open_private(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), data)
        os.replace(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        raise write_failure(path, error) from error


def replace_secret(path: Path, data: bytes) -> None:
    """Put `data` at `path` atomically, readable for its owner alone; raises OSError."""
    temporary = path.with_name(f".{path.name}.new")
    temporary.unlink(missing_ok=True)
    fd = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, PRIVATE.file)
    try:
        _write_durably(fd, data)
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)  # it may hold half of the secret
        raise


def add_to_file(path: Path, data: bytes) -> None:
    """Add to the end of a file and wait for the disk; raises OSError, maybe with a part added."""
    _write_durably(open_private(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND), data)


def _write_durably(fd: int, data: bytes) -> None:
    """Write into an open file, wait for the disk, and close it; raises OSError."""
    try:
        _write_all(fd, memoryview(data))
        os.fsync(fd)
    finally:
        os.close(fd)


def open_private(path: Path, flags: int) -> int:
    """Open a file that none but its owner, or its folder's group, can read; raises OSError."""
    modes = modes_in(path.parent)
    is_new = not path.exists()
    fd = os.open(path, flags | _BINARY, modes.file)
    if is_new and modes is GROUP:  # which the umask may have cut down
        path.chmod(modes.file)
    return fd


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with open_plain(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_BINARY: int = getattr(os, "O_BINARY", 0)
_sync_data: Callable[[int], None] = getattr(os, "fdatasync", os.fsync)


def _write_all(fd: int, data: memoryview) -> None:
    while data:
        data = data[os.write(fd, data) :]


class AppendOnlyFile:
    """A new file that only grows, written without buffering, hashed on the way."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = 0
        self._hash = hashlib.sha256()
        self.needs_sync = False
        self._fd: int | None = None
        try:
            self._fd = open_private(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        except FileExistsError as error:
            raise RecordingError(
                f"{path} exists already and raw files are never overwritten; "
                "resume the session, which begins a new part"
            ) from error
        except OSError as error:
            raise write_failure(path, error) from error

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Append; raises RecordingError with advice, and then the file ends in a torn piece."""
        view = memoryview(data)
        try:
            _write_all(self._open_fd(), view)
        except OSError as error:
            raise write_failure(self.path, error) from error
        self._hash.update(view)
        self.size += view.nbytes
        self.needs_sync = True

    def sync(self) -> None:
        """Return once everything written is on the disk and the file still has its name."""
        if not self.needs_sync:
            return
        fd = self._open_fd()
        try:
            _sync_data(fd)
            is_deleted = os.fstat(fd).st_nlink == 0
        except OSError as error:
            raise write_failure(self.path, error) from error
        if is_deleted:
            raise write_failure(self.path, FileNotFoundError(errno.ENOENT, "it was deleted"))
        self.needs_sync = False

    def close(self) -> None:
        """Close and make the file read-only; idempotent."""
        if self._fd is None:
            return
        fd, self._fd = self._fd, None
        os.close(fd)
        if os.name != "nt" and self.path.exists():
            self.path.chmod(modes_in(self.path.parent).read_only)

    def sha256(self) -> str:
        """Return the SHA-256 of what was written."""
        return self._hash.hexdigest()

    def _open_fd(self) -> int:
        if self._fd is None:
            raise RecordingError(f"{self.path} is closed; begin a new part to record more")
        return self._fd
