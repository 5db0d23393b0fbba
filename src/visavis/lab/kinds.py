"""What annotations take: values of another kind are told from others, and refused in words."""

import functools
import inspect
from collections import abc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from numbers import Integral, Real
from pathlib import PurePath
from types import NoneType, UnionType
from typing import (
    Any,
    Final,
    ForwardRef,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import did_you_mean

Kind = TypeVar("Kind", bound=type)
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
_ROW: Final = (tuple, list, np.ndarray)


def of_kinds(**wider: Any) -> Callable[[Kind], Kind]:
    """Let a dataclass refuse values of another kind than its fields' annotations.

    They are looked at before its own `__post_init__` reads them. `wider` are annotations, by field,
    of what it takes beyond what it holds afterwards. It stands beneath `@dataclass`; a value of
    another kind raises DesignError with the field's name and what it takes.
    """

    def decorate(cls: Kind) -> Kind:
        own = getattr(cls, "__post_init__", None)  # or that of what it inherits from

        def __post_init__(self: Any) -> None:  # noqa: N807 - it is the dataclass's own
            if problems := list(_wrong_fields(self, wider)):
                raise DesignError("; ".join(problems))
            if own is not None:
                own(self)

        cls.__post_init__ = __post_init__  # type: ignore[attr-defined] # dataclasses call it
        return cls

    return decorate


def takes_kinds(
    about: str = "", /, **wider: Any
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Let a function refuse arguments of another kind than their annotations.

    `about` is what a user knows it as: left out, the function's name, for a step of a trial
    `t.NAME`. `wider` are annotations, by argument, of what it refuses in words of its own. An
    argument of another kind raises DesignError with its name and what it takes.
    """

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        signature = inspect.signature(function)
        is_step = next(iter(signature.parameters), "") == "self"
        name = about or f"{'t.' if is_step else ''}{function.__name__}"

        @functools.wraps(function)
        def call(*args: Arguments.args, **keywords: Arguments.kwargs) -> Result:
            try:
                values = signature.bind(*args, **keywords).arguments
            except TypeError:
                return function(*args, **keywords)  # Python says what is missing, or too much
            if problems := list(_wrong_arguments(name, signature, values, wider)):
                raise DesignError("; ".join(problems))
            return function(*args, **keywords)

        return call

    return decorate


def _wrong_arguments(
    about: str, signature: inspect.Signature, values: Mapping[str, Any], wider: Mapping[str, Any]
) -> Iterator[str]:
    """Yield what is wrong with the arguments of a function."""
    for name, value in values.items():
        parameter = signature.parameters[name]
        hint = wider.get(name, parameter.annotation)
        several: Mapping[str, Any] = {name: value}
        if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
            several = {f"{name}[{index}]": one for index, one in enumerate(value)}
        elif parameter.kind is inspect.Parameter.VAR_KEYWORD:
            several = value
        for one_name, one in several.items():
            if hint is not inspect.Parameter.empty and (wrong := wrong_kind(one_name, one, hint)):
                yield f"{about}: {wrong}"


def _wrong_fields(thing: Any, wider: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with the fields of a dataclass."""
    own = {f.name: getattr(thing, f.name) for f in fields(thing) if f.init}
    name, first = next(iter(own.items()))
    for field in fields(thing):
        hint = wider.get(field.name, field.type)
        if field.init and (wrong := wrong_kind(field.name, own[field.name], hint)):
            which = f" {first!r}" if isinstance(first, str) and field.name != name else ""
            yield f"{type(thing).__name__}{which}: {wrong}"


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_place(value: object) -> bool:
    return isinstance(value, _ROW) and len(value) == 2 and all(map(_is_number, value))


KINDS: Final[Mapping[str, tuple[str, Callable[[object], bool]]]] = {
    "float": ("a number", _is_number),
    "int": ("a whole number", lambda v: isinstance(v, Integral) and not isinstance(v, bool)),
    "str": ("a text", lambda v: isinstance(v, str)),
    "bool": ("True or False", lambda v: isinstance(v, bool | np.bool_)),
    "tuple[float, float]": ("two numbers, such as (5, 0)", _is_place),
    "pathlib.Path": ("a path", lambda v: isinstance(v, PurePath)),
    "None": ("", lambda v: v is None),
}
"""By annotation: what an argument takes, and whether a value is that."""
PLURALS: Final[Mapping[Any, str]] = {float: "numbers", int: "whole numbers", str: "texts"}


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
        return all(is_of_kind(key, arguments[0]) for key in value) and all(
            is_of_kind(one, arguments[1]) for one in value.values()
        )
    if origin in (abc.Sequence, abc.Collection):
        if isinstance(value, str | abc.Mapping) or not isinstance(value, abc.Collection):
            return False
        return all(is_of_kind(one, arguments[0]) for one in value)
    if origin is tuple and arguments[-1] is not Ellipsis:
        if not isinstance(value, _ROW) or len(value) != len(arguments):
            return False
        return all(map(is_of_kind, value, arguments))
    if origin is tuple:
        return isinstance(value, _ROW) and all(is_of_kind(v, arguments[0]) for v in value)
    kind = KINDS.get(inspect.formatannotation(hint))
    return kind[1](value) if kind is not None else isinstance(value, origin or hint)


def wrong_kind(name: str, value: object, hint: Any) -> str:
    """Return what is wrong with a value of another kind than an annotation; else nothing."""
    if is_of_kind(value, hint):
        return ""
    hints = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    choices = [c for one in hints if get_origin(one) is Literal for c in get_args(one)]
    near = did_you_mean(value, choices) if choices else ""
    if "did you mean" in near:
        return f"{name} is {value!r}{near}"
    words = words_of_kind(hint)
    plainly = ", without quotes" if isinstance(value, str) and "number" in words else ""
    return f"{name} is {value!r}; it takes {words}{plainly}"


def words_of_kind(hint: Any) -> str:
    """Return in words what an annotation takes."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        *several, end = (words_of_kind(one) for one in arguments if one is not NoneType)
        return f"{', '.join(several)} or {end}" if several else end
    if origin is Literal:
        *others, last = (repr(one) for one in arguments if one != "")
        return f"{', '.join(others)} or {last}"
    if origin in (abc.Sequence, abc.Collection) or (origin is tuple and arguments[-1] is Ellipsis):
        return f"a list{_words_of_each(arguments[0])}"
    if origin is tuple and hint != tuple[float, float]:
        return f"{len(arguments)} {_plural(arguments)}"
    words = {
        abc.Callable: "a function",
        abc.Mapping: "names with what belongs to each: {…: …}",
    }
    kind = KINDS.get(inspect.formatannotation(hint))
    return words.get(origin) or (kind[0] if kind is not None else f"{hint.__name__}(…)")


def _words_of_each(hint: Any) -> str:
    """Return what a list holds, where a word says it."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return f" of {words_of_kind(hint)}"
    if origin is tuple and arguments[-1] is not Ellipsis:
        return f", each of {len(arguments)} {_plural(arguments)}"
    return f" of {PLURALS[hint]}" if hint in PLURALS else ""


def _plural(hints: tuple[Any, ...]) -> str:
    """Return what several values are called."""
    return PLURALS.get(hints[0], "values") if len(set(hints)) == 1 else "values"
