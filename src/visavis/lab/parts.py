"""Things made of parts: what is given by name goes to the part that has a field of that name.

A declaration with sixty settings is read part by part, and written in one call without naming
them. Each part is a frozen dataclass; a dataclass that inherits all of them stands for the call,
so that type checkers and editors know every keyword and the fields are listed once.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, Concatenate, ParamSpec, TypeVar

from visavis.lab.yaml_lines import did_you_mean

P = ParamSpec("P")
Whole = TypeVar("Whole")


def takes_keywords_of(
    model: Callable[P, object],
) -> Callable[[Callable[..., None]], Callable[Concatenate[Any, P], None]]:
    """Give an `__init__` the arguments of a dataclass (a decorator).

    Any other keyword raises TypeError with the nearest one that there is.
    """
    arguments = signature(model).parameters

    def decorate(init: Callable[..., None]) -> Callable[Concatenate[Any, P], None]:
        @wraps(init)
        def check_and_init(self: Any, /, *values: Any, **keywords: Any) -> None:
            for keyword in keywords:
                if keyword not in arguments:
                    raise TypeError(
                        f"{type(self).__name__}.__init__() got an unexpected keyword argument "
                        f"{keyword!r}{did_you_mean(keyword, arguments)}"
                    )
            init(self, *values, **keywords)

        this = Parameter("self", Parameter.POSITIONAL_ONLY)
        vars(check_and_init)["__signature__"] = Signature([this, *arguments.values()])
        return check_and_init

    return decorate


def parts_from(kinds: Mapping[str, type[Any]], keywords: Mapping[str, Any]) -> dict[str, Any]:
    """Return each part by its name, with the keywords that are fields of it.

    `kinds` are the dataclasses of the parts. A part may stand among the keywords itself; fields
    that are named beside it replace its own.
    """
    parts = {}
    for name, kind in kinds.items():
        own = {f.name: keywords[f.name] for f in fields(kind) if f.name in keywords}
        whole = keywords.get(name)
        parts[name] = kind(**own) if whole is None else replace(whole, **own)
    return parts


def part_of(kinds: Mapping[str, type[Any]]) -> dict[str, str]:
    """Return the name of the part in which each field stands."""
    return {f.name: name for name, kind in kinds.items() for f in fields(kind)}


def missing_attribute(whole: object, name: str, kinds: Mapping[str, type[Any]]) -> AttributeError:
    """Return the error for an attribute that a thing does not have; its parts may."""
    kind = type(whole).__name__
    part = part_of(kinds).get(name)
    return AttributeError(
        f"{kind} has no attribute {name!r}"
        if part is None
        else f"a {kind} has its {name} in a part: .{part}.{name}"
    )
