"""The arguments of functions that a study file calls, and the errors for an unknown one and for
values of another kind.
"""

import inspect
from collections import abc
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Final, ForwardRef, Literal, Union, get_args, get_origin

from visavis.lab.yaml_lines import did_you_mean, names_or_none

FORMER_NAMES: Final = {
    "called": "level_words",
    "shown": "stimulus",
    "staged": "staged_scene",
    "unasked": "skip_after_block",
    "unopinionated": "neutral_answer",
}
"""Names of version 0.2.0 that study files use, and what they are called now."""


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_place(value: object) -> bool:
    return isinstance(value, tuple | list) and len(value) == 2 and all(map(_is_number, value))


KINDS: Final[Mapping[str, tuple[str, Callable[[object], bool]]]] = {
    "float": ("a number", _is_number),
    "int": ("a whole number", lambda v: isinstance(v, Integral) and not isinstance(v, bool)),
    "str": ("a text", lambda v: isinstance(v, str)),
    "bool": ("True or False", lambda v: isinstance(v, bool)),
    "tuple[float, float]": ("two numbers, such as (5, 0)", _is_place),
    "None": ("", lambda v: v is None),
}
"""By annotation: what an argument takes, and whether a value is that."""


def is_of_kind(value: object, hint: Any) -> bool:
    """Tell whether a value is of the kind of an annotation; what functions take and return is not
    looked at.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any or isinstance(hint, str | ForwardRef) or getattr(hint, "_is_protocol", False):
        return True
    if origin in (Union, UnionType):
        return any(is_of_kind(value, one) for one in arguments)
    if origin is Literal:
        return any(type(value) is type(one) and value == one for one in arguments)
    if origin is abc.Callable:
        return callable(value)
    if origin is abc.Mapping:
        if not isinstance(value, abc.Mapping):
            return False
        return all(is_of_kind(one, arguments[1]) for one in value.values())
    if origin in (abc.Sequence, abc.Collection):
        if isinstance(value, str | abc.Mapping) or not isinstance(value, abc.Collection):
            return False
        return all(is_of_kind(one, arguments[0]) for one in value)
    if origin is tuple and arguments[-1] is not Ellipsis:
        if not isinstance(value, tuple | list) or len(value) != len(arguments):
            return False
        return all(map(is_of_kind, value, arguments))
    if origin is tuple:
        return isinstance(value, tuple | list) and all(is_of_kind(v, arguments[0]) for v in value)
    kind = KINDS.get(inspect.formatannotation(hint))
    return kind[1](value) if kind is not None else isinstance(value, origin or hint)


def wrong_kind(name: str, value: object, hint: Any) -> str:
    """Return what is wrong with a value of another kind than an annotation; else nothing."""
    if is_of_kind(value, hint):
        return ""
    near = did_you_mean(value, get_args(hint)) if get_origin(hint) is Literal else ""
    if "did you mean" in near:
        return f"{name} is {value!r}{near}"
    return f"{name} is {value!r}; it takes {words_of_kind(hint)}"


def wrong_fields(thing: object) -> Iterator[str]:
    """Yield what is wrong with the fields of a dataclass."""
    if not is_dataclass(thing) or isinstance(thing, type):
        return
    own = {f.name: getattr(thing, f.name) for f in fields(thing) if f.init}
    about = f"{type(thing).__name__}({next(iter(own.values()), '')!r}, …)"
    for field in fields(thing):
        if field.init and (wrong := wrong_kind(field.name, own[field.name], field.type)):
            yield f"{about}: {wrong}"


def words_of_kind(hint: Any) -> str:
    """Return in words what an annotation takes."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(words_of_kind(one) for one in arguments if one is not NoneType)
    if origin is Literal:
        *others, last = (repr(one) for one in arguments if one != "")
        return f"{', '.join(others)} or {last}"
    if origin in (abc.Sequence, abc.Collection) and get_origin(arguments[0]) is Literal:
        return f"a list of {words_of_kind(arguments[0])}"
    words = {
        abc.Callable: "a function",
        abc.Mapping: "names with what belongs to each: {…: …}",
        abc.Sequence: "a list",
        abc.Collection: "a list",
    }
    if origin is tuple and hint != tuple[float, float]:
        return f"{len(arguments)} values" if arguments[-1] is not Ellipsis else "a list"
    kind = KINDS.get(inspect.formatannotation(hint))
    return words.get(origin) or (kind[0] if kind is not None else f"{hint.__name__}(…)")


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


def other_kinds(what: str, taker: Callable[..., Any], values: Mapping[str, object]) -> list[str]:
    """Return, for each argument whose value is not of its kind, what it takes instead.

    Arguments of other annotations than those of `KINDS` take anything.
    """
    messages = []
    for parameter in inspect.signature(taker).parameters.values():
        annotation = parameter.annotation
        name = annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
        kinds = [KINDS.get(part) for part in name.split(" | ")]
        value = values.get(parameter.name)
        if value is parameter.default or parameter.name not in values:
            continue
        if any(kind is None or kind[1](value) for kind in kinds):
            continue
        words = " or ".join(kind[0] for kind in kinds if kind is not None and kind[0])
        hint = ", without quotes" if isinstance(value, str) and "number" in words else ""
        messages.append(f"{what}: {parameter.name} is {value!r}; it takes {words}{hint}")
    return messages
