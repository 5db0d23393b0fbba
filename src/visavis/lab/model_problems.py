"""Turn a pydantic model's errors about a file into messages for an operator."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard, get_args

from pydantic import BaseModel, ValidationError

from visavis.lab.units import NAMES, explain_magnitude, explain_text, explain_unknown, unit_of
from visavis.lab.yaml_lines import Document, KeyPath, Problem, did_you_mean


def model_problems(
    document: Document,
    model: type[BaseModel],
    raw: Mapping[str, Any],
    at: KeyPath,
    also_known: tuple[str, ...] = (),
) -> list[Problem]:
    """Return what a model finds wrong, each with its line, nearest match and unit.

    `raw` stands at `at` in the document; `also_known` are keys beside the model's own. A field
    with `json_schema_extra={"any_magnitude": True}` is never doubted for its magnitude.
    """
    problems: list[Problem] = []
    places: set[KeyPath] = set()
    names = {*model.model_fields, *also_known}
    if model.model_config.get("extra") != "forbid":
        for key in raw.keys() - names:
            problems.append(_unknown_key(document, (*at, key), raw[key], names))
            places.add((*at, key))
    try:
        model.model_validate(dict(raw))
    except ValidationError as error:
        for item in error.errors(include_url=False):
            place = _in_file(document, (*at, *item["loc"]))
            if item["type"] == "extra_forbidden":
                fields = _fields_at(model, item["loc"][:-1])
                extra = also_known if len(item["loc"]) == 1 else ()
                problems.append(_unknown_key(document, place, item["input"], {*fields, *extra}))
            else:
                message = _wording(str(place[-1]) if place else "", dict(item))
                problems.append(document.problem(place, message))
            places.add(place)
    problems += _magnitudes(document, model, raw, at, places)
    return problems


def _in_file(document: Document, place: tuple[str | int, ...]) -> KeyPath:
    """Drop the parts of a pydantic location that name a type and not a key."""
    if place and place[-1] == "[key]":
        place = place[:-1]
    key_path: KeyPath = ()
    for part in place[:-1]:
        # keys of mappings are text in a document, whatever YAML reads them as
        key_path = next(
            (
                (*key_path, name)
                for name in (part, str(part))
                if (*key_path, name) in document.lines
            ),
            key_path,
        )
    last = place[-1:]
    return (
        *key_path,
        *(map(str, last) if (*key_path, *map(str, last)) in document.lines else last),
    )


def _fields_at(model: type[BaseModel], place: Sequence[str | int]) -> set[str]:
    """Return the settings known at a place inside a model, through lists and mappings."""
    inner: object = model
    for part in place:
        if _is_model(inner):
            field = inner.model_fields.get(str(part))
            inner = None if field is None else field.annotation
        elif get_args(inner):
            inner = get_args(inner)[-1]  # a list's or mapping's values
        else:
            return set()
        if type(None) in get_args(inner):  # a part that may be left out
            inner = next(kind for kind in get_args(inner) if kind is not type(None))
    return set(inner.model_fields) if _is_model(inner) else set()


def _is_model(kind: object) -> TypeGuard[type[BaseModel]]:
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def _unknown_key(document: Document, place: KeyPath, value: object, names: set[str]) -> Problem:
    key = str(place[-1])
    message = explain_unknown(key, value, names) or f"unknown key{did_you_mean(key, names)}"
    return document.problem(place, message)


def _wording(key: str, item: Mapping[str, Any]) -> str:
    """Return a pydantic error as a message for an operator."""
    kind, value = str(item["type"]), item["input"]
    if kind == "missing":
        unit = unit_of(key)
        return "is missing" + (f"; give it in {NAMES[unit]}" if unit else "; add it")
    if kind.startswith(("int_", "float_")) and (explanation := explain_text(key, value)):
        return explanation
    if kind == "string_type":
        return f"is {value}, which YAML does not read as text; put it in quotes"
    if kind == "value_error":  # raised by a model of ours, in our own words
        text = str(item["msg"]).removeprefix("Value error, ")
        return text if isinstance(value, Mapping) else f"is {value!r}; {text}"
    text = str(item["msg"])
    text = (text[0].lower() + text[1:]).replace("input should", "should")
    unit = unit_of(key)
    in_unit = f", in {NAMES[unit]}" if unit else ""
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        if doubt := explain_magnitude(key, value):
            return doubt
        return f"is {value!r}; {text}{in_unit}"
    return f"is {value!r}; {text}{in_unit}"


def _magnitudes(
    document: Document,
    model: type[BaseModel],
    raw: Mapping[str, Any],
    at: KeyPath,
    places: set[KeyPath],
) -> list[Problem]:
    """Return warnings about numbers that look like another unit, here and in nested parts."""
    problems = []
    for name, field in model.model_fields.items():
        if name not in raw:
            continue
        place, value, kind = (*at, name), raw[name], field.annotation
        if _is_model(kind) and isinstance(value, dict):
            problems += _magnitudes(document, kind, value, place, places)
        elif place not in places and not _any_magnitude(field.json_schema_extra):
            usual = None if field.is_required() else field.default
            if message := explain_magnitude(name, value, usual):
                problems.append(document.problem(place, message))
    return problems


def _any_magnitude(extra: object) -> bool:
    return isinstance(extra, dict) and bool(extra.get("any_magnitude"))
