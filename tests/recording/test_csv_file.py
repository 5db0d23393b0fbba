"""What is written as CSV is text to a spreadsheet, and reads back otherwise unchanged."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from visavis.recording.csv_file import note_escaped_columns, write_csv


@pytest.mark.parametrize(
    "text",
    [
        *("=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\x00=1"),
        *(" =1+1", "\u00a0\u3000=1+1", "\ufeff=1", "\u200b@x"),
        *("\uff1d1+1", " \uff0b1", "\uff0d1", "\uff20x", "\ufe661"),
    ],
)
def test_a_formula_becomes_text(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.csv"
    assert ("comment",) == write_csv(pd.DataFrame({"comment": ["fine", text], "n": [1, -2]}), path)
    with path.open(encoding="utf-8", newline="") as file:
        content = file.read()
    assert f"'{text}" in content.replace('""', '"')
    assert "\n-2" not in content
    assert ",-2" in content


def test_numbers_dates_and_missing_values_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    table = pd.DataFrame({"mixed": ["-0.5", "+3", " -1e-7", None, -2], "day": ["2026-03-02"] * 5})
    assert () == write_csv(table, path)
    assert "mixed,day\n-0.5,2026-03-02\n+3,2026-03-02\n -1e-7,2026-03-02\n,2026-03-02\n" in (
        path.read_text()
    )


def test_column_names_are_neutralised_too(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_csv(pd.DataFrame({"=x": [1], "y": ["=z"]}), path)
    assert "'=x,y\n1,'=z\n" == path.read_text()


def test_the_dictionary_says_where(tmp_path: Path) -> None:
    sidecar = tmp_path / "t.json"
    sidecar.write_text(json.dumps({"comment": {"Description": "free comment"}, "n": {}}))
    note_escaped_columns(sidecar, ("comment",))
    told = json.loads(sidecar.read_text())
    assert told["comment"]["Description"].startswith("free comment; text that a spreadsheet")
    assert {} == told["n"]


def test_four_times_the_rows_take_no_more_memory_to_write(tmp_path: Path) -> None:
    def most_bytes(rows: int) -> int:
        table = pd.DataFrame(np.full((rows, 100), 1 / 3))
        tracemalloc.start()
        write_csv(table, tmp_path / "t.csv")
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    few = most_bytes(250)

    assert most_bytes(1000) < 1.5 * few


def test_what_is_written_does_not_depend_on_how_much_is_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mixed = [1.5, None, "x", -2, 1e-300] * 4
    table = pd.DataFrame({"mixed": mixed, "number": np.geomspace(1e-9, 1e9, 20)})
    write_csv(table, tmp_path / "whole.csv")
    monkeypatch.setattr("visavis.recording.csv_file.CELLS_AT_ONCE", 3)
    write_csv(table, tmp_path / "pieces.csv")

    assert (tmp_path / "whole.csv").read_bytes() == (tmp_path / "pieces.csv").read_bytes()
