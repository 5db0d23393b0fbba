"""The synchronisation tests kept with a lab: the newest, and how old it is."""

from datetime import UTC, datetime
from typing import Any

from visavis.lab.config import LabConfig
from visavis.lab.plain_files import parse_json, read_plain

FOLDER = "sync_tests"
MAX_AGE_DAYS = 90
"""Older than this, a test says little of today's drivers and cables."""


def newest(lab: LabConfig) -> dict[str, Any] | None:
    """Return the newest real test of this lab, or None."""
    for path in sorted((lab.data_root / FOLDER).glob("sync-*.json"), reverse=True):
        try:
            record: dict[str, Any] = parse_json(read_plain(path))
            if not record["is_simulated"]:
                datetime.fromisoformat(record["made"])
                return record
        except (OSError, ValueError, KeyError, TypeError):
            continue  # not one of ours, or half copied: an older one may be whole
    return None


def age_days(record: dict[str, Any], now_iso: str) -> float:
    """Return how many days ago a test was made."""
    made_at, now = (datetime.fromisoformat(text) for text in (record["made"], now_iso))
    return (now.astimezone(UTC) - made_at.astimezone(UTC)).total_seconds() / 86400
