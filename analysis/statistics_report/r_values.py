"""Texts and lists of them, written as R reads them."""

from collections.abc import Sequence


def r_string(text: str) -> str:
    """Return a text as an R string."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def r_vector(values: Sequence[str]) -> str:
    """Return texts as an R vector."""
    return f"c({', '.join(r_string(v) for v in values)})"
