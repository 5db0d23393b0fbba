"""What `visavis doctor` says: findings by section, with what to do where something is amiss."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "warning", "missing"]


@dataclass(frozen=True)
class Finding:
    """One line. `note` is worth knowing, `warning` may spoil a session, `missing` stops it."""

    section: str
    subject: str
    level: Level
    found: str
    remedy: str = ""


def worst(findings: tuple[Finding, ...]) -> Level:
    """Return the gravest level among findings."""
    order: tuple[Level, ...] = ("ok", "note", "warning", "missing")
    return max((f.level for f in findings), key=order.index, default="ok")
