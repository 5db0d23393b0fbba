"""A recording as others may see it: under a pseudonym, without free text, ages in bands."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import pandas as pd

from recording.reader import PART_COLUMN, Recording

Tier: TypeAlias = Literal["raw", "shared"]
TIERS: Final[tuple[Tier, ...]] = ("raw", "shared")

TextRule: TypeAlias = Callable[[str, str], bool]
"""Tells of a questionnaire and a question whether the answer is free text."""

AGE_BAND_YEARS: Final = 10
TYPED: Final = ("text", "reason", "message")
"""What the operator or participant typed, by its name in events and trial rows."""

TYPED_EVENTS: Final = ("operator", "session_aborted", "session_failed", "trial_skip")
_AGE = re.compile(r"(.*[._])?age")


@dataclass(frozen=True)
class Sharing:
    """How a recording is shown: `label` in the place of the participant's own.

    In the tier "raw" nothing else changes. In "shared", free text (answers by `is_text`, columns of
    trial rows in `text_columns`, what the operator typed) is missing and ages are bands of ten
    years.
    """

    label: str
    tier: Tier
    is_text: TextRule
    text_columns: frozenset[str] = frozenset()


class SharedRecording(Recording):
    """A session folder, read only, as `sharing` shows it; files are the same."""

    def __init__(self, path: Path, sharing: Sharing) -> None:
        super().__init__(path)
        self._sharing = sharing
        self._own = self.manifest.participant
        parts = self.manifest.parts
        if sharing.tier == "shared":
            parts = tuple(replace(part, reason="") for part in parts)
        self.manifest = replace(self.manifest, participant=sharing.label, parts=parts)

    def events(self) -> pd.DataFrame:
        """Return all events as shown; see `Recording.events`."""
        events = super().events()
        payloads = [
            self._payload(name, payload)
            for name, payload in zip(events["name"], events["payload"], strict=True)
        ]
        return events.assign(payload=pd.Series(payloads, index=events.index, dtype=object))

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
        return tuple({**t, "row": self._row(t["row"])} for t in super().trial_entries(part))

    def _row(self, row: Mapping[str, Any]) -> dict[str, Any]:
        hidden = {*TYPED, *self._sharing.text_columns} if self._hides else set()
        return {k: None if k in hidden else self._relabelled(v) for k, v in row.items()}

    def _payload(self, name: str, payload: Mapping[str, Any]) -> dict[str, Any]:
        shown = {k: self._relabelled(v) for k, v in payload.items()}
        if not self._hides:
            return shown
        if name in TYPED_EVENTS:
            shown |= {k: None for k in TYPED if k in shown}
        if name == "answer":
            shown["answer"] = self._answer(shown)
        return shown

    def _answer(self, payload: Mapping[str, Any]) -> Any:
        asked, question, answer = (payload.get(k) for k in ("questionnaire", "question", "answer"))
        if answer is None:
            return None
        if _AGE.fullmatch(str(question)):
            return age_band(answer)
        name = str(asked).partition("@")[0]
        return None if self._sharing.is_text(name, str(question)) else answer

    @property
    def _hides(self) -> bool:
        return self._sharing.tier == "shared"

    def _relabelled(self, value: Any) -> Any:
        """Put the label shown in the place of the own one, wherever it stands by itself."""
        if isinstance(value, str):
            return self._sharing.label if value == self._own else value
        if isinstance(value, Mapping):
            return {k: self._relabelled(v) for k, v in value.items()}
        if isinstance(value, list):
            return [self._relabelled(v) for v in value]
        return value


def age_band(answer: object) -> str | None:
    """Return the ten years an age lies in ("30-39"); None for what is no age."""
    try:
        age = int(float(str(answer)))
    except (ValueError, OverflowError):
        return None
    low = age // AGE_BAND_YEARS * AGE_BAND_YEARS
    return f"{low}-{low + AGE_BAND_YEARS - 1}" if age >= 0 else None
