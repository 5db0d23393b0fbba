"""Check what people coded against the sessions that they coded."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import LabError
from visavis.lab.spelling import spellings_of
from visavis.recording.annotations import ANNOTATIONS_NAME, Annotation, annotations_of
from visavis.recording.reader import Recording

TOLERANCE_NS: Final = NS_PER_MS
"""Times are saved by a page that counts in seconds."""


def coding_problems(person_folder: Path) -> list[str]:
    """Return what is wrong with a person's coded spans, by row: a session, part or trial that is
    not there, a span outside of its trial or after its part's end, one label in several spellings.
    """
    path = person_folder / ANNOTATIONS_NAME
    try:
        spans = annotations_of(person_folder)
    except LabError as error:
        return [str(error)]
    problems = [
        f"{path}, row {row}: {problem}"
        for session in sorted({one.session for one in spans})
        for row, problem in _of_session(person_folder, session, spans)
    ]
    rows: dict[str, int] = {}
    for row, one in enumerate(spans, start=2):
        rows.setdefault(one.label, row)
    for spelt in spellings_of(list(rows)).values():
        where = " and ".join(f"{label!r} in row {rows[label]}" for label in spelt)
        problems.append(f"{path}: one label is spelled differently, {where}; code it by one name")
    return problems


def _of_session(
    person_folder: Path, session: int, spans: Sequence[Annotation]
) -> Iterator[tuple[int, str]]:
    """Yield the row and the problem of every span of a session that cannot be true."""
    own = [(row, one) for row, one in enumerate(spans, start=2) if one.session == session]
    folder = person_folder / f"ses-{session:03d}"
    if not folder.is_dir():
        yield from ((row, f"there is no session {session}") for row, _ in own)
        return
    try:
        recording = Recording(folder)
        trials = recording.trials()
        ends_ns = {
            part.number: _end_ns(recording, part.number) for part in recording.manifest.parts
        }
    except LabError:  # which is among the session's own problems
        return
    for row, one in own:
        whose = person_folder.name.removeprefix("sub-")
        if one.participant != whose:
            yield row, f"it is about {one.participant}, in the folder of {whose}"
        elif one.recording_part not in ends_ns:
            yield row, f"session {session} has no part {one.recording_part}"
        elif (
            one.begin_ns < -TOLERANCE_NS or one.end_ns > ends_ns[one.recording_part] + TOLERANCE_NS
        ):
            yield row, f"the span is not within part {one.recording_part} of session {session}"
        elif one.trial_id and "t_start_ns" in trials:
            mine = trials[trials["recording_part"] == one.recording_part]
            mine = mine[mine["trial_id"].astype(str) == one.trial_id]
            begins = mine["t_start_ns"] - TOLERANCE_NS <= one.begin_ns
            if not (begins & (one.begin_ns <= mine["t_end_ns"] + TOLERANCE_NS)).any():
                yield row, f"the span does not begin within trial {one.trial_id}"


def _end_ns(recording: Recording, part: int) -> int:
    """Return the last session time that a part recorded."""
    times = [int(event["t_ns"]) for event in recording.journal(part).events]
    for name in recording.stream_names:
        t_ns = recording.stream_arrays(name, part=part).get("t_host_ns")
        times += [] if t_ns is None or not len(t_ns) else [int(t_ns[-1])]
    return max(times, default=0)
