"""Which session of a person comes next, and when it is due."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from visavis.lab.errors import UsageError
from visavis.recording.manifest import read_manifest
from visavis.recording.reader import Recording


@dataclass(frozen=True)
class NextSession:
    """The session of a person that comes next.

    `first_day` and `last_day` are the days on which it is due ("" where the study names none);
    `days` how many have passed since the session before.
    """

    number: int
    name: str
    first_day: str = ""
    last_day: str = ""
    days: float = 0.0
    is_early: bool = False
    is_late: bool = False

    @property
    def words(self) -> str:
        """When it is due, in words; "" where it may be at any time."""
        if not self.first_day:
            return ""
        days = (
            f"on {self.first_day}"
            if self.first_day == self.last_day
            else f"from {self.first_day} to {self.last_day}"
        )
        return f"session {self.number} ({self.name}) is due {days}"


def next_session(
    person: Path, names: Sequence[str], days_between: tuple[float, float] | None, now_iso: str
) -> NextSession:
    """Return the session that comes next; `person` is the folder of their sessions (sub-…).

    Raises:
        UsageError: a session is not finished, or there were all of them.
    """
    last, label = None, person.name.removeprefix("sub-")
    for number, name in enumerate(names, start=1):
        path = person / f"ses-{number:03d}"
        if not path.exists():
            break
        if Recording(path).status != "complete":
            raise UsageError(
                f"session {number} ({name}) of {label} is not finished; go on with it: "
                f"visavis resume {path}"
            )
        last = path
    else:
        raise UsageError(
            f"{label} has been to all {len(names)} sessions ({', '.join(names)}); nothing is left "
            "to do"
        )
    if last is None or days_between is None:
        return NextSession(number, name)
    part = read_manifest(last).parts[-1]
    end = datetime.fromisoformat(part.ended_wall_iso or part.started_wall_iso)
    now = datetime.fromisoformat(now_iso)
    first, latest = (end + timedelta(days=days) for days in days_between)
    return NextSession(
        number,
        name,
        f"{first:%Y-%m-%d}",
        f"{latest:%Y-%m-%d}",
        (now - end) / timedelta(days=1),
        # days, not hours: who came at noon may come a week later in the morning
        is_early=now.date() < first.date(),
        is_late=now.date() > latest.date(),
    )
