"""The privacy sheet of an export: every column and field that leaves, and what in them tells who
somebody is.
"""

import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from visavis.recording.reader import PART_COLUMN
from visavis.recording.sharing import CALENDAR_NS, SharedRecording, class_of_field

N_EXAMPLES: Final = 3
MAX_EXAMPLE: Final = 40
MIN_PEOPLE: Final = 5
"""Fewer people with the same answers about themselves are named as rare (k-anonymity)."""
ABOUT_PEOPLE: Final = "demographics"
"""The questionnaire whose answers are compared together; those to others one by one."""
DEVICE: Final = "device"
DEVICE_FACTS: Final = ("vendor", "model", "driver_version", "serial")
"""What an export says of a device."""
_E_MAIL: Final = re.compile(
    r"[^\s@<>]+(?:@|\s?[(\[{]\s?at\s?[)\]}]\s?)[^\s@<>]+\.[A-Za-z]{2,}", re.IGNORECASE
)
_DIGITS: Final = re.compile(r"(?<![\w.,:/-])[+(]{0,2}\d[\d ()./–-]{5,}\d(?![\w:])")
"""What may be a telephone number: digits and what people write between them."""
_OTHER_NUMBERS: Final = re.compile(
    r"\d{1,4}([./-])\d{1,2}\1\d{1,4}( \d{1,2})?|\d+\.\d+|(\d{1,3}\.){3}\d{1,3}"
)
"""Dates, decimal numbers and addresses of computers."""
_GROUPED: Final = re.compile(r"\(?\d{3}\)?[ .-]?\d{3}[ .-]\d{4}")
"""As numbers are written where they do not begin with 0, such as (415) 555-2671."""


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
    lines = tuple(
        SheetLine(where, name, kind, len(found), _examples(found))
        for (where, name, kind), found in sorted(values.items())
    )
    names = tuple(dict.fromkeys(map(_plain, names)))
    # One pseudonym in some three hundred happens to be digits alone; it calls nobody.
    pseudonyms = {recording.pseudonym for recording in recordings}
    findings = dict.fromkeys(
        f"{where}: {name} holds {what}: {_cut(text)!r}"
        for (where, name, _), found in sorted(values.items())
        if not where.startswith(DEVICE)
        for text in dict.fromkeys(t for value in found for t in _texts_in(value))
        if text not in pseudonyms
        for what in _identifying(text, names)
    )
    dated = [
        f"{where}: {name} tells the day on which somebody took part"
        for (where, name, _), found in sorted(values.items())
        if name.endswith("_ns") and any(_is_calendar(value) for value in found)
    ]
    rows = dict.fromkeys(_streams(recordings, dated))
    lines = tuple(sorted((*lines, *rows), key=lambda line: (line.where, line.name)))
    return PrivacySheet(lines, (*findings, *dict.fromkeys(dated)), tuple(_rare(recordings)))


def _streams(recordings: Sequence[SharedRecording], dated: list[str]) -> Iterator[SheetLine]:
    """Yield every field of every stream with examples; note in `dated` those that tell a day."""
    n_rows: Counter[tuple[str, str]] = Counter()
    examples: dict[tuple[str, str], list[str]] = defaultdict(list)
    for recording in recordings:
        for stream in recording.stream_names:
            where = f"stream {stream}"
            for name, column in recording.stream_arrays(stream).items():
                if name == PART_COLUMN:
                    continue
                n_rows[where, name] += len(column)
                if len(examples[where, name]) < N_EXAMPLES and len(column):
                    at = np.unique(np.linspace(0, len(column) - 1, N_EXAMPLES).astype(int))
                    examples[where, name] += [_number_text(column[i]) for i in at]
                if name.endswith("_ns") and len(column) and column.max() > CALENDAR_NS:
                    dated.append(f"{where}: {name} tells the day on which somebody took part")
    for (where, name), n in n_rows.items():
        yield SheetLine(where, name, "stream", n, _examples(examples[where, name]))


def _number_text(value: Any) -> str:
    """Return a sample as it is read best: numbers of several components between spaces."""
    return " ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in np.ravel(value).tolist())


def _values_of(recording: SharedRecording) -> Iterator[tuple[str, str, str, Any]]:
    """Yield where it stands, name, class and value of what leaves with a recording but streams."""
    manifest = recording.manifest
    for name in ("study", "participant", "session"):
        yield "session", name, "public", getattr(manifest, name)
    for device in (d for d in manifest.devices if isinstance(d, Mapping)):
        for name in DEVICE_FACTS:
            if device.get(name):
                yield f"{DEVICE} {device.get('role', '')}".strip(), name, "public", device[name]
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
    """Yield what in a text tells who somebody is; `names` are plain, as `_plain` makes them."""
    if _E_MAIL.search(text):
        yield "an e-mail address"
    if any(_is_telephone(found.group()) for found in _DIGITS.finditer(text)):
        yield "a telephone number"
    plain = _plain(text)
    for name in names:
        if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", plain):
            yield "a name of the ledger or key file"
            return


def _plain(text: str) -> str:
    """Return a text without differences in case and in how its letters are put together."""
    return unicodedata.normalize("NFKC", text).casefold()


def _is_telephone(text: str) -> bool:
    """Tell whether digits are grouped as in a telephone number, and are no other number."""
    text = text.strip()
    groups = re.findall(r"\d+", text)
    digits = "".join(groups)
    if _OTHER_NUMBERS.fullmatch(text) or not 7 <= len(digits) <= 15 or digits.startswith("000"):
        return False
    if _GROUPED.fullmatch(text):
        return True
    longest = max(map(len, groups))
    if longest == 2 and len(groups) != 5:  # as in France; else a list of small numbers
        return text.startswith("+") and len(groups) > 3
    is_prefixed = text.lstrip("(").startswith("+") or digits.startswith("0")
    return is_prefixed and longest > 1 and len(digits) >= 8


def _is_calendar(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) > CALENDAR_NS


def _rare(recordings: Sequence[SharedRecording]) -> Iterator[str]:
    """Yield answers about themselves that fewer than MIN_PEOPLE people give, and how many do.

    What demographics ask and the group are compared together; every other answer, and every text in
    trial rows that is one for each person, by itself.
    """
    people: dict[str, dict[str, str]] = {}
    others: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for recording in recordings:
        who = recording.manifest.participant
        about = people.setdefault(who, {})
        for name, question, answer in _answers(recording):
            if name == ABOUT_PEOPLE:
                about[question] = answer
            else:
                others[f"{name} {question}".strip()][who].add(answer)
        trials = recording.trials().drop(columns=[PART_COLUMN], errors="ignore")
        for column in map(str, trials.columns):
            values = {v for v in trials[column].dropna() if isinstance(v, str) and v}
            if column == "group" and values:
                about["group"] = min(values)
            elif values and column != "participant":
                others[f"trials {column}"][who] |= values
    counts = Counter(tuple(sorted(answers.items())) for answers in people.values() if answers)
    for combination, n in sorted(counts.items()):
        if n < MIN_PEOPLE:
            yield f"{', '.join(f'{k} {v}' for k, v in combination)}: {n}"
    for question, by_person in sorted(others.items()):
        if any(len(answers) > 1 for answers in by_person.values()):
            continue  # asked or varied within people: it tells of a trial, not of a person
        counts_of_values = Counter(next(iter(answers)) for answers in by_person.values())
        rare = [
            f"{_cut(value)} {n}" for value, n in sorted(counts_of_values.items()) if n < MIN_PEOPLE
        ]
        if rare and (len(counts_of_values) > 1 or len(people) > len(by_person)):
            yield f"{question}: {', '.join(rare)}"


def _answers(recording: SharedRecording) -> Iterator[tuple[str, str, str]]:
    """Yield questionnaire ("" within trials), question and answer of everything answered."""
    for event in recording.events().to_dict("records"):
        content = event["payload"]
        if event["name"] in ("answer", "answered") and content.get("answer") is not None:
            questionnaire = str(content.get("questionnaire") or "").partition("@")[0]
            yield questionnaire, str(content.get("question")), str(content["answer"])
