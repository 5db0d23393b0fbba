"""Refuse or report damaged recordings before they are analysed."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd

from visavis.lab.errors import DataError
from visavis.recording.csv_file import write_csv
from visavis.recording.integrity import DamageReport, damage_of
from visavis.recording.reader import Recording

TABLE_NAME = "damage.csv"
MAX_LINES = 40


def require_intact(sessions: Sequence[Path], *, accept: bool) -> tuple[DamageReport, ...]:
    """Verify every file of sessions; return a report on each, damaged ones where that is accepted.

    Raises:
        DataError: a recording is damaged and that was not accepted; says what is missing.
    """
    with ThreadPoolExecutor() as pool:  # hashing lets other threads run
        reports = tuple(pool.map(_find_damage, sessions))
    damage_reports = [report for report in reports if report.is_damaged]
    if damage_reports and not accept:
        raise DataError(
            f"{count_damage(damage_reports, len(sessions))}:\n{describe(damage_reports)}\n"
            "restore the files from a copy; or add --accept-damage to go on with what is left: "
            "trials that lost samples are then missing, and marked as damaged"
        )
    return reports


def count_damage(reports: Sequence[DamageReport], of: int) -> str:
    """Say how many recordings are damaged."""
    return f"{len(reports)} of {of} recordings {'is' if len(reports) == 1 else 'are'} damaged"


def describe(reports: Sequence[DamageReport]) -> str:
    """Return what every session misses, a line each."""
    lines = [
        f"  {report.session.parent.name}/{report.session.name}: {line}"
        for report in reports
        for line in report.summary()
    ]
    more = len(lines) - MAX_LINES
    return "\n".join([*lines[:MAX_LINES], *([f"  and {more} more"] if more > 0 else [])])


def write_damage(reports: Sequence[DamageReport], out_dir: Path) -> None:
    """Write the list of damaged trials beside the tables; without damage there is no file."""
    path = out_dir / TABLE_NAME
    path.unlink(missing_ok=True)
    rows = [
        (r.participant, r.number, t.part, t.trial_id, t.attempt, t.status, t.reason)
        for r in reports
        for t in r.trials
    ] + [
        (r.participant, r.number, None, None, None, "damaged", line)
        for r in reports
        for line in r.summary()
    ]
    if rows:
        names = ["participant", "session", "part", "trial_id", "attempt", "status", "reason"]
        table = pd.DataFrame(rows, columns=names)
        write_csv(table, path)


def _find_damage(session: Path) -> DamageReport:
    return damage_of(Recording(session))
