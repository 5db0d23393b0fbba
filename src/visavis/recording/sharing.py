"""A recording prepared for sharing: pseudonym, no free text, ages in bands, motion blurred."""

import csv
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np
import pandas as pd

from visavis.recording.blurring import (
    BLURRED_STREAMS,
    blurred_body,
    blurred_gaze,
    blurred_head,
    blurred_targets,
    has_reference,
    heights_m,
    kind_of,
    segments_of,
    tells_length,
)
from visavis.recording.reader import PART_COLUMN, Recording
from visavis.recording.stream_file import Columns, StreamContent

Tier: TypeAlias = Literal["raw", "shared", "public"]
TIERS: Final[tuple[Tier, ...]] = ("raw", "shared", "public")

TextRule: TypeAlias = Callable[[str, str], bool]
"""Returns whether the answer to a question (questionnaire, question) is free text."""

RowRule: TypeAlias = Callable[[str, Any], bool]
"""Returns whether a value may leave: by the name of its trial column or question, and itself."""

AGE_BAND_YEARS: Final = 10
TYPED_FIELDS: Final = ("text", "reason", "message")
"""What the operator or participant typed, by its name in trial rows."""

CALENDAR_NS: Final = 10**17
"""Session times beyond three years count from 1970: they tell when somebody took part."""
ANY: Final = "*"
"""Stands for every field of an event, and for every event."""
_AGE = re.compile(r"(.*[._])?age")


def _read_classes() -> Mapping[str, Mapping[str, str]]:
    """Return the class of every field of every event: public, private, or answer."""
    classes: dict[str, dict[str, str]] = {}
    with Path(__file__).with_name("event_classes.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            fields = classes.setdefault(row["event"], {})
            for field in row["fields"].split():
                fields[field] = row["class"]
    return classes


EVENT_CLASSES: Final = _read_classes()
"""What of an event may leave the laboratory, by event and field; what is not here does not."""


def class_of_field(event: str, field: str) -> str:
    """Return whether a field of an event is "public", "private" or an "answer"; "" if unknown."""
    fields = EVENT_CLASSES.get(event, {})
    return fields.get(field) or fields.get(ANY, "")


@dataclass(frozen=True)
class Sharing:
    """How a recording is shown: `label` in the place of the participant's own.

    In the tier "raw" nothing else changes. In the others times that count from 1970, as those of
    imported sessions do, count from the session's first event. In "shared" only that leaves of
    which somebody says what it is: fields of events by `EVENT_CLASSES`, answers to questionnaires
    by `is_text`, values of trial rows and answers within trials by `leaves`. Free text is missing
    and ages are bands of ten years; so they are in "public". With `blurs`, as "public" has it,
    motion is blurred (`visavis.recording.blurring`): streams that cannot be are left out, and
    lengths of the body in trial rows and events are missing.
    """

    label: str
    tier: Tier
    is_text: TextRule
    leaves: RowRule = lambda name, value: False
    blurs: bool = False


class SharedRecording(Recording):
    """A session folder, read only, as `sharing` shows it; files are the same."""

    def __init__(self, path: Path, sharing: Sharing) -> None:
        super().__init__(path)
        self.sharing = sharing
        self._own = self.manifest.participant
        self.withheld: set[str] = set()
        """Names of trial columns and events read so far that may not leave."""
        self._blurred_streams: dict[tuple[int, str], StreamContent] = {}
        self._medians_m: dict[str, float] = {}
        parts = self.manifest.parts
        if self._hides:
            parts = tuple(replace(part, reason="") for part in parts)
        self.manifest = replace(self.manifest, participant=sharing.label, parts=parts)

    def events(self) -> pd.DataFrame:
        """Return all events as shown; see `Recording.events`."""
        events = super().events()
        payloads = [
            self._payload(name, payload)
            for name, payload in zip(events["name"], events["payload"], strict=True)
        ]
        return events.assign(
            t_ns=[self._shifted("t_ns", t_ns) for t_ns in events["t_ns"]],
            payload=pd.Series(payloads, index=events.index, dtype=object),
        )

    def trials(self) -> pd.DataFrame:
        """Return the trial rows as shown; see `Recording.trials`."""
        rows = [
            {PART_COLUMN: p.number, **t["row"]}
            for p in self.manifest.parts
            for t in self.trial_entries(p.number)
        ]
        return pd.DataFrame(rows) if rows else super().trials()

    def trial_entries(self, part: int) -> tuple[dict[str, Any], ...]:
        """Return a part's trial rows as shown; see `Recording.trial_entries`."""
        return tuple(
            {**t, "t_ns": self._shifted("t_ns", t["t_ns"]), "row": self._row(t["row"])}
            for t in super().trial_entries(part)
        )

    @cached_property
    def _zero_ns(self) -> int:
        """The session's first event, where its times tell a day; 0 where they do not."""
        events = (e for p in self.manifest.parts for e in self._journal(p.number).events)
        first_ns = min((int(event["t_ns"]) for event in events), default=0)
        return first_ns if self._hides and first_ns > CALENDAR_NS else 0

    def _shifted(self, name: str, value: Any) -> Any:
        """Return a value as shared: a time that counts from the session's first event."""
        is_time = name.endswith("_ns") and isinstance(value, int | float)
        return value - self._zero_ns if is_time and value > CALENDAR_NS else value

    def _names(self, number: int) -> tuple[str, ...]:
        names = super()._names(number)
        return tuple(n for n in names if self._kind(number, n)) if self.sharing.blurs else names

    def _kind(self, number: int, name: str) -> str | None:
        schema = super()._state(number, name).schema
        kind = "as_it_is" if schema is None else kind_of(schema)
        if kind == "body" and schema is not None and not has_reference(segments_of(schema)):
            return None
        return kind

    def _content(self, number: int, name: str, *, with_columns: bool = True) -> StreamContent:
        if not (self.sharing.blurs and with_columns):
            return self._dated_anew(super()._content(number, name, with_columns=with_columns))
        if (number, name) not in self._blurred_streams:
            content = self._dated_anew(super()._content(number, name))
            self._blurred_streams[number, name] = replace(
                content, columns=self._blur(number, name, content)
            )
        return self._blurred_streams[number, name]

    def _dated_anew(self, content: StreamContent) -> StreamContent:
        """Return a stream whose times tell no day: they count from the session's first event."""
        if not self._zero_ns:
            return content
        columns = {
            name: values - self._zero_ns if name in ("t_host_ns", "t_device_ns") else values
            for name, values in content.columns.items()
        }
        return replace(content, columns=columns)

    def _blur(self, number: int, name: str, content: StreamContent) -> Columns:
        columns, schema = content.columns, content.schema
        kind = None if schema is None else kind_of(schema)
        if schema is None or kind not in BLURRED_STREAMS or not content.n_rows:
            return columns
        if kind == "head":
            return blurred_head(columns, self._median_m(name))
        if kind == "body":
            return blurred_body(columns, segments_of(schema), self._median_m(name))
        if kind == "gaze":
            return blurred_gaze(columns)
        gaze, head = (self._first(number, kind_of_stream) for kind_of_stream in ("gaze", "head"))
        return blurred_targets(columns, gaze, head)

    def _median_m(self, name: str) -> float:
        """Return the median height of a stream's first point, over all parts as recorded."""
        if name not in self._medians_m:
            parts = [
                super(SharedRecording, self)._content(p.number, name)
                for p in self._parts_with(name)
            ]
            heights = [heights_m(content.columns) for content in parts if content.n_rows]
            valid_m = np.concatenate(heights) if heights else np.zeros(0)
            self._medians_m[name] = float(np.median(valid_m)) if len(valid_m) else float("nan")
        return self._medians_m[name]

    def _first(self, number: int, kind: str) -> Columns | None:
        """Return the first stream of a kind that a part has, as shown."""
        for name in self._names(number):
            if self._kind(number, name) == kind:
                return self._content(number, name).columns
        return None

    def _row(self, row: Mapping[str, Any]) -> dict[str, Any]:
        public = {name: self._shifted(name, self._relabel(v)) for name, v in row.items()}
        if self._hides:
            public = {name: self._value(name, value) for name, value in public.items()}
        if self.sharing.blurs:
            public |= {name: None for name in row if tells_length(name)}
        return public

    def _value(self, name: str, value: Any) -> Any:
        """Return a value of a trial row, or an answer within a trial, as it may leave."""
        if value is None or name in TYPED_FIELDS:
            return None
        if not self.sharing.leaves(name, value):
            self.withheld.add(f"column {name}")
            return None
        return age_band(value) if _AGE.fullmatch(name) else value

    def _payload(self, name: str, payload: Mapping[str, Any]) -> dict[str, Any]:
        public = {k: self._shifted(k, self._relabel(v)) for k, v in payload.items()}
        if self.sharing.blurs:
            public |= {k: None for k in public if tells_length(k)}
        if not self._hides:
            return public
        for field in public:
            match class_of_field(name, field):
                case "public":
                    pass
                case "answer" if "questionnaire" in payload:
                    public[field] = self._answer(payload)
                case "answer":
                    public[field] = self._value(str(payload.get("question")), public[field])
                case "private":
                    public[field] = None
                case _:
                    self.withheld.add(f"event {name}: {field}")
                    public[field] = None
        return public

    def _answer(self, payload: Mapping[str, Any]) -> Any:
        questionnaire, question, answer = (
            payload.get(k) for k in ("questionnaire", "question", "answer")
        )
        if answer is None:
            return None
        if _AGE.fullmatch(str(question)):
            return age_band(answer)
        name = str(questionnaire).partition("@")[0]
        return None if self.sharing.is_text(name, str(question)) else answer

    @property
    def _hides(self) -> bool:
        return self.sharing.tier != "raw"

    def _relabel(self, value: Any) -> Any:
        """Replace the participant's own label by the shared one, wherever it is a whole value."""
        if isinstance(value, str):
            return self.sharing.label if value == self._own else value
        if isinstance(value, Mapping):
            return {k: self._relabel(v) for k, v in value.items()}
        if isinstance(value, list):
            return [self._relabel(v) for v in value]
        return value


def age_band(answer: object) -> str | None:
    """Return the decade of an age ("30-39"); None when the value is not an age."""
    try:
        age = int(float(str(answer)))
    except (ValueError, OverflowError):
        return None
    low = age // AGE_BAND_YEARS * AGE_BAND_YEARS
    return f"{low}-{low + AGE_BAND_YEARS - 1}" if age >= 0 else None
