"""Every place that a person's data reached, as a withdrawal prints it, and what it cannot reach."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from visavis.cli.app import console, say, say_plainly, verbatim
from visavis.lab.errors import LabError
from visavis.protocol.people.exports_register import Export
from visavis.protocol.people.withdrawal import Removal
from visavis.recording.reader import Recording
from visavis.running.page.other_hosts.results import IMPORT_KEY

N_HEX: Final = 16
"""Digits of a hash that are printed; the ledger keeps it whole."""
ALWAYS_BEYOND: Final = (
    "copies that were sent to others or published, also those of exports listed here",
    "backups of the data root, of the key file and of folders that exports were written to",
    "what was printed or copied by hand, without a command that registers it",
)
LSL_EVENT: Final = "lab_recorder_start"


def out_of_reach(sessions: Sequence[Path]) -> tuple[str, ...]:
    """Return what a withdrawal cannot reach, for these sessions of a person and for anybody's."""
    lines = []
    for session in sessions:
        with suppress(LabError):  # damaged: nothing says where else it was
            recording = Recording(session)
            configuration, name = recording.manifest.configuration, session.name
            if IMPORT_KEY in configuration:
                lines.append(
                    f"{name} came from a bundle: delete its run in JATOS, or the file it came in"
                )
            elif configuration.get("on") == "browser":
                lines.append(
                    f"{name} was at a page: that browser keeps what it had not sent until its "
                    "data of this site are cleared"
                )
            if (recording.events()["name"] == LSL_EVENT).any():
                lines.append(f"{name} was recorded by LabRecorder, too: delete its XDF file there")
    return (*lines, *ALWAYS_BEYOND)


def print_places(removal: Removal, exports: Sequence[Export]) -> None:
    """Print each place with what became of it and the beginning of its SHA-256."""
    for fate, path in removal.places():
        digest = removal.sha256.get(path, "")[:N_HEX]
        style = "" if fate == "removed" or "rows" in fate else "yellow"
        say_plainly(f"  {digest:{N_HEX}}  {fate}: {path}", style=style)
    for line in removal.unreached_exports:
        say(f"[yellow]not reached: {verbatim(line)}[/]")
    for export in exports:
        console.print(f"exported as {export.what} on {export.at[:10]} to {verbatim(export.where)}")
