"""The arguments of functions that a study file calls, and the error for an unknown one."""

import inspect
from collections.abc import Callable, Iterable
from typing import Any

from visavis.lab.yaml_lines import did_you_mean


def unknown_argument(what: str, argument: str, possible: Iterable[str]) -> str:
    """Return the message for an unknown argument, with the nearest one or all that exist."""
    names = tuple(possible)
    near = did_you_mean(argument, names)
    if "did you mean" in near:
        return f"{what} takes no {argument!r}{near}"
    return f"{what} takes no {argument!r}; it takes {', '.join(names)}"


def argument_names(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the arguments that a function or class takes by name."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = inspect.signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.kind in kinds and p.name != "self")
