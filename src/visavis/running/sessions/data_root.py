"""The folder a lab records in: made for those who may see its data, with space for a session."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from visavis.lab.config import LabConfig
from visavis.lab.errors import RecordingError
from visavis.recording.durable import make_folder, share_with_group

GB = 1e9
MIN_FREE_GB = 2.0
"""Free space below which no session is begun; a long one with 1 kHz gaze takes a third of it."""


@dataclass(frozen=True)
class DataDisk:
    """The disk that a lab records on: its free space, and a problem with its remedy.

    `problem` is empty if a session can be recorded; `free_gb` is None if it is unknown.
    """

    free_gb: float | None
    problem: str = ""
    remedy: str = ""


def data_disk(lab: LabConfig) -> DataDisk:
    """Look at the disk of the data root, which need not be there yet; nothing is written."""
    place = _nearest(lab.data_root)
    another = "set data_root to a folder that you may write to"
    if not place.is_dir():
        return DataDisk(
            None, f"{place} is a file where a folder is needed", f"move it, or {another}"
        )
    if not os.access(place, os.W_OK):
        return DataDisk(None, f"{place} cannot be written", another)
    size = shutil.disk_usage(place)
    if not size.total:  # a file system of the kernel's own
        return DataDisk(None, f"{place} keeps no files", another)
    free_gb = size.free / GB
    if free_gb < MIN_FREE_GB:
        problem = f"{free_gb:.1f} GB are free for {lab.data_root}, a session needs {MIN_FREE_GB:g}"
        return DataDisk(free_gb, problem, "free some space before any session")
    return DataDisk(free_gb)


def require_space(lab: LabConfig) -> None:
    """Refuse to begin or to go on with a session that the disk could not keep.

    Raises:
        RecordingError: the disk is all but full, or cannot be written.
    """
    disk = data_disk(lab)
    if disk.problem:
        raise RecordingError(f"{disk.problem}; {disk.remedy} ({lab.path}: data_root)")


def prepare_data_root(lab: LabConfig) -> None:
    """Make the data root, where it is missing, for its owner or for the lab's group.

    Raises:
        RecordingError: it cannot be made, or there is no such group.
    """
    make_folder(lab.data_root, exist_ok=True)
    if lab.privacy.group:
        share_with_group(lab.data_root, lab.privacy.group)


def _nearest(folder: Path) -> Path:
    return next(place for place in (folder, *folder.parents) if os.path.lexists(place))
