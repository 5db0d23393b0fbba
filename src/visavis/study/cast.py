"""Whose faces a session shows: as the lab's configuration says, kept with what is recorded."""

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
    """Let the configuration's people play; return what a session keeps of it, nothing without.

    Their files are laid beside the data, so that these can be drawn and measured elsewhere, too.

    Raises:
        DesignError: somebody of the cast is not there.
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
                _laid_beside(member, config.characters, beside)
    return {CAST_KEY: [{"name": m.name, "sha256": m.sha256} for m in members]}


def _laid_beside(member: Member, library: Path, beside: Path) -> None:
    path = beside / f"{member.name}.npz"
    if path.exists():
        if hashlib.sha256(path.read_bytes()).hexdigest() != member.sha256:
            raise UsageError(
                f"{path} is another file than the one in {library}; write this data elsewhere, "
                "or import the figure under another name"
            )
        return
    beside.mkdir(parents=True, exist_ok=True)
    # Sessions are simulated side by side: each writes a file of its own before the names meet.
    with NamedTemporaryFile(dir=beside, delete=False) as whole:
        whole.write((library / path.name).read_bytes())
    Path(whole.name).replace(path)


def use_recorded_cast(recording: Recording) -> None:
    """Let those play who did in a recorded session, from the lab's folder beside it.

    Raises:
        DataError: what the session says of them cannot be read.
        DesignError: this process shows a session with others already.
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
