"""Several sessions of one person as levels of a factor, and who did not come to all of them."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import pandas as pd

from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import SESSION
from visavis.recording.manifest import Manifest
from visavis.results.intake import SessionIntake

SESSION_NUMBER: Final = Column("session_number", "1", "number of the session, from 1")
"""The column that keeps the number where `session` holds the name."""


def with_session_names(intake: SessionIntake, names: Sequence[str]) -> SessionIntake:
    """Return an intake whose tables say the session's name, where a study names its sessions."""
    if not names:
        return intake
    number = intake.manifest.session
    name = names[number - 1]

    def named(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{SESSION: name}) if SESSION in table else table

    return replace(
        intake,
        rows=named(intake.rows).assign(**{SESSION_NUMBER.name: number}),
        sensitivity=named(intake.sensitivity),
        course=named(intake.course),
        fixations=named(intake.fixations),
        blocks=intake.blocks.assign(**{SESSION: name}) if len(intake.blocks) else intake.blocks,
    )


def people_of(sessions: Sequence[SessionIntake], names: Sequence[str]) -> list[dict[str, Any]]:
    """Return a row for each person: what they answered, in all of their sessions.

    A person's first session gives columns their names; those of later ones end in the session's
    name ("calm_after"). Groups of people follow from the first.
    """
    people: dict[str, dict[str, Any]] = {}
    for one in sorted(sessions, key=lambda s: s.manifest.session):
        number = one.manifest.session
        own = dict(one.person)
        who = str(own["participant"])
        if names and number > 1:
            own = {column_in(c, names[number - 1]): v for c, v in own.items()}
            own["participant"] = who
        people[who] = own | people.get(who, {})
    in_order = dict.fromkeys(str(s.person["participant"]) for s in sessions)
    return [people[who] for who in in_order]


def column_in(column: str, session_name: str) -> str:
    """Return what a column of people is called for a session after the first."""
    return f"{column}_{session_name}"


def later_columns(columns: Mapping[str, Column], names: Sequence[str]) -> dict[str, Column]:
    """Return the descriptions of columns of people for the sessions after the first."""
    return {
        column_in(c.name, name): replace(
            c, name=column_in(c.name, name), description=f"{c.description} (session {name})"
        )
        for name in names[1:]
        for c in columns.values()
    }


def planned_counts_of(sessions: Sequence[SessionIntake]) -> dict[str, int]:
    """Return how many trials were planned for each person, in the sessions that they began."""
    counts: Counter[str] = Counter()
    for one in sessions:
        counts[str(one.manifest.participant)] += one.planned_count
    return dict(counts)


def absence_lines(manifests: Sequence[Manifest], names: Sequence[str]) -> Iterator[str]:
    """Yield who did not come to which session, and what this means for tests."""
    if not names:
        return
    attended: dict[str, set[int]] = {}
    for one in manifests:
        attended.setdefault(str(one.participant), set()).add(one.session)
    absent = {
        who: [name for n, name in enumerate(names, 1) if n not in numbers]
        for who, numbers in sorted(attended.items())
    }
    absent = {who: missing for who, missing in absent.items() if missing}
    for who, missing in absent.items():
        yield f"{who} has no session {', '.join(missing)}"
    if absent:
        yield (
            "tests over sessions are of complete cases: who lacks a session is in none of them, "
            "as nothing can be said of how they changed; other tests use the sessions they have"
        )
