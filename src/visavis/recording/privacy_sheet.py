"""The privacy sheet of an export: every column and field that leaves, and what in them tells who
somebody is.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import pandas as pd

from visavis.recording.reader import PART_COLUMN
from visavis.recording.sharing import CALENDAR_NS, SharedRecording, class_of_field

N_EXAMPLES: Final = 3
MAX_EXAMPLE: Final = 40
MIN_PEOPLE: Final = 5
"""Fewer people with the same answers about themselves are named as rare (k-anonymity)."""
ABOUT_PEOPLE: Final = "demographics"
"""The questionnaire whose answers are compared for rare combinations."""
_PATTERNS: Final = {
    "an e-mail address": re.compile(r"[^\s@<>]+@[^\s@<>]+\.[A-Za-z]{2,}"),
    "a telephone number": re.compile(r"(?<![\w.])(?:\+|00?)[\d(][\d\s()/-]{6,}\d"),
}


@dataclass(frozen=True)
class SheetLine:
    """One column or field: where it stands, its class, how many values leave, and examples.

    The class is public, answer, private (of which nothing leaves but in the raw tier), "stream",
    or "unknown" of what nobody declared.
    """

    where: str
    name: str
    kind: str
    values: int
    examples: tuple[str, ...]


@dataclass(frozen=True)
class PrivacySheet:
    """All that leaves, what was found in it, and combinations of answers that few people give."""

    lines: tuple[SheetLine, ...]
    findings: tuple[str, ...]
    rare: tuple[str, ...]


def privacy_sheet(
    recordings: Sequence[SharedRecording], names: Collection[str] = ()
) -> PrivacySheet:
    """Return what of these recordings leaves as they are shared.

    `names` are those of people (names, contacts, labels) that must not be in any text.
    """
    values: dict[tuple[str, str, str], list[Any]] = {}
    for recording in recordings:
        for where, name, kind, value in _values_of(recording):
            values.setdefault((where, name, kind), []).append(value)
        for stream in recording.stream_names:
            schema = recording.stream_schema(stream)
            for field in () if schema is None else schema.fields:
                values.setdefault((f"stream {stream}", field.name, "stream"), [])
    lines = tuple(
        SheetLine(where, name, kind, len(found), _examples(found))
        for (where, name, kind), found in sorted(values.items())
    )
    findings = dict.fromkeys(
        f"{where}: {name} holds {what}: {_cut(text)!r}"
        for (where, name, _), found in sorted(values.items())
        for text in dict.fromkeys(t for value in found for t in _texts_in(value))
        for what in _identifying(text, names)
    )
    dated = [
        f"{where}: {name} tells the day on which somebody took part"
        for (where, name, _), found in sorted(values.items())
        if name.endswith("_ns") and any(_is_calendar(value) for value in found)
    ]
    return PrivacySheet(lines, (*findings, *dated), tuple(_rare(recordings)))


def _values_of(recording: SharedRecording) -> Iterator[tuple[str, str, str, Any]]:
    """Yield where it stands, name, class and value of everything that leaves with a recording."""
    trials = recording.trials()
    for name in trials.columns:
        column = trials[name]
        for value in column[column.notna()]:
            yield "trials", str(name), "public", value
    for event in recording.events().to_dict("records"):
        yield "events", "t_ns", "public", event["t_ns"]
        for field, value in event["payload"].items():
            if value is not None:
                kind = class_of_field(event["name"], field) or "unknown"
                yield f"event {event['name']}", str(field), kind, value


def _examples(values: Iterable[Any]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(_cut(str(value)) for value in values))[:N_EXAMPLES]


def _cut(text: str) -> str:
    return text if len(text) <= MAX_EXAMPLE else f"{text[: MAX_EXAMPLE - 1]}…"


def _texts_in(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield str(key)
            yield from _texts_in(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _texts_in(inner)


def _identifying(text: str, names: Collection[str]) -> Iterator[str]:
    """Yield what in a text tells who somebody is."""
    yield from (what for what, pattern in _PATTERNS.items() if pattern.search(text))
    for name in names:
        if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text, re.IGNORECASE):
            yield "a name of the ledger or key file"
            return


def _is_calendar(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) > CALENDAR_NS


def _rare(recordings: Sequence[SharedRecording]) -> Iterator[str]:
    """Yield each combination of answers about themselves that fewer than MIN_PEOPLE people give."""
    people: dict[str, dict[str, str]] = {}
    for recording in recordings:
        answers = people.setdefault(recording.manifest.participant, {})
        events = recording.events()
        for payload in events.loc[events["name"] == "answer", "payload"]:
            if str(payload.get("questionnaire")).partition("@")[0] == ABOUT_PEOPLE:
                answers[str(payload.get("question"))] = str(payload.get("answer"))
        trials = recording.trials().drop(columns=[PART_COLUMN], errors="ignore")
        if "group" in trials and len(trials) and pd.notna(trials["group"].iloc[0]):
            answers["group"] = str(trials["group"].iloc[0])
    counts = Counter(tuple(sorted(answers.items())) for answers in people.values() if answers)
    for combination, n in sorted(counts.items()):
        if n < MIN_PEOPLE:
            yield f"{', '.join(f'{k} {v}' for k, v in combination)}: {n}"
