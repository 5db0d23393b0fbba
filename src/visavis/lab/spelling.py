"""When two names are one that is spelt in two ways: the rule of studies and of statistics."""

import re
import unicodedata
from collections.abc import Sequence

_NUMBER = re.compile(r"[+-]?\d+([.,]\d+)?")
_LEADING_ZEROS = re.compile(r"(?<![\d.,])0+(?=\d)")
_BLANKS = re.compile(r"\s+")


def plain_name(label: str) -> str:
    """Return a name without what spelling alone adds: case, blanks, leading zeros, .0 of numbers.

    Numbers that are equal have one name, such as 1, 01 and 1.0; of 0.5 and 0.05 each has its own.
    """
    name = _BLANKS.sub("", unicodedata.normalize("NFC", label)).casefold()
    if _NUMBER.fullmatch(name):
        whole, _, digits = name.replace(",", ".").lstrip("+").partition(".")
        sign, whole = ("-", whole[1:]) if whole.startswith("-") else ("", whole)
        digits = digits.rstrip("0")
        return sign + (whole.lstrip("0") or "0") + (f".{digits}" if digits else "")
    return _LEADING_ZEROS.sub("", name)


def spellings_of(labels: Sequence[str]) -> dict[str, list[str]]:
    """Return by plain name the labels, in order, of every name that is spelt in several ways."""
    by_name: dict[str, list[str]] = {}
    for label in dict.fromkeys(labels):
        by_name.setdefault(plain_name(label), []).append(label)
    return {name: spelt for name, spelt in by_name.items() if len(spelt) > 1}
