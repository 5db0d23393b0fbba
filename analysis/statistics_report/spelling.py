"""Find names of people and groups that differ by their spelling alone: 1 and 1.0, P05 and p05."""

from collections.abc import Sequence
from dataclasses import replace

from visavis.analysis.statistics.errors import StatisticsError
from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.spelling import spellings_of

MAX_NAMED = 4


class OneNameSpeltTwice(StatisticsError):
    """Names of people or groups differ by case, blanks, leading zeros or .0 alone."""


def refuse_spellings(table: DataTable, column: str) -> None:
    """Refuse a column in which names differ by spelling alone, unless the table says they differ.

    Raises:
        OneNameSpeltTwice: with the spellings and the first row of each.
    """
    labels = table.texts(column)
    spelt_twice = {} if table.spellings_differ else spellings_of([v for v in labels if v])
    if not spelt_twice:
        return
    several = [
        " and ".join(f"{label!r} ({table.place(labels.index(label))})" for label in spelt)
        for spelt in list(spelt_twice.values())[:MAX_NAMED]
    ]
    more = len(spelt_twice) - len(several)
    raise OneNameSpeltTwice(
        f"{table.name}: {column} holds names that differ by spelling alone: {'; '.join(several)}"
        + (f"; and {more} more" if more else "")
        + ". Correct them, or say --spelling same (each is one) or --spelling apart (they differ)"
    )


def with_one_spelling(table: DataTable, columns: Sequence[str]) -> DataTable:
    """Return a table in which names have their most frequent spelling, with a note per column."""
    cells, notes = table.cells.copy(), list(table.notes)
    for column in dict.fromkeys(columns):
        labels = table.texts(column)
        usual_of: dict[str, str] = {}
        for spelt in spellings_of([label for label in labels if label]).values():
            usual = max(spelt, key=labels.count)
            usual_of |= {label: usual for label in spelt if label != usual}
        if usual_of:
            cells[column] = [usual_of.get(label, label) for label in labels]
            pairs = [f"{other!r} as {usual!r}" for other, usual in usual_of.items()]
            more = f" and {len(pairs) - MAX_NAMED} more" if len(pairs) > MAX_NAMED else ""
            notes.append(f"{column}: read {', '.join(pairs[:MAX_NAMED])}{more}")
    return replace(table, cells=cells, notes=tuple(notes))
