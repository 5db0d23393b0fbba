"""Explain which unit a setting expects when the value looks wrong."""

import re
from collections.abc import Callable, Iterable

NAMES = {
    "ns": "nanoseconds",
    "us": "microseconds",
    "ms": "milliseconds",
    "s": "seconds",
    "min": "minutes",
    "mm": "millimetres",
    "cm": "centimetres",
    "m": "metres",
    "hz": "hertz",
    "khz": "kilohertz",
    "deg": "degrees",
    "rad": "radians",
    "01": "a fraction from 0 to 1",
    "percent": "percent",
}
"""Units by the ending of a setting's name ("gaze_delay_ms"), and as people write them."""

_SAME_KIND = (
    {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0},
    {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    {"hz": 1.0, "khz": 1e3},
    {"deg": 1.0, "rad": 57.29577951308232},
    {"01": 1.0, "percent": 1e-2},
)
_SPELLINGS = {"µs": "us", "sec": "s", "second": "s", "seconds": "s", "msec": "ms", "°": "deg"}
_SPELLINGS |= {"%": "percent", "degrees": "deg", "metres": "m", "meters": "m", "milliseconds": "ms"}
_WITH_UNIT = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*([^\W\d_]+|%|°)?\s*")
_SUSPECT: dict[str, Callable[[float], bool]] = {
    "ms": lambda v: 0 < v < 0.05,
    "s": lambda v: v >= 10_000,
    "m": lambda v: v >= 100,
    "mm": lambda v: 0 < v < 0.1,
    "01": lambda v: 1 < v <= 100,
}
_LOOK_FOR = {"ms": "s", "s": "ms", "m": "cm", "mm": "m", "01": "percent"}


def unit_of(key: str) -> str | None:
    """Return the unit that a setting's name ends in, or None."""
    ending = key.rsplit("_", 1)[-1] if "_" in key else ""
    return ending if ending in NAMES else None


def stem_of(key: str) -> str:
    """Return a setting's name without its unit."""
    return key.rsplit("_", 1)[0] if unit_of(key) else key


def convert(value: float, from_unit: str, to_unit: str) -> float | None:
    """Convert between units of one kind; None when they are of different kinds."""
    for kind in _SAME_KIND:
        if from_unit in kind and to_unit in kind:
            return float(f"{value * kind[from_unit] / kind[to_unit]:.12g}")
    return None


def read_quantity(value: object) -> tuple[float, str | None] | None:
    """Read 15, "15", "15 ms" or "1,5" as (number, unit or None); None when it is not a number."""
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        try:
            return float(value), None
        except OverflowError:  # hundreds of digits
            return None
    match = _WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return None
    unit_text = (match[2] or "").lower()
    unit = _SPELLINGS.get(unit_text, unit_text)
    if unit and unit not in NAMES:
        return None
    return float(match[1].replace(",", ".")), unit or None


def explain_text(key: str, value: object) -> str | None:
    """Say how to write a number that was given as text ("15ms", "1,5"); None if it is not one."""
    quantity = read_quantity(value)
    if quantity is None or not isinstance(value, str):
        return None
    number, own_unit = quantity
    key_unit = unit_of(key)
    if key_unit is None:
        return f"is {value!r}; write the number alone: {key}: {number:g}"
    converted_value = convert(number, own_unit or key_unit, key_unit)
    if converted_value is None:
        return f"is {value!r} but expects {NAMES[key_unit]}; for example {key}: 10"
    return (
        f"is {value!r}; the unit is in the name; write only the number, "
        f"in {NAMES[key_unit]}: {key}: {converted_value:g}"
    )


def explain_unknown(key: str, value: object, names: Iterable[str]) -> str | None:
    """Say which known setting differs from an unknown one by its unit only; None if none does."""
    stem, own_unit = stem_of(key), unit_of(key)
    for name in names:
        key_unit = unit_of(name)
        if key_unit is None or name == key or stem_of(name) != stem:
            continue
        quantity = read_quantity(value)
        example = ""
        if quantity is not None:
            converted_value = convert(quantity[0], quantity[1] or own_unit or key_unit, key_unit)
            if converted_value is not None:
                example = f": {converted_value:g}"
        return f"unknown key; the setting is in {NAMES[key_unit]}, write {name}{example}"
    return None


def explain_magnitude(key: str, value: object, usual: object = None) -> str | None:
    """Say so when a number looks like another unit than its name's; None when it looks right.

    With a `usual` value (a default), a number is suspect when it is a hundred times off and the
    other unit would bring it within ten times; without, only when it is beyond all sense.
    """
    key_unit = unit_of(key)
    quantity = read_quantity(value)
    if key_unit is None or quantity is None or isinstance(value, str) or key_unit not in _LOOK_FOR:
        return None
    number, other = quantity[0], _LOOK_FOR[key_unit]
    meant_value = convert(number, other, key_unit)
    if meant_value is None:
        return None
    suspect = _SUSPECT[key_unit](number)
    if isinstance(usual, int | float) and not isinstance(usual, bool) and usual > 0 < number:
        far = not 0.01 < number / usual < 100
        suspect = suspect or (far and 0.1 <= meant_value / usual <= 10)
    if not suspect:
        return None
    return (
        f"is {number:g}, which looks like {NAMES[other]}; expects {NAMES[key_unit]}: "
        f"{key}: {meant_value:g}"
    )
