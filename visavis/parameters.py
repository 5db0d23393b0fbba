"""A study's parameters in force: its own, those every study has, and levels of its factors."""

import difflib
import math
from collections.abc import Mapping
from typing import Any

from lab.errors import ConfigError
from visavis.study import SETTABLE, Study


def parameters_in_force(study: Study, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return every parameter by name, with what was set in place of the study's own.

    A factor's name, or its plural, sets its levels: `--set gaze=[averted,directed]`.

    Raises:
        ConfigError: listing every name that does not exist and every value that is none.
        DesignError: the study refuses a value.
    """
    usual: dict[str, Any] = {**study.parameters, **{n: getattr(study, n) for n in SETTABLE}}
    factors = {f.name: f for f in study.factors}
    plural = {f"{name}s": name for name in factors if f"{name}s" not in usual}
    problems: list[str] = []
    for given, value in overrides.items():
        name = plural.get(given, given)
        if name in factors:
            levels = value if isinstance(value, list) else [value]
            kind = {type(v) for v in factors[name].levels}
            if not levels or any(type(v) not in kind for v in levels):
                problems.append(f"{given} is {value!r}: give levels, such as {name}=[a,b]")
            usual[name] = list(levels)
        elif name not in usual:
            known = (*usual, *factors)
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
            problems.append(f"no {name}" + (f" (did you mean {near[0]}?)" if near else ""))
        else:
            try:
                usual[name] = _like(usual[name], value)
            except ValueError as problem:
                problems.append(f"{name} is {value!r}: {problem}")
    if any(p.startswith("no ") for p in problems):
        problems.append(f"parameters: {', '.join((*usual, *factors))}")
    if problems:
        raise ConfigError(f"{study.name} cannot be set so: {'; '.join(problems)}")
    if study.check_of is not None:
        study.check_of(usual)
    return usual


def _like(usual: Any, value: Any) -> Any:
    """Return a value as the kind that the usual one has."""
    if isinstance(usual, bool):
        if not isinstance(value, bool):
            raise ValueError("give yes or no")
        return value
    if isinstance(usual, int):
        if isinstance(value, bool) or not isinstance(value, int | float) or value != int(value):
            raise ValueError("give a whole number")
        return int(value)
    if isinstance(usual, float):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError("give a number")
        if not math.isfinite(value):
            raise ValueError("give a finite number")
        return float(value)
    if isinstance(usual, str) and not isinstance(value, str):
        raise ValueError("give a name")
    if isinstance(usual, list | tuple) and not isinstance(value, list):
        raise ValueError("give a list, such as [a,b]")
    return value
