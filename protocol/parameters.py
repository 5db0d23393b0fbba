"""A study's parameters from names and values that somebody typed."""

import difflib
import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar, get_type_hints

from lab.errors import ConfigError

P = TypeVar("P")


def parameters_from(kind: type[P], overrides: Mapping[str, Any], study: str) -> P:
    """Return a dataclass of numbers, texts and yes or no with `overrides` in place of defaults.

    Raises:
        ConfigError: listing every name that does not exist and every value that is none.
    """
    hints = get_type_hints(kind)
    known = tuple(f.name for f in fields(kind))  # type: ignore[arg-type]  # a dataclass, as said
    problems: list[str] = []
    read: dict[str, Any] = {}
    for name, value in overrides.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
            problems.append(f"no {name}" + (f" (did you mean {near[0]}?)" if near else ""))
            continue
        try:
            read[name] = _READERS[hints[name]](value)
        except ValueError as problem:
            problems.append(f"{name} is {_shown(value)}: {problem}")
    if any(name not in known for name in overrides):
        problems.append(f"parameters: {', '.join(known)}")
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


def _shown(value: Any) -> str:
    return "empty" if value is None else repr(value)


_READERS = {float: _number, int: _whole, bool: _yes_or_no, str: _text}
