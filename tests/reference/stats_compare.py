"""Compare what the library computes with expected entries, value by value."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

TINY_TUKEY_P = 1e-8
"""Tukey probabilities expected below this need only be tiny."""
TINY_P = 1e-12
SIGNED = frozenset({"estimate", "t", "mean_diff", "diff", "dz"})
"""Columns of contrast tables that turn round with the direction of the contrast."""


@dataclass(frozen=True)
class Failure:
    """One expected value that was missed."""

    where: str
    expected: object
    got: object

    def __str__(self) -> str:
        return f"FAIL {self.where}: expected {self.expected!r}, got {self.got!r}"


@dataclass(frozen=True)
class Outcome:
    """Values compared, failures among them, and values that cannot be computed without data."""

    compared: int
    failures: tuple[Failure, ...]
    without_data: int = 0


def compare(where: str, expected: Any, got: Any, tolerance: Mapping[str, float]) -> Outcome:
    """Compare nested lists and mappings; every expected key must be there."""
    if isinstance(expected, Mapping):
        parts = [
            compare(f"{where}.{key}", value, _item(got, key), tolerance)
            for key, value in expected.items()
        ]
        return _sum(parts)
    if isinstance(expected, list):
        if not isinstance(got, Sequence) or isinstance(got, str) or len(got) != len(expected):
            return Outcome(1, (Failure(where, expected, got),))
        parts = [
            compare(f"{where}[{i}]", e, g, tolerance)
            for i, (e, g) in enumerate(zip(expected, got, strict=True))
        ]
        return _sum(parts)
    fits = _fits(where, expected, got, tolerance)
    return Outcome(1, () if fits else (Failure(where, expected, got),))


def _fits(where: str, expected: Any, got: Any, tolerance: Mapping[str, float]) -> bool:
    if expected is None:
        return got is None or (isinstance(got, float) and math.isnan(got))
    if isinstance(expected, bool | str):
        return bool(expected == got)
    if not isinstance(got, int | float) or isinstance(got, bool) or math.isnan(got):
        return False
    column = where.rsplit(".", 1)[-1].split("[")[0]
    if column == "p_tukey" and expected < TINY_TUKEY_P:
        return 0 <= got < 10 * TINY_TUKEY_P
    if (column == "p" or column.startswith("p_")) and expected < TINY_P:
        return 0 <= got < TINY_P
    allowed = tolerance.get("abs", 0.0) + tolerance.get("rel", 0.0) * abs(expected)
    return abs(got - expected) <= allowed


def _item(got: Any, key: str) -> Any:
    return got.get(key, "not mapped") if isinstance(got, Mapping) else "not mapped"


def _sum(parts: Iterable[Outcome]) -> Outcome:
    listed = list(parts)
    return Outcome(
        sum(p.compared for p in listed),
        tuple(f for p in listed for f in p.failures),
        sum(p.without_data for p in listed),
    )


def total(outcomes: Iterable[Outcome]) -> Outcome:
    """Add outcomes up."""
    return _sum(outcomes)


def by_key(
    expected: Mapping[str, list[Any]],
    columns: Sequence[str],
    rows: Mapping[Any, Mapping[str, Any]],
    *,
    key: Callable[..., Any] = lambda *labels: labels,
) -> dict[str, list[Any]]:
    """Put rows of ours into the order of an expected table; `columns` hold its labels."""
    result: dict[str, list[Any]] = {name: [] for name in expected}
    for labels in zip(*(expected[c] for c in columns), strict=True):
        row = rows.get(key(*labels), {})
        for name in expected:
            if name in columns and row:
                result[name].append(labels[list(columns).index(name)])
            else:
                result[name].append(row.get(name, "not mapped"))
    return result


def term_key(term: str) -> frozenset[str]:
    """Return a term as the set of its factors, whatever their order."""
    return frozenset(term.split(":"))


def turned(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a contrast row with its direction turned round."""
    new = {k: -v if k in SIGNED and v is not None else v for k, v in row.items()}
    if "ci_low" in row:
        new["ci_low"], new["ci_high"] = -row["ci_high"], -row["ci_low"]
    return new


def both_ways(rows: Mapping[tuple[str, str], Mapping[str, Any]]) -> dict[Any, Mapping[str, Any]]:
    """Return contrast rows by pair of levels, in either direction."""
    result: dict[Any, Mapping[str, Any]] = {}
    for (a, b), row in rows.items():
        result[(a, b)] = row
        result[(b, a)] = turned(row)
    return result
