"""Arguments of what a study file calls: which there are, and words for one that there is not."""

import inspect
from collections.abc import Callable, Iterable
from typing import Any

from visavis.lab.yaml_lines import did_you_mean


def unknown_argument(what: str, given: str, known: Iterable[str]) -> str:
    """Say that something takes no such argument, with the nearest one, or all there are."""
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
