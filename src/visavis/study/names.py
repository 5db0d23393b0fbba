"""Names of factors and levels that come through every table: ours, pandas' and R's.

A table is text. What a program takes for a number, a truth value or nothing does not come back as
the level that was written.
"""

import io
import keyword
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final

import pandas as pd

from visavis.lab.spelling import spellings_of
from visavis.protocol.plan.columns import ANALYSED_COLUMNS, ENGINE_COLUMNS
from visavis.protocol.plan.design import Factor
from visavis.recording.csv_file import escape_formulas

UNUSED_COLUMN: Final = "part"
"""The column that earlier versions read: a factor of this name takes its place."""
GROUP_COLUMN: Final = "group"
"""The column of a participant's group, which the only factor between people may be called."""
TRIAL_COLUMNS: Final = frozenset(c.name for c in (*ENGINE_COLUMNS, *ANALYSED_COLUMNS)) - {
    UNUSED_COLUMN
}
"""Columns that every trial of every study has, without those that factors may be called."""
R_WORDS: Final = frozenset(
    ("repeat", "function", "next", "TRUE", "FALSE", "NULL", "Inf", "NaN", "NA", "T", "F")
)
"""Words of R that Python does not reserve, too; R renames such columns or takes them for values."""
_R_VALUES: Final = re.compile(
    r"T|F|TRUE|FALSE|NA|[+-]?(inf|infinity|nan|na)|[+-]?0x[0-9a-f.]+(p[+-]?\d+)?"
    r"|[+-]?[\d.]*\d[\d.]*(e[+-]?\d+)?i",
    re.IGNORECASE,
)
"""Texts, besides decimal numbers, that R's read.csv does not take for text."""


def reserved_names(factors: Sequence[Factor]) -> frozenset[str]:
    """Return the columns of every trial, which none of these factors and no derived column may be
    called.
    """
    between = [f.name for f in factors if f.between]
    return TRIAL_COLUMNS - {GROUP_COLUMN} if between == [GROUP_COLUMN] else TRIAL_COLUMNS


def is_name(name: str) -> bool:
    """Tell whether a trial, pandas and R can all call a column so."""
    is_word = name.isidentifier() and not keyword.iskeyword(name)
    return is_word and not name.startswith("_") and name not in R_WORDS


def impossible_levels(name: str, levels: Sequence[Any]) -> Iterator[str]:
    """Yield what no table can hold: levels that are missing values, or that look the same."""
    for level in levels:
        if not isinstance(level, str | bool | int | float):
            yield f"factor {name!r} has the level {level!r}; levels are texts, numbers or booleans"
        elif level == "" or (isinstance(level, float) and not math.isfinite(level)):
            yield f"factor {name!r} has the level {level!r}, which tables take for a missing value"
    texts = Counter(str(level) for _, level in dict.fromkeys((type(v), v) for v in levels))
    for text in (text for text, count in texts.items() if count > 1):
        yield f"factor {name!r} has {text} as a text and as a number or boolean; keep one of them"


def changed_levels(name: str, levels: Sequence[Any]) -> Iterator[str]:
    """Yield levels that would not come back from a table as they are."""
    texts = [level for level in levels if isinstance(level, str) and level]
    for level in texts:
        why = _why_changed(level)
        if why:
            yield f"factor {name!r} has the level {level!r}: {why}; name it otherwise"
    labels = [str(level) for level in levels if not isinstance(level, bool) and level != ""]
    for spelt in spellings_of(labels).values():
        yield (
            f"factor {name!r} has levels that differ by spelling alone (case, blanks, leading "
            f"zeros), which statistics take for one: {', '.join(map(repr, spelt))}"
        )
    numbers = [level for level in texts if _is_number(level)]
    if numbers and len(numbers) == len(levels) and _read_back(numbers) != numbers:
        yield (
            f"factor {name!r} has numbers as texts ({', '.join(map(repr, numbers))}), which are "
            "read as other numbers when they stand together; write them as numbers"
        )


def _why_changed(level: str) -> str:
    """Return why a text does not come back from a table by itself; "" where it does."""
    if level != level.strip():
        return "tables lose blanks at its ends"
    if not level.isprintable():
        return "it holds characters that cannot be printed"
    if len(escape_formulas(pd.DataFrame({"level": [level]}))[1]):
        return "a spreadsheet would take it for a formula"
    back = _read_back([level])
    if back == ["nan"]:
        return "pandas reads it as a missing value"
    if back != [level]:
        return f"pandas reads it as {back[0]}"
    return "R does not read it as text" if _R_VALUES.fullmatch(level) else ""


def _read_back(levels: Sequence[str]) -> list[str]:
    """Return texts as pandas reads them from a CSV file with its defaults."""
    cells = ['"' + v.replace('"', '""') + '"' if re.search('[",]', v) else v for v in levels]
    return [str(v) for v in pd.read_csv(io.StringIO("\n".join(("level", *cells))))["level"]]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
