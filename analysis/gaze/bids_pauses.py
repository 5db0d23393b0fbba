"""Find where the user of a recorder paused it, in what other programs wrote of it into BIDS sets.

eye2bids keeps EyeLink's messages END and START in `_physioevents`. mne-bids fills a pause with
rows and marks it BAD_ACQ_SKIP in `_events.tsv`. Nothing was lost in a pause.
"""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from visavis.lab.foreign_text import decode_text
from visavis.lab.plain_files import read_packed, read_plain
from visavis.recording.bids_sidecar import sidecar_of

PHYSIO: Final = "_physio.tsv.gz"
FILLED: Final = "BAD_ACQ_SKIP"
Pauses = tuple[tuple[float, float], ...]


def pauses_in_set(path: Path, per_s: float) -> Pauses:
    """Return when the recorder of a `*_physio.tsv.gz` was paused, and when it went on.

    Both are in the unit of its stamps, of which a second has `per_s`. A table beside it that is
    missing, or says nothing of pauses, yields none.
    """
    events = path.with_name(path.name.replace(PHYSIO, "_physioevents.tsv.gz"))
    pauses: list[tuple[float, float]] = []
    is_of_eyelink = str(sidecar_of(path).get("Manufacturer", "")).upper().startswith("SR")
    if path.name.endswith(PHYSIO) and is_of_eyelink and events.exists():
        names = [str(c) for c in sidecar_of(events).get("Columns", ())]
        marks = [
            (str(row.get("message")), t)
            for row in _rows(decode_text(read_packed(events))[0], names)
            if (t := _number(row, "onset")) is not None
        ]
        pauses += [
            (before, after)
            for (ended, before), (begun, after) in pairwise(
                mark for mark in marks if mark[0] in ("START", "END")
            )
            if (ended, begun) == ("END", "START")
        ]
    head = path.name.partition("_recording-")[0].removesuffix(PHYSIO)
    task = path.with_name(f"{head}_events.tsv")
    if task.exists():
        text = decode_text(read_plain(task))[0]
        first, _, rest = text.partition("\n")
        for row in _rows(rest, first.strip().split("\t")):
            onset, duration = _number(row, "onset"), _number(row, "duration")
            if row.get("trial_type") == FILLED and onset is not None and duration is not None:
                pauses.append((onset * per_s, (onset + duration) * per_s))
    return tuple(sorted(pauses))


def _rows(text: str, names: list[str]) -> list[Mapping[str, str]]:
    lines = filter(str.strip, text.splitlines())
    return [dict(zip(names, line.split("\t"), strict=False)) for line in lines]


def _number(row: Mapping[str, Any], name: str) -> float | None:
    try:
        return float(row[name])
    except (KeyError, ValueError):
        return None
