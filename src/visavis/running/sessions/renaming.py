"""Correct somebody's identifier everywhere it stands: ledger, folder, manifests, key file, lists.

What was recorded stays as it is, byte for byte: only manifests, which name the participant, are
written anew. Tables and exports that were made before bear the former identifier and are named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from visavis.lab.clock import SystemClock
from visavis.lab.errors import LedgerError, UsageError
from visavis.protocol.people.exports_register import registered_exports
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.people.ledger import Ledger, Participant
from visavis.recording.lock import is_held
from visavis.recording.manifest import MANIFEST_NAME, read_manifest, write_manifest
from visavis.running.sessions.session_list import list_renaming


@dataclass(frozen=True)
class Renaming:
    """A corrected identifier: whose, what it was, how many sessions, and what still bears it."""

    person: Participant
    former: str
    sessions: int
    stale: tuple[str, ...]


def rename_participant(
    study: Path,
    ledger: Ledger,
    who: str,
    number: int,
    *,
    reason: str,
    author: str,
    key_file: KeyFile | None,
) -> Renaming:
    """Give somebody the number that was meant; an interrupted call is finished by repeating it.

    Raises:
        LedgerError: the number was issued already, or the participant withdrew.
        UsageError: a session of theirs is running, nothing is said why, or a folder is in the way.
    """
    if not reason.strip():
        raise UsageError("say why, for the ledger: --reason")
    for folder in _folders_named(study, ledger, who):
        running = [p.parent for p in folder.glob(f"ses-*/{MANIFEST_NAME}") if is_held(p.parent)]
        if running:
            raise UsageError(f"{running[0]} is running; end it first (Esc). Nothing was changed")
    person = ledger.rename(who, number, reason=" ".join(reason.split()), author=author)
    former = person.former_labels[-1]
    old, new = study / f"sub-{former}", study / f"sub-{person.label}"
    if old.exists() and new.exists():
        raise UsageError(f"{old} and {new} are both there; move the one that is not theirs away")
    # The folder moves first and whole; a manifest that lags behind is found by repeating.
    if old.exists():
        old.rename(new)
    sessions = sorted(path.parent for path in new.glob(f"ses-*/{MANIFEST_NAME}"))
    for session in sessions:
        manifest = read_manifest(session)
        if manifest.participant != person.label:
            write_manifest(session, replace(manifest, participant=person.label))
    list_renaming(study, former, person.label, SystemClock().wall_iso())
    if key_file is not None:
        key_file.rename(former, person.label)
    return Renaming(person, former, len(sessions), tuple(_stale(study, former)))


def _folders_named(study: Path, ledger: Ledger, who: str) -> Sequence[Path]:
    try:
        return (study / f"sub-{ledger.resolve(who).label}",)
    except LedgerError:
        return ()  # which is said by the ledger as it renames


def _stale(study: Path, former: str) -> list[str]:
    """Return what was made with the former identifier, as the register of exports knows it."""
    return [
        f"{export.what} of {export.at[:10]} in {export.where}"
        for export in registered_exports(study)
        if former in export.labels
    ]
