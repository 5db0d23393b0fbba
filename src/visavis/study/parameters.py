"""A study's parameters in force: its own, those every study has, and levels of its factors."""

from collections.abc import Mapping
from typing import Any

from visavis.lab.errors import ConfigError, DesignError
from visavis.protocol.plan.parameters import no_such, out_of_range, read_as
from visavis.study.declaration import Study


def parameters_in_force(study: Study, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return every parameter by name; values that were set replace the study's own.

    A factor's name, or its plural, sets its levels: `--set gaze=[averted,directed]`.

    Raises:
        ConfigError: listing every name that does not exist and every wrong value.
        DesignError: the study refuses a value.
    """
    usual: dict[str, Any] = {**study.design.parameters, **study.usual_parameters}
    factors = {f.name: f for f in study.design.factors}
    plural = {f"{name}s": name for name in factors if f"{name}s" not in usual}
    problems: list[str] = []
    for key, value in overrides.items():
        name = plural.get(key, key)
        if name in factors:
            levels = value if isinstance(value, list) else [value]
            kind = {type(v) for v in factors[name].levels}
            if not levels or any(type(v) not in kind for v in levels):
                problems.append(f"{key} is {value!r}: give levels, such as {name}=[a,b]")
            usual[name] = list(levels)
        elif name not in usual:
            problems.append(no_such(name, (*usual, *factors)))
        else:
            try:
                usual[name] = _like(usual[name], value)
            except ValueError as problem:
                problems.append(f"{name} is {value!r}: {problem}")
    if any(p.startswith("no ") for p in problems):
        problems.append(f"parameters: {', '.join((*usual, *factors))}")
    if problems:
        raise ConfigError(f"{study.name} cannot be set so: {'; '.join(problems)}")
    refusals = list(
        filter(
            None,
            (
                out_of_range(name, usual[name], limits)
                for name, limits in study.design.ranges.items()
                if name in usual
            ),
        )
    )
    if refusals:
        raise DesignError(f"{study.name}: {'; '.join(refusals)}")
    if study.design.check_of is not None:
        study.design.check_of(usual)
    return usual


def _like(usual: Any, value: Any) -> Any:
    """Return a value converted to the type of the usual one."""
    if isinstance(usual, list | tuple) and not isinstance(value, list):
        raise ValueError("give a list, such as [a,b]")
    return read_as(type(usual), value) if isinstance(usual, bool | int | float | str) else value
