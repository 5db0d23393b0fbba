"""Arrays kept between runs, in the computer's temporary files, under the hash of what they are.

For what takes seconds to find and follows from its inputs alone. Nothing is lost with a folder
that is emptied, or cannot be written to, but time.
"""

import hashlib
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt


def digest_of(*arrays: npt.NDArray[Any], said: str = "") -> str:
    """Return the SHA-256 of arrays and words."""
    found = hashlib.sha256(said.encode())
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def read_kept(name: str, key: str) -> dict[str, npt.NDArray[Any]] | None:
    """Return what was kept under a key; None when there is nothing or it cannot be read.

    `name` says whose it is.
    """
    try:
        with (
            (_folder(name) / f"{key}.npz").open("rb") as file,
            np.load(file, allow_pickle=False) as kept,
        ):
            return {name: kept[name] for name in kept.files}
    except (OSError, ValueError, zipfile.BadZipFile):
        return None


def keep(name: str, key: str, what: dict[str, npt.NDArray[Any]]) -> None:
    """Keep arrays under a key."""
    folder = _folder(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f"{key}.{os.getpid()}.part.npz"
        with part.open("wb") as file:
            np.savez(file, allow_pickle=False, **what)
        part.replace(folder / f"{key}.npz")
    except OSError:
        return


def _folder(name: str) -> Path:
    return Path(tempfile.gettempdir()) / f"visavis-{name}"
