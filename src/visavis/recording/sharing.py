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

from visavis.lab.clock import NS_PER_S
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
from visavis.recording.page_clock import PAGE_ROLE
from visavis.recording.reader import PART_COLUMN, Recording
from visavis.recording.session_times import EXCHANGE_EVENT, STREAM_OF_ROLE, STREAMS_OF_PAGE
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
MAX_EARLY_NS: Final = 60 * NS_PER_S
"""Times of a part count from its first event where that comes later than this.

Else they count from when the computer was started, which tells who came after whom."""
ORDER_COLUMNS: Final = ("participant_index",)
"""Places in the order: with the ledger's labels, which are numbered, they undo a pseudonym."""
NO_DEVICE_TIME: Final = -(2**63)
"""Value of an unknown time in a stream: `visavis.devices.streams.NO_DEVICE_TIME`."""
ANY: Final = "*"
"""Stands for every field of an event, and for every event."""
_AGE = re.compile(
    r"(.*[._])?(age(_(in_)?years)?|how_old|birth_?(year|date|day)|(year|date)_?of_?birth|yob)",
    re.IGNORECASE,
)
"""Names of questions whose answers are an age or when somebody was born: of both decades leave."""


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

    In the tier "raw" nothing else changes. In the others times count from the first event of each
    part, not from 1970 or the computer's start, and those of a device from its first sample; places
    in the order are missing where the label is a pseudonym. In "shared" only that leaves of
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
        self._device_zeros_ns: dict[tuple[int, str], int] = {}
        parts = self.manifest.parts
        if self._hides:
            parts = tuple(replace(part, reason="") for part in parts)
        self.manifest = replace(self.manifest, participant=sharing.label, parts=parts)

    @property
    def pseudonym(self) -> str | None:
        """What stands for the participant's label; None where the label itself leaves."""
        return None if self.sharing.label == self._own else self.sharing.label

    def events(self) -> pd.DataFrame:
        """Return all events as shown; see `Recording.events`."""
        events = super().events()
        payloads = [
            self._payload(name, payload, part)
            for name, payload, part in zip(
                events["name"], events["payload"], events[PART_COLUMN], strict=True
            )
        ]
        parts = events[PART_COLUMN]
        return events.assign(
            t_ns=[
                self._shifted("t_ns", t_ns, part)
                for t_ns, part in zip(events["t_ns"], parts, strict=True)
            ],
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
            {**t, "t_ns": self._shifted("t_ns", t["t_ns"], part), "row": self._row(t["row"], part)}
            for t in super().trial_entries(part)
        )

    @cached_property
    def _zeros_ns(self) -> Mapping[int, int]:
        """The first event of each part, from which its times are shown; 0 where they stay."""
        zeros = {}
        for part in self.manifest.parts:
            events = self._journal(part.number).events
            first_ns = min((int(event["t_ns"]) for event in events), default=0)
            zeros[part.number] = first_ns if self._hides and first_ns > MAX_EARLY_NS else 0
        return zeros

    def _shifted(self, name: str, value: Any, part: int) -> Any:
        """Return a value as shared: a time that counts from the first event of its part."""
        zero_ns = self._zeros_ns.get(part, 0)
        if not zero_ns or not name.endswith("_ns") or isinstance(value, bool):
            return value
        if isinstance(value, int | float):
            return value - zero_ns if value > zero_ns - MAX_EARLY_NS else value
        return value

    def _exchanges(self, payload: Mapping[str, Any], part: int) -> list[Any]:
        """Return exchanges of times (send, device, receive), each from where its clock began."""
        role = str(payload.get("role"))
        name = STREAM_OF_ROLE.get(role, role)
        zero_ns, device_zero_ns = self._zeros_ns.get(part, 0), self._device_zero_ns(part, name)
        rows = payload.get("send_device_receive_ns") or ()
        return [
            [send - zero_ns, at - device_zero_ns, receive - zero_ns] for send, at, receive in rows
        ]

    def _device_zero_ns(self, part: int, stream: str) -> int:
        """Return what a stream's device times are shown from: its first, or as the session's.

        Streams of a page have one clock, which begins with the head's.
        """
        if stream in STREAMS_OF_PAGE and self.manifest.configuration.get("on") == "browser":
            stream = STREAM_OF_ROLE[PAGE_ROLE]
        key = (part, stream)
        if key not in self._device_zeros_ns:
            zero_ns = self._zeros_ns.get(part, 0)
            if zero_ns and stream in super()._names(part):
                columns = super()._content(part, stream).columns
                device_ns, host_ns = columns["t_device_ns"], columns["t_host_ns"]
                at = np.flatnonzero(device_ns != NO_DEVICE_TIME)[:1]
                if len(at) and abs(int(device_ns[at[0]]) - int(host_ns[at[0]])) > NS_PER_S:
                    zero_ns = int(device_ns[at[0]])  # another clock than the session's
            self._device_zeros_ns[key] = zero_ns
        return self._device_zeros_ns[key]

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
            content = super()._content(number, name, with_columns=with_columns)
            return self._dated_anew(number, name, content)
        if (number, name) not in self._blurred_streams:
            content = self._dated_anew(number, name, super()._content(number, name))
            self._blurred_streams[number, name] = replace(
                content, columns=self._blur(number, name, content)
            )
        return self._blurred_streams[number, name]

    def _dated_anew(self, part: int, name: str, content: StreamContent) -> StreamContent:
        """Return a stream whose times tell neither a day nor who came before whom."""
        zero_ns = self._zeros_ns.get(part, 0)
        if not zero_ns or "t_host_ns" not in content.columns:
            return content
        device_zero_ns = self._device_zero_ns(part, name)
        columns = dict(content.columns)
        for column, values in content.columns.items():
            if column == "t_device_ns":
                columns[column] = np.where(
                    values == NO_DEVICE_TIME, values, values - device_zero_ns
                )
            elif column.endswith("_ns"):
                columns[column] = np.where(
                    values > zero_ns - MAX_EARLY_NS, values - zero_ns, values
                )
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

    def _row(self, row: Mapping[str, Any], part: int) -> dict[str, Any]:
        public = {name: self._shifted(name, self._relabel(v), part) for name, v in row.items()}
        if self._hides:
            public = {name: self._value(name, value) for name, value in public.items()}
        if self.sharing.blurs:
            public |= {name: None for name in row if tells_length(name)}
        return public

    def _value(self, name: str, value: Any) -> Any:
        """Return a value of a trial row, or an answer within a trial, as it may leave."""
        if value is None or name in TYPED_FIELDS:
            return None
        if name in ORDER_COLUMNS and self.sharing.label != self._own:
            self.withheld.add(f"column {name}")
            return None
        if not self.sharing.leaves(name, value):
            self.withheld.add(f"column {name}")
            return None
        return age_band(value) if _AGE.fullmatch(name) else value

    def _payload(self, name: str, payload: Mapping[str, Any], part: int) -> dict[str, Any]:
        public = {k: self._shifted(k, self._relabel(v), part) for k, v in payload.items()}
        if name == EXCHANGE_EVENT and self._zeros_ns.get(part, 0):
            public["send_device_receive_ns"] = self._exchanges(payload, part)
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
