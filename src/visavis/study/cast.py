"""The faces a session shows: set in the lab's configuration and stored with the recording."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, Final

from visavis.lab.config import CHARACTERS, LabConfig
from visavis.lab.errors import DataError, UsageError
from visavis.recording.reader import Recording
from visavis.stimuli.dressing.casting import Member, members_of, use_cast

CAST_KEY: Final = "cast"


def use_cast_of(config: LabConfig) -> dict[str, Any]:
    """Use the cast of the configuration; return its entry for the session, empty without a cast.

    Their files are copied beside the data, so that sessions can be drawn and measured elsewhere,
    too.

    Raises:
        DesignError: a member of the cast does not exist.
        UsageError: another file of that name lies beside the data.
    """
    members = members_of(config.cast, config.path.parent, config.characters)
    use_cast(members, config.characters)
    if not members:
        return {}
    beside = config.data_root / CHARACTERS
    if beside.resolve() != config.characters.resolve():
        for member in members:
            if member.sha256:
                _copy_beside(member, config.characters, beside)
    return {CAST_KEY: [{"name": m.name, "sha256": m.sha256} for m in members]}


def _copy_beside(member: Member, library: Path, beside: Path) -> None:
    path = beside / f"{member.name}.npz"
    if path.exists():
        if hashlib.sha256(path.read_bytes()).hexdigest() != member.sha256:
            raise UsageError(
                f"{path} is another file than the one in {library}; write this data elsewhere, "
                "or import the figure under another name"
            )
        return
    beside.mkdir(parents=True, exist_ok=True)
    # Sessions are simulated in parallel: each writes a temporary file before it gets its name.
    with NamedTemporaryFile(dir=beside, delete=False) as whole:
        whole.write((library / path.name).read_bytes())
    Path(whole.name).replace(path)


def use_recorded_cast(recording: Recording) -> None:
    """Use the cast of a recorded session, from the lab's folder beside it.

    Raises:
        DataError: the session's entry about its cast cannot be read.
        DesignError: this process already shows a session with another cast.
    """
    entries = recording.manifest.configuration.get(CAST_KEY, [])
    use_cast(tuple(_member(recording, entry) for entry in entries), _library(recording.path))


def _member(recording: Recording, entry: Mapping[str, str]) -> Member:
    try:
        return Member(entry["name"], entry["sha256"])
    except (TypeError, KeyError) as problem:
        raise DataError(f"{recording.path}: its manifest's cast cannot be read") from problem


def _library(session: Path) -> Path:
    """Return the characters of the data root a session lies in: …/simulated/STUDY/sub/ses."""
    parents = session.resolve().parents
    return parents[min(3, len(parents) - 1)] / CHARACTERS
