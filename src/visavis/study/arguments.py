"""The arguments of functions that a study file calls, and the errors for an unknown one."""

import inspect
from collections.abc import Callable, Iterable
from typing import Any, Final

from visavis.lab.yaml_lines import did_you_mean, names_or_none

FORMER_NAMES: Final = {
    "called": "level_words",
    "shown": "stimulus",
    "staged": "staged_scene",
    "unasked": "skip_after_block",
    "unopinionated": "neutral_answer",
}
"""Names of version 0.2.0 that study files use, and what they are called now."""


def new_name(name: str, possible: Iterable[str]) -> str:
    """Return the end of a message that says what a former name is called now; else nothing."""
    now = FORMER_NAMES.get(name)
    return f"; since 0.3.0 it is called {now!r}" if now in tuple(possible) else ""


def unknown_argument(what: str, argument: str, possible: Iterable[str]) -> str:
    """Return the message for an unknown argument, with the nearest one or all that exist."""
    names = tuple(possible)
    near = new_name(argument, names) or did_you_mean(argument, names)
    if "did you mean" in near or "it is called" in near:
        return f"{what} takes no {argument!r}{near}"
    return f"{what} takes no {argument!r}; it takes {names_or_none(names)}"


def argument_names(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the arguments that a function or class takes by name."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = inspect.signature(function).parameters.values()
    return tuple(p.name for p in parameters if p.kind in kinds and p.name != "self")
