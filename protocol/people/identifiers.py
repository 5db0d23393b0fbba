"""Participant labels: a number and a check letter that catches typing errors."""

import re

CHECK_LETTERS = "ABCDEFGHJKLMNPRSTUVWXYZ"
"""23 letters, without I, O and Q, which are misread; the order gives each its value."""

MAX_NUMBER = 999_999
_LABEL = re.compile(r"([A-Z]*?)(\d{1,6})([A-Z])")


def check_letter(number: int) -> str:
    """Return the check letter: the number modulo 23.

    23 is a prime above twice 9 and divides no power of ten, so a wrong digit (a change of at most
    9 times a power of ten) and two neighbouring digits exchanged (a change of 9 times a
    difference below 10 times a power of ten) always change the letter. A digit and the letter
    exchanged are no label any more.
    """
    return CHECK_LETTERS[number % 23]


def make_label(number: int, prefix: str = "") -> str:
    """Write a label: prefix, number with at least two digits, check letter ("07H")."""
    return f"{prefix}{number:02d}{check_letter(number)}"


def read_label(text: str, prefix: str = "") -> int | None:
    """Return the number of a label with the right prefix and check letter, else None.

    Leading zeros and lower case do not matter.
    """
    match = _LABEL.fullmatch(text.strip().upper())
    if match is None or match[1] != prefix:
        return None
    number = int(match[2])
    return number if 1 <= number <= MAX_NUMBER and match[3] == check_letter(number) else None


def means_label(text: str, label: str) -> bool:
    """Tell whether somebody who types this may mean a label: itself, without its prefix, or its
    number; leading zeros and lower case do not matter.
    """
    match, typed = _LABEL.fullmatch(label), text.strip().upper()
    if typed == label or match is None:
        return typed == label
    number, letter = int(match[2]), match[3]
    parts = re.fullmatch(r"([A-Z]*?)(\d{1,6})([A-Z]?)", typed)
    return (
        parts is not None
        and parts[1] in ("", match[1])
        and int(parts[2]) == number
        and (parts[3] == letter or not (parts[1] or parts[3]))
    )


def is_one_typo_apart(text: str, label: str) -> bool:
    """Tell whether one wrong, missing or extra character, or one exchange, lies between them."""
    a, b = text.strip().upper(), label
    if len(a) == len(b):
        differ = [i for i in range(len(a)) if a[i] != b[i]]
        if len(differ) == 2:
            i, j = differ
            return j == i + 1 and a[i] == b[j] and a[j] == b[i]
        return len(differ) == 1
    longer, shorter = (a, b) if len(a) > len(b) else (b, a)
    if len(longer) - len(shorter) != 1:
        return False
    return any(longer[:i] + longer[i + 1 :] == shorter for i in range(len(longer)))
