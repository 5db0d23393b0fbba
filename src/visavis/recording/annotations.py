"""Spans of a session that people coded afterwards: label, comment, who, from when to when.

They lie in `annotations.csv` in the person's folder beside their sessions, so that a withdrawal
takes them, too; nothing recorded is changed by them.
"""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Final

import pandas as pd

from visavis.lab.errors import DataError
from visavis.lab.foreign_text import require_csv
from visavis.lab.plain_files import read_plain
from visavis.recording.csv_file import unescape, write_csv

ANNOTATIONS_NAME: Final = "annotations.csv"


@dataclass(frozen=True)
class Annotation:
    """A coded span, from `begin_ns` to `end_ns` in session time of its part of the recording.

    `trial_id` is the trial in which it begins, "" between trials; `coder` who coded it.
    """

    participant: str
    session: int
    recording_part: int
    trial_id: str
    coder: str
    label: str
    begin_ns: int
    end_ns: int
    comment: str


COLUMNS: Final = tuple(f.name for f in fields(Annotation))


def read_annotations(path: Path) -> tuple[Annotation, ...]:
    """Return the spans of a file as the viewer's page saves it; other columns are passed over.

    Raises:
        DataError: the file cannot be read, a column is missing, or a row is no span.
    """
    try:
        text = read_plain(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path} cannot be read as UTF-8 text: {error}") from error
    require_csv(path, text)
    reader = csv.DictReader(text.splitlines())
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise DataError(
            f"{path} has no column {', '.join(missing)}; give the file that the page of "
            "visavis view saved"
        )
    return tuple(_span(path, number, row) for number, row in enumerate(reader, start=2))


def _span(path: Path, line: int, row: dict[str, str]) -> Annotation:
    texts = {name: unescape((row[name] or "").strip()) for name in COLUMNS}
    try:
        session, part, begin_ns, end_ns = (
            int(texts[name]) for name in ("session", "recording_part", "begin_ns", "end_ns")
        )
    except ValueError as error:
        raise DataError(
            f"{path}, line {line}: session, recording_part, begin_ns and end_ns are whole numbers; "
            f"{error}"
        ) from error
    if not begin_ns < end_ns:
        raise DataError(f"{path}, line {line}: the span ends before it begins, or at once")
    for name in ("participant", "coder", "label"):
        if not texts[name]:
            raise DataError(f"{path}, line {line}: {name} is empty")
    return Annotation(
        texts["participant"],
        session,
        part,
        texts["trial_id"],
        texts["coder"],
        texts["label"],
        begin_ns,
        end_ns,
        texts["comment"],
    )


def annotations_of(person_folder: Path) -> tuple[Annotation, ...]:
    """Return the spans coded in a person's sessions; none where nobody coded. Raises as
    `read_annotations`.
    """
    path = person_folder / ANNOTATIONS_NAME
    return read_annotations(path) if path.exists() else ()


def place_annotations(person_folder: Path, new: Sequence[Annotation]) -> Path:
    """Write spans of one person beside their sessions; return the file.

    They replace what the same coders had in the same sessions; others' spans stay.
    """
    new_keys = {(one.coder, one.session) for one in new}
    before = annotations_of(person_folder)
    rest = [one for one in before if (one.coder, one.session) not in new_keys]
    path = person_folder / ANNOTATIONS_NAME
    write_csv(table_of_annotations([*rest, *new]), path)
    return path


def table_of_annotations(spans: Iterable[Annotation]) -> pd.DataFrame:
    """Return spans as rows, by session, coder and time."""
    ordered = sorted(spans, key=lambda a: (a.session, a.coder, a.recording_part, a.begin_ns))
    return pd.DataFrame([asdict(one) for one in ordered], columns=list(COLUMNS))
