"""The languages that `visavis.devices.drivers.bands.driver` speaks to bands.

A language turns commands into messages and bytes into notices; it keeps no time and does no I/O.
A message is what one `ByteLink.write` carries: a datagram, a notification, a report or a line.
"""

import codecs
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

MAX_JSON = 16_384


@dataclass(frozen=True)
class Ready:
    """The band has taken the opening; empty texts where it does not say."""

    model: str = ""
    serial: str = ""


@dataclass(frozen=True)
class Refusal:
    """The band will not do what it was asked."""

    message: str
    remedy: str


@dataclass(frozen=True)
class Condition:
    """The band's report about itself; None for what it does not report."""

    battery_01: float | None = None
    temperature_c: float | None = None
    is_worn: bool | None = None


Notice = Ready | Refusal | Condition


class BandLanguage(Protocol):
    """One band's language; `feed` never raises and accepts any chunking."""

    @property
    def motor_count(self) -> int:
        """Motors it drives."""
        ...

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return how long `drive` with this time to live runs by itself; None: for ever."""
        ...

    @property
    def answers(self) -> bool:
        """Tell whether `Ready` follows the opening."""
        ...

    def opening(self) -> Sequence[bytes]:
        """Return the messages that start a connection."""
        ...

    @property
    def rate_range_hz(self) -> tuple[float, float]:
        """Lowest and highest vibration rate that can be asked for; NaN when none can."""
        ...

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return the messages that set every motor, 0..1."""
        ...

    def silence(self) -> Sequence[bytes]:
        """Return the messages that stop every motor."""
        ...

    def closing(self) -> Sequence[bytes]:
        """Return the messages that give the band back to its wearer, after `silence`."""
        ...

    def inquiry(self) -> Sequence[bytes]:
        """Return the messages that ask for its condition; empty when it reports by itself."""
        ...

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return what the band said in these bytes, together with those before."""
        ...

    def reset(self) -> None:
        """Discard a message that is only partly received; called when a connection starts."""
        ...

    @property
    def unreadable_count(self) -> int:
        """Messages that could not be read."""
        ...


def level(amplitude_01: float, full: int) -> int:
    """Return an amplitude as 0..full; a running motor never rounds to off."""
    return 0 if amplitude_01 <= 0 else max(1, round(min(1.0, amplitude_01) * full))


class JsonReader:
    """Cut JSON objects out of a text stream, however chunked, with the text before each.

    A `fence` is text that never occurs inside an object: an object unfinished there is discarded.
    `unreadable_count` counts texts that begin like an object and are not one.
    """

    def __init__(self, fence: str = "") -> None:
        self._fence = fence
        self._buffer = ""
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self.unreadable_count = 0

    def feed(self, data: bytes) -> list[tuple[str, dict[str, Any]]]:
        """Return (text before it, object) for every object completed by these bytes."""
        self._buffer += self._decoder.decode(data)
        objects: list[tuple[str, dict[str, Any]]] = []
        while self._fence and self._fence in self._buffer:
            piece, _, self._buffer = self._buffer.partition(self._fence)
            rest = self._cut(piece, objects)
            self.unreadable_count += "{" in rest
        self._buffer = self._cut(self._buffer, objects)
        if len(self._buffer) > MAX_JSON:
            self.unreadable_count += "{" in self._buffer
            self._buffer = self._buffer[-len(self._fence) :] if self._fence else ""
        return objects

    def reset(self) -> None:
        """Discard an object that is only partly received."""
        self._buffer = ""
        self._decoder.reset()

    def _cut(self, text: str, objects: list[tuple[str, dict[str, Any]]]) -> str:
        while (start := text.find("{")) >= 0:
            end = _closing_brace(text, start)
            if end is None:
                return text
            before, piece, text = text[:start], text[start : end + 1], text[end + 1 :]
            try:
                objects.append((before, json.loads(piece)))
            except (ValueError, RecursionError):
                self.unreadable_count += 1
        return text


def _closing_brace(text: str, start: int) -> int | None:
    depth, in_string, after_backslash = 0, False, False
    for at in range(start, len(text)):
        letter = text[at]
        if in_string:
            if after_backslash:
                after_backslash = False
            elif letter == "\\":
                after_backslash = True
            elif letter == '"':
                in_string = False
        elif letter == '"':
            in_string = True
        elif letter == "{":
            depth += 1
        elif letter == "}":
            depth -= 1
            if depth == 0:
                return at
    return None
