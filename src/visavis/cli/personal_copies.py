"""Rules for films, pages and pictures of recorded sessions: check before, protect after.

They are copies of a person's data, as exports are. So they are made from intact recordings, only
their owner can read them, and the study's register lets a withdrawal find them.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

from visavis.cli.app import say, verbatim
from visavis.lab.clock import SystemClock
from visavis.lab.errors import LedgerError
from visavis.protocol.people.exports_register import register_export
from visavis.recording.durable import protect_files
from visavis.recording.manifest import read_manifest
from visavis.running.sessions.damage import count_damage, describe, require_intact
from visavis.running.sessions.folder_check import is_study

RISK = (
    "movements of head and body identify people even without a name (Nair et al. 2023, of 55,000 "
    "people 94 % from 100 s): share them only as your consent form says"
)


def require_whole(session: Path, *, accept: bool) -> None:
    """Verify every file of a session before it is used; print what is missing.

    Raises:
        DataError: a file is damaged, and damage is not accepted.
    """
    reports = require_intact([session], accept=accept)
    if any(report.is_damaged for report in reports):
        say(f"[yellow]{verbatim(count_damage(reports, 1))}:\n{verbatim(describe(reports))}[/]")


def protect_and_register(
    what: str,
    sessions: Sequence[Path],
    where: Path,
    files: Iterable[Path],
    *,
    tells_risk: bool = True,
) -> None:
    """Protect new files made from sessions of one study, and register them with the study.

    The register names the kind of copy (`what`) and the folder that holds the files (`where`).
    """
    paths = tuple(files)
    protect_files(paths)
    study = sessions[0].resolve().parent.parent
    manifests = [read_manifest(session) for session in sessions]
    labels = sorted({manifest.participant for manifest in manifests})
    if is_study(study):
        try:
            register_export(study, SystemClock(), what, where, labels, paths)
        except LedgerError as error:  # an archive that can only be read
            say(f"[yellow]{verbatim(error)}[/]")
    if tells_risk and not all(manifest.is_simulated for manifest in manifests):
        say(f"[yellow]{RISK}[/]")
