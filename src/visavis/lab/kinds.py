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
MAX_VALUE_CHARS: Final = 60
"""A longer value is cut in a message."""


def of_kinds(**wider: Any) -> Callable[[Kind], Kind]:
    """Let a dataclass refuse values of another kind than its fields' annotations.

    They are looked at before its own `__post_init__` reads them. `wider` are annotations, by field,
    of what it takes beyond what it holds afterwards. It stands beneath `@dataclass`; a value of
    another kind raises DesignError with the field's name and what it takes. Fields that a user's
    own class adds to it are not looked at.
    """

    def decorate(cls: Kind) -> Kind:
        own = getattr(cls, "__post_init__", None)  # or that of what it inherits from

        def __post_init__(self: Any) -> None:  # noqa: N807 - it is the dataclass's own
            hints = {f.name: wider.get(f.name, f.type) for f in fields(cls) if f.init}
            for name, hint in hints.items():
                value = getattr(self, name)
                if (plain := plain_value(value, hint)) is not value:
                    object.__setattr__(self, name, plain)
            if problems := list(_wrong_fields(self, hints)):
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
                bound = signature.bind(*args, **keywords)
            except TypeError:
                return function(*args, **keywords)  # Python says what is missing, or too much
            if problems := list(_wrong_arguments(name, signature, bound.arguments, wider)):
                raise DesignError("; ".join(problems))
            return function(*bound.args, **bound.kwargs)

        return call

    return decorate


def _wrong_arguments(
    about: str, signature: inspect.Signature, values: dict[str, Any], wider: Mapping[str, Any]
) -> Iterator[str]:
    """Yield what is wrong with the arguments of a function; write plain ones in their place."""
    for name, value in values.items():
        parameter = signature.parameters[name]
        hint = wider.get(name, parameter.annotation)
        if hint is inspect.Parameter.empty:
            continue
        if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
            several = {f"{name}[{index}]": one for index, one in enumerate(value)}
        elif parameter.kind is inspect.Parameter.VAR_KEYWORD:
            several = value
        else:
            values[name] = plain_value(value, hint)
            several = {name: values[name]}
        for one_name, one in several.items():
            if wrong := wrong_kind(one_name, one, hint):
                yield f"{about}: {wrong}"


def _wrong_fields(thing: Any, hints: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with the fields of a dataclass."""
    first_name = next(iter(hints))
    first = getattr(thing, first_name)
    for name, hint in hints.items():
        if wrong := wrong_kind(name, getattr(thing, name), hint):
            which = f" {first!r}" if isinstance(first, str) and name != first_name else ""
            yield f"{type(thing).__name__}{which}: {wrong}"


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_row(value: object) -> bool:
    """Tell whether a value is several in an order."""
    return isinstance(value, abc.Sequence) and not isinstance(value, str | bytes)


def _is_list(value: object) -> bool:
    """Tell whether a value is several, in whatever order."""
    return isinstance(value, abc.Collection) and not isinstance(value, str | bytes | abc.Mapping)


KINDS: Final[Mapping[str, tuple[str, Callable[[object], bool]]]] = {
    "float": ("a number", _is_number),
    "int": ("a whole number", lambda v: isinstance(v, Integral) and not isinstance(v, bool)),
    "str": ("a text", lambda v: isinstance(v, str)),
    "bool": ("True or False", lambda v: isinstance(v, bool | np.bool_)),
    "pathlib.Path": ("a path", lambda v: isinstance(v, PurePath)),
    "None": ("", lambda v: v is None),
}
"""By annotation: what an argument takes, and whether a value is that."""
PLURALS: Final[Mapping[Any, str]] = {float: "numbers", int: "whole numbers", str: "texts"}
LISTS: Final = (abc.Sequence, abc.Collection)


def _choices(hint: Any) -> tuple[Any, ...]:
    """Return the annotations of which any will do."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _takes_list(hint: Any) -> bool:
    return any(get_origin(one) in (*LISTS, tuple) for one in _choices(hint))


def plain_value(value: object, hint: Any) -> object:
    """Return a value as an annotation has it: what can be read but once, and arrays of numpy, as
    tuples where a list is taken, an array of one number as that number; any other as it is.
    """
    if isinstance(value, np.ndarray) and np.ndarray not in [get_origin(h) for h in _choices(hint)]:
        if value.ndim == 0:
            return value.item()
        return _as_tuples(value.tolist()) if _takes_list(hint) else value
    return tuple(value) if isinstance(value, abc.Iterator) and _takes_list(hint) else value


def _as_tuples(values: Any) -> Any:
    return tuple(map(_as_tuples, values)) if isinstance(values, list) else values


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
        is_text = isinstance(value, str)
        return any((is_text or type(value) is type(one)) and value == one for one in arguments)
    if origin is abc.Callable:
        return callable(value)
    if origin is abc.Mapping or origin in LISTS or origin is tuple:
        return _is_several(value, hint) and not any(_wrong_elements(value, hint))
    kind = KINDS.get(inspect.formatannotation(hint))
    if kind is not None:
        return kind[1](value)
    return not isinstance(origin or hint, type) or isinstance(value, origin or hint)


def _is_several(value: Any, hint: Any) -> bool:
    """Tell whether a value is several as an annotation takes them, whatever they are."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is abc.Mapping:
        return isinstance(value, abc.Mapping)
    if origin is tuple and arguments[-1] is not Ellipsis:
        return _is_row(value) and len(value) == len(arguments)
    return _is_list(value)


def _wrong_elements(value: Any, hint: Any) -> Iterator[tuple[str, str]]:
    """Yield, in words, what a value of several holds that is of another kind, and what its place
    takes; nothing where the whole says it.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is abc.Mapping:
        for key, one in value.items():
            if not is_of_kind(key, arguments[0]):
                yield f"the name {_short_repr(key)}", f"{words_of_kind(arguments[0])} as a name"
            elif not is_of_kind(one, arguments[1]):
                takes = f"{words_of_kind(arguments[1])} for each name"
                yield f"{_short_repr(one)} for {_short_repr(key)}", takes
        return
    is_fixed = origin is tuple and arguments[-1] is not Ellipsis
    hints = arguments if is_fixed else arguments[:1] * len(value)
    for one, of_one in zip(value, hints, strict=True):
        if not is_of_kind(one, of_one):
            yield _short_repr(one), ""


def wrong_kind(name: str, value: object, hint: Any) -> str:
    """Return what is wrong with a value of another kind than an annotation; else nothing."""
    if is_of_kind(value, hint):
        return ""
    texts = [c for one in _choices(hint) if get_origin(one) is Literal for c in get_args(one)]
    near = did_you_mean(value, texts) if texts else ""
    if "did you mean" in near:
        return f"{name} is {_short_repr(value)}{near}"
    kinds_of_several = (abc.Mapping, *LISTS, tuple)
    several = [one for one in _choices(hint) if get_origin(one) in kinds_of_several]
    near_hints = [one for one in several if _is_several(value, one)]
    if len(near_hints) == 1:
        wrong, takes = next(_wrong_elements(value, near_hints[0]))
        return f"{name} holds {wrong}; it takes {takes or words_of_kind(hint)}"
    words = words_of_kind(hint)
    plainly = ", without quotes" if isinstance(value, str) and "number" in words else ""
    return f"{name} is {_short_repr(value)}; it takes {words}{plainly}"


def _short_repr(value: object) -> str:
    """Return a value as Python writes it, in one line and not too long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= MAX_VALUE_CHARS else f"{text[:MAX_VALUE_CHARS]}…"


def words_of_kind(hint: Any) -> str:
    """Return in words what an annotation takes."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        *several, end = (words_of_kind(one) for one in arguments if one is not NoneType)
        return f"{', '.join(several)} or {end}" if several else end
    if origin is Literal:
        *others, last = (repr(one) for one in arguments if one != "")
        return f"{', '.join(others)} or {last}"
    if origin in LISTS or (origin is tuple and arguments[-1] is Ellipsis):
        return f"a list{_words_of_each(arguments[0])}"
    if hint == tuple[float, float]:
        return "two numbers, such as (5, 0)"
    if origin is tuple:
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
