"""Speak the text commands of a laboratory's own firmware, from templates; pure.

Templates are Python format strings. Per motor: {motor} (its number, from `first_motor`) and
{amplitude} (0..`full_scale`). For all motors at once: {a0} {a1} {a2} ... and {ttl_ms}. Such
firmware may not silence itself, so all safety is on the host's side.
"""

import math
import re
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from visavis.devices.drivers.bands.language import Condition, Notice, Refusal, level

MAX_LINE = 1024


@dataclass(frozen=True)
class AsciiTemplates:
    """A firmware's commands; exactly one of `set_one` and `set_all` is given.

    Without `stop`, zeros are set. `battery_answer` is a regular expression whose first group is
    a percentage; `refusal_answer` one that finds refusals.
    """

    set_one: str = ""
    set_all: str = ""
    stop: str = ""
    opening: tuple[str, ...] = ()
    closing: tuple[str, ...] = ()
    battery: str = ""
    battery_answer: str = ""
    refusal_answer: str = ""
    motor_count: int = 4
    first_motor: int = 0
    full_scale: int = 255

    def problems(self) -> tuple[str, ...]:
        """Return what is wrong, one sentence each."""
        problems: list[str] = []
        if bool(self.set_one) == bool(self.set_all):
            problems.append("give either set_one or set_all")
        problems += _misfits("set_one", self.set_one, {"motor", "amplitude", "ttl_ms"})
        problems += _misfits("set_all", self.set_all, self._all_names() | {"ttl_ms"})
        problems += _misfits("stop", self.stop, set())
        if self.set_one and not {"motor", "amplitude"} <= _names(self.set_one):
            problems.append("set_one needs {motor} and {amplitude}")
        if self.set_all and not self._all_names() <= _names(self.set_all):
            problems.append(f"set_all needs {_format_fields(self._all_names())}")
        for name in ("battery_answer", "refusal_answer"):
            try:
                groups = re.compile(getattr(self, name)).groups
            except re.error as cause:
                problems.append(f"{name} is not a regular expression: {cause}")
            else:
                if name == "battery_answer" and self.battery_answer and groups < 1:
                    problems.append("battery_answer needs a group (…) around the percentage")
        return tuple(problems)

    def _all_names(self) -> set[str]:
        return {f"a{i}" for i in range(self.motor_count)}


class AsciiLanguage:
    """Speak by templates; see `BandLanguage`."""

    answers = False
    rate_range_hz = (math.nan, math.nan)

    def __init__(self, templates: AsciiTemplates) -> None:
        if problems := templates.problems():
            raise ValueError("; ".join(problems))
        self._say = templates
        self._battery = re.compile(templates.battery_answer) if templates.battery_answer else None
        self._refusal = re.compile(templates.refusal_answer) if templates.refusal_answer else None
        self._tail = b""
        self.unreadable_count = 0
        self.motor_count = templates.motor_count

    def lasts_ms(self, ttl_ms: int) -> int | None:
        """Return None: such firmware may run for ever."""
        return None

    def opening(self) -> Sequence[bytes]:
        """Return the opening lines."""
        return [line.encode("ascii") for line in self._say.opening]

    def drive(
        self, amplitudes_01: Sequence[float], ttl_ms: int, rates_hz: Sequence[float] | None = None
    ) -> Sequence[bytes]:
        """Return one message that sets every motor, in order."""
        levels = [level(a, self._say.full_scale) for a in amplitudes_01]
        return (self._set(levels, ttl_ms),)

    def silence(self) -> Sequence[bytes]:
        """Return the stop line, and zeros for every motor."""
        stop = self._say.stop.format().encode("ascii")
        return (stop + self._set([0] * self.motor_count, 0),)

    def closing(self) -> Sequence[bytes]:
        """Return the closing lines."""
        return [line.encode("ascii") for line in self._say.closing]

    def inquiry(self) -> Sequence[bytes]:
        """Return the line that asks for the battery."""
        return (self._say.battery.encode("ascii"),) if self._say.battery else ()

    def feed(self, data: bytes) -> Sequence[Notice]:
        """Return batteries and refusals found in whole lines."""
        *lines, self._tail = (self._tail + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._tail) > MAX_LINE:
            self._tail = b""
            self.unreadable_count += 1
        notices: list[Notice] = []
        for line in lines:
            notices += self._read(line.decode("ascii", "replace"))
        return notices

    def reset(self) -> None:
        """Discard a line that is only partly received."""
        self._tail = b""

    def _read(self, line: str) -> list[Notice]:
        notices: list[Notice] = []
        match = self._battery.search(line) if self._battery else None
        if match is not None:
            try:
                percent = float(match[1])
            except (TypeError, ValueError):
                self.unreadable_count += 1
            else:
                if 0 <= percent <= 100:
                    notices.append(Condition(battery_01=percent / 100))
        if self._refusal is not None and self._refusal.search(line):
            notices.append(Refusal(f"said {line[:80]!r}", "check the templates"))
        return notices

    def _set(self, levels: Sequence[int], ttl_ms: int) -> bytes:
        say = self._say
        if say.set_all:
            values: Mapping[str, int] = {f"a{i}": value for i, value in enumerate(levels)}
            return say.set_all.format(**values, ttl_ms=ttl_ms).encode("ascii")
        lines = (
            say.set_one.format(motor=say.first_motor + i, amplitude=value, ttl_ms=ttl_ms)
            for i, value in enumerate(levels)
        )
        return "".join(lines).encode("ascii")


def _names(template: str) -> set[str]:
    try:
        parts = list(string.Formatter().parse(template))
    except ValueError:
        return set()
    return {name for _, name, _, _ in parts if name is not None}


def _misfits(label: str, template: str, field_names: set[str]) -> list[str]:
    try:
        unknown = _names(template) - field_names
        template.format(**dict.fromkeys(field_names, 1)).encode("ascii")
    except KeyError:
        pass  # reported below, with every unknown name
    except (ValueError, IndexError, UnicodeEncodeError, AttributeError) as cause:
        return [f"{label} is not a template: {cause}"]
    fields = _format_fields(field_names) or "no field"
    return [f"{label}: unknown field {{{name}}}; it may hold {fields}" for name in sorted(unknown)]


def _format_fields(names: set[str]) -> str:
    return " ".join(f"{{{name}}}" for name in sorted(names))
