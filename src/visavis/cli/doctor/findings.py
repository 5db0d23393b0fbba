"""Findings of `visavis doctor`, by section, each with a remedy where something is wrong."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "warning", "missing"]


@dataclass(frozen=True)
class Finding:
    """One line of the report.

    `note` is worth knowing, `warning` may spoil a session, `missing` stops it.
    """

    section: str
    subject: str
    level: Level
    found: str
    remedy: str = ""


def worst(findings: tuple[Finding, ...]) -> Level:
    """Return the most serious level among findings; ok where there are none."""
    order: tuple[Level, ...] = ("ok", "note", "warning", "missing")
    return max((f.level for f in findings), key=order.index, default="ok")
