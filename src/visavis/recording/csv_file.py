"""Write tables as CSV in which a spreadsheet runs no formula."""

import json
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from visavis.recording.durable import replace_file

ESCAPE_NOTE = (
    "text that a spreadsheet would take for a formula has an apostrophe (') before it, which is "
    "no part of it"
)
CELLS_AT_ONCE = 20_000
"""How many cells are held as text at once; what is written does not depend on it."""
_FORMULA = re.compile(
    r"[\x00-\x1f]|[\s\u200b-\u200f\u2060\ufeff]*[=+\-@\uff1d\uff0b\uff0d\uff20\ufe62-\ufe66\ufe6b]"
)
"""Spreadsheets skip blanks, and some read full-width and small signs as the usual ones."""
_NUMBER = re.compile(r"[+-]?[0-9]+([.][0-9]*)?([eE][+-]?[0-9]+)?")


def write_csv(table: pd.DataFrame, path: Path) -> tuple[str, ...]:
    """Write a table in UTF-8 with dot decimals, missing values empty; replaces what is there.

    Truths are TRUE and FALSE, which R, pandas and spreadsheets all take for truths.
    Text cells and column names beginning with = + - @, also behind blanks or full-width, or with a
    control character, which spreadsheets run, get an apostrophe before them. Returns the columns in
    which that was needed; say it in the table's dictionary with `note_escaped_columns`. Raises
    OSError when the disk refuses.
    """
    safe, escaped_columns = escape_formulas(_with_truths(table))
    rows = max(1, CELLS_AT_ONCE // max(1, len(safe.columns)))
    safe.to_csv(path, index=False, encoding="utf-8", lineterminator="\n", na_rep="", chunksize=rows)
    return escaped_columns


def csv_text(table: pd.DataFrame) -> str:
    """Return a table as the text of a CSV file, as `write_csv` writes it."""
    safe, _ = escape_formulas(_with_truths(table))
    return str(safe.to_csv(index=False, lineterminator="\n", na_rep=""))


def _with_truths(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose columns of truths are the words that every program reads as truths."""
    words = {True: "TRUE", False: "FALSE"}
    columns = {}
    for i in range(len(table.columns)):
        values = table.iloc[:, i]
        if values.dtype == bool or isinstance(values.dtype, pd.BooleanDtype):
            columns[i] = values.astype(object).map(words, na_action="ignore")
        elif values.dtype == object:
            there = values[values.notna()]
            if len(there) and all(isinstance(v, bool | np.bool_) for v in there):
                columns[i] = values.map(lambda v: words[bool(v)], na_action="ignore")
    if not columns:
        return table
    whole = {i: columns.get(i, table.iloc[:, i]) for i in range(len(table.columns))}
    with_words = pd.DataFrame(whole, index=table.index)
    with_words.columns = table.columns
    return with_words


def escape_formulas(table: pd.DataFrame) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return a table without formulas in its texts, and the columns that had any."""
    columns, escaped_columns = {}, []
    for i, name in enumerate(table.columns):
        values = table.iloc[:, i]
        if values.dtype == object or isinstance(values.dtype, pd.StringDtype):
            texts = list(values)
            if any(_is_formula(v) for v in texts):
                values = pd.Series([_safe(v) for v in texts], index=table.index, dtype=object)
                escaped_columns.append(str(name))
        columns[i] = values
    if not escaped_columns and not any(_is_formula(n) for n in table.columns):
        return table, ()
    safe = pd.DataFrame(columns, index=table.index)
    safe.columns = pd.Index([_safe(n) for n in table.columns])
    return safe, tuple(escaped_columns)


def note_escaped_columns(sidecar: Path, columns: Collection[str]) -> None:
    """Note in a table's JSON dictionary that texts of these columns start with an apostrophe."""
    if not columns:
        return
    dictionary: dict[str, Any] = json.loads(sidecar.read_text(encoding="utf-8"))
    for name in columns:
        entry = dictionary.setdefault(name, {})
        before = entry.get("Description", "")
        entry["Description"] = f"{before}; {ESCAPE_NOTE}" if before else ESCAPE_NOTE
    text = json.dumps(dictionary, indent=1, ensure_ascii=False) + "\n"
    replace_file(sidecar, text.encode())


def unescape(text: str) -> str:
    """Return a text as it was before `write_csv` put an apostrophe before a formula."""
    return text[1:] if text.startswith("'") and _is_formula(text[1:]) else text


def _safe(value: Any) -> Any:
    return "'" + value if _is_formula(value) else value


def _is_formula(value: Any) -> bool:
    return (
        isinstance(value, str)
        and _FORMULA.match(value) is not None
        and _NUMBER.fullmatch(value.strip()) is None
    )
