"""A study's parameters from names and values typed by the user."""

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from visavis.lab.errors import ConfigError
from visavis.lab.kinds import of_kinds

P = TypeVar("P")


@dataclass(frozen=True)
@of_kinds()
class Within:
    """Bounds of a number: from `low` to `high`, without the ends where it is `open`.

    `why` says in words where the bounds come from.
    """

    low: float = -math.inf
    high: float = math.inf
    open: bool = False
    why: str = ""

    def __contains__(self, value: float) -> bool:
        if self.open:
            return self.low < value < self.high
        return self.low <= value <= self.high

    def __str__(self) -> str:
        at_least = f"above {self.low:g}" if self.open else f"from {self.low:g} on"
        at_most = f"below {self.high:g}" if self.open else f"up to {self.high:g}"
        if math.isinf(self.high):
            words = at_least
        elif math.isinf(self.low):
            words = at_most
        else:
            words = (
                f"between {self.low:g} and {self.high:g}"
                if self.open
                else f"{self.low:g} to {self.high:g}"
            )
        return f"{words} ({self.why})" if self.why else words


Range = Within | Collection[Any]
"""What a parameter may be: a number within bounds, or one of several."""


def out_of_range(name: str, value: Any, allowed: Range) -> str:
    """Return what is wrong with a value, or with one of several in a list; else nothing."""
    wrong = [v for v in (value if isinstance(value, list) else [value]) if v not in allowed]
    if not wrong:
        return ""
    if isinstance(allowed, Within):
        return f"{name} is {wrong[0]:g}; give a number {allowed}"
    return f"no {name} {wrong[0]!r}; choose among {', '.join(map(str, allowed))}"


def read_as(kind: Any, value: Any) -> Any:
    """Return a value as the wanted kind: a number, a text, yes or no, or one of several names.

    Raises:
        ValueError: the value is not of that kind; the message says what to give.
    """
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    if not choices:
        return _READERS[kind](value)
    if value not in choices:
        raise ValueError(f"choose {', '.join(choices)}")
    return value


def no_such(name: str, names: Collection[str]) -> str:
    """Return a message that there is no such name, with the nearest existing one."""
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return f"no {name}" + (f" (did you mean {near[0]}?)" if near else "")


def known_of(kind: type[P], parameters: Mapping[str, Any]) -> P:
    """Return a dataclass filled from parameters by name; names it does not have are ignored."""
    names = {f.name for f in fields(kind)}  # type: ignore[arg-type]  # a dataclass, as said
    return kind(**{k: v for k, v in parameters.items() if k in names})


def parameters_from(kind: type[P], overrides: Mapping[str, Any], study: str) -> P:
    """Return a dataclass of numbers, texts and yes or no with `overrides` in place of defaults.

    Raises:
        ConfigError: lists every name that does not exist and every value that cannot be read.
    """
    hints = get_type_hints(kind)
    names = tuple(f.name for f in fields(kind))  # type: ignore[arg-type]  # a dataclass, as said
    problems: list[str] = []
    read: dict[str, Any] = {}
    for name, value in overrides.items():
        if name not in names:
            problems.append(no_such(name, names))
            continue
        try:
            read[name] = read_as(hints[name], value)
        except ValueError as problem:
            problems.append(f"{name} is {_as_text(value)}: {problem}")
    if any(name not in names for name in overrides):
        problems.append(f"parameters: {', '.join(names)}")
    if problems:
        raise ConfigError(f"{study} cannot be set so: {'; '.join(problems)}")
    return kind(**read)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("give a number")
    if not math.isfinite(value):
        raise ValueError("give a finite number")
    return float(value)


def _whole(value: Any) -> int:
    number = _number(value)
    if number != int(number):
        raise ValueError("give a whole number")
    return int(number)


def _yes_or_no(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("give yes or no")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("give a name")
    return value


def _as_text(value: Any) -> str:
    return "empty" if value is None else repr(value)


_READERS = {float: _number, int: _whole, bool: _yes_or_no, str: _text}
