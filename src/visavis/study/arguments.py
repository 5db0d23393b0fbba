"""The arguments of functions that a study file calls, and the error for an unknown one."""

import inspect
from collections.abc import Callable, Iterable
from typing import Any

from visavis.lab.yaml_lines import did_you_mean


def unknown_argument(what: str, given: str, known: Iterable[str]) -> str:
    """Return the message for an unknown argument, with the nearest one or all that exist."""
    names = tuple(known)
    near = did_you_mean(given, names)
    if "did you mean" in near:
        return f"{what} takes no {given!r}{near}"
    return f"{what} takes no {given!r}; it takes {', '.join(names)}"


def argument_names(called: Callable[..., Any]) -> tuple[str, ...]:
    """Return the arguments that a function or class takes by name."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = inspect.signature(called).parameters.values()
    return tuple(p.name for p in parameters if p.kind in kinds and p.name != "self")
