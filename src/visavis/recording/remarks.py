"""Remarks of the lab on a person or a trial after the session: notes, and exclusions by hand.

They lie in the person's folder beside their sessions, in chained lines with a copy, so that a
withdrawal takes them, too; nothing recorded is changed by them.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, Literal, get_args

from visavis.lab.errors import RecordingError
from visavis.recording.chained import append_lines, read_lines

REMARKS_NAME: Final = "remarks.jsonl"
Kind = Literal["note", "exclude", "include"]


@dataclass(frozen=True)
class Remark:
    """What somebody remarked: a note, an exclusion, or that one is taken back ("include").

    `session` and `trial_id` say about what; 0 and "" mean everything of the person.
    """

    kind: Kind
    participant: str
    session: int
    trial_id: str
    text: str
    author: str
    at: str

    @property
    def about(self) -> tuple[int, str]:
        """What it is about: session and trial."""
        return self.session, self.trial_id


def add_remark(person_folder: Path, remark: Remark) -> None:
    """Add a remark to a person's folder; the caller keeps others from writing.

    Raises:
        RecordingError: the file is damaged or cannot be written.
    """
    try:
        append_lines(person_folder / REMARKS_NAME, [asdict(remark)])
    except (OSError, ValueError) as error:
        raise RecordingError(
            f"{person_folder / REMARKS_NAME} cannot be written ({error}); check the disk, or "
            "restore the file from a backup"
        ) from error


def remarks_of(person_folder: Path) -> tuple[Remark, ...]:
    """Return everything remarked on a person, in order.

    Raises:
        RecordingError: the file is damaged or cannot be read.
    """
    path = person_folder / REMARKS_NAME
    try:
        lines = read_lines(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read ({error}); check the disk") from error
    if lines.damaged_line is not None:
        number, why = lines.damaged_line
        raise RecordingError(f"{path}, line {number} {why}; restore it from a backup")
    names = set(Remark.__dataclass_fields__)
    own = {"participant": person_folder.name.removeprefix("sub-")}  # a label may be corrected
    remarks = [Remark(**{k: v for k, v in r.items() if k in names} | own) for r in lines.records]
    if any(remark.kind not in get_args(Kind) for remark in remarks):
        raise RecordingError(f"{path} is of a later version; read it with that version")
    return tuple(remarks)


def exclusions_in_force(remarks: tuple[Remark, ...]) -> tuple[Remark, ...]:
    """Return the exclusions that nobody took back, the latest of each trial or person."""
    latest = {r.about: r for r in remarks if r.kind != "note"}
    return tuple(r for r in latest.values() if r.kind == "exclude")


def reason_of(remark: Remark) -> str:
    """Return why somebody or something is left out, as tables and the report say it."""
    return f"by hand: {remark.text} ({remark.author}, {remark.at[:10]})"
