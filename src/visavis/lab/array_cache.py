"""A cache of arrays in the user's cache folder, keyed by the hash of their inputs.

For results that take seconds to compute and follow from their inputs alone. Emptying the folder, or
not being able to write to it, costs time only. For each name the most recently used files are kept,
up to `MAX_CACHE_BYTES`.
"""

import hashlib
import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
from platformdirs import user_cache_path

from visavis.lab.plain_files import read_arrays

MAX_CACHE_BYTES = 200_000_000


def digest_of(*arrays: npt.NDArray[Any], text: str = "") -> str:
    """Return the SHA-256 of arrays and a text."""
    digest = hashlib.sha256(text.encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


@cache
def digest_of_code(package: ModuleType) -> str:
    """Return the SHA-256 of a package's code, for results that depend on its version."""
    digest = hashlib.sha256()
    for folder in package.__path__:
        for path in sorted(Path(folder).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def read_cache(name: str, key: str) -> dict[str, npt.NDArray[Any]] | None:
    """Return the cached arrays of a key; None when there are none or they cannot be read.

    `name` is the folder of the study or module that owns them.
    """
    path = _folder(name) / f"{key}.npz"
    try:
        arrays = read_arrays(path)
    except (OSError, ValueError):
        return None
    with suppress(OSError):
        path.touch()  # used last
    return arrays


def write_cache(name: str, key: str, what: dict[str, npt.NDArray[Any]]) -> None:
    """Store arrays under a key."""
    folder = _folder(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f"{key}.{os.getpid()}.part.npz"
        with part.open("wb") as file:
            np.savez(file, allow_pickle=False, **what)
        part.replace(folder / f"{key}.npz")
        _forget_oldest(folder)
    except OSError:
        return


def _forget_oldest(folder: Path) -> None:
    files = [(path, path.stat()) for path in folder.glob("*.npz")]
    kept_bytes = 0
    for path, is_there in sorted(files, key=lambda f: f[1].st_mtime_ns, reverse=True):
        kept_bytes += is_there.st_size
        if kept_bytes > MAX_CACHE_BYTES:
            path.unlink(missing_ok=True)


def _folder(name: str) -> Path:
    return user_cache_path("visavis", appauthor=False) / name
