"""A fingerprint notices what changed and says where, but not the last bit of a number."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.experiments.fingerprint import (
    _of_array,
    _of_payload,
    _of_values,
    fingerprint_of_table,
    first_difference,
    in_layout,
    read_fingerprint,
    write_fingerprint,
)


def table(folder: Path, *rows: tuple[str, ...]) -> dict[str, object]:
    path = folder / "means.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("participant", "dwell_ms", "count"), *rows])
    return fingerprint_of_table(path)


def test_the_first_cell_that_differs_is_named(tmp_path):
    before = table(tmp_path, ("S01", "10.5", "3"), ("S02", "11.5", "4"))

    after = table(tmp_path, ("S01", "10.5", "3"), ("S02", "11.6", "5"))

    assert "means.csv: row 2, dwell_ms: 11.5 pinned, 11.6 found" == first_difference(before, after)


@pytest.mark.parametrize("rows", [2, 500])
def test_a_whole_number_in_a_table_is_compared_exactly(tmp_path, rows):
    many = [("S01", "10.5", "1000000000000")] * rows
    before = table(tmp_path, *many)

    after = table(tmp_path, *many[:-1], ("S01", "10.5", "1000000000001"))

    assert "count" in first_difference(before, after)


@pytest.mark.parametrize("rows", [2, 500])
def test_the_last_bit_of_a_number_is_no_difference(tmp_path, rows):
    value = 10.123456789
    before = table(tmp_path, *[("S01", repr(value), "3")] * rows)

    after = table(tmp_path, *[("S01", repr(np.nextafter(value, 11).item()), "3")] * rows)

    assert "" == first_difference(before, after)


def test_a_missing_cell_is_a_difference(tmp_path):
    before = table(tmp_path, ("S01", "10.5", "3"))

    after = table(tmp_path, ("S01", "", "3"))

    assert "row 1, dwell_ms" in first_difference(before, after)


def test_new_and_lost_rows_and_columns_are_named(tmp_path):
    one = table(tmp_path, ("S01", "10.5", "3"))
    two = table(tmp_path, ("S01", "10.5", "3"), ("S02", "10.5", "3"))

    assert "means.csv: rows: 1 pinned, 2 found" == first_difference(one, two)
    assert "means.csv: rows: 2 pinned, 1 found" == first_difference(two, one)
    assert "a is gone" == first_difference({"a": 1}, {})
    assert "a is new" == first_difference({}, {"a": 1})


def changed(values: np.ndarray, at: int, to: float) -> np.ndarray:
    copy = values.copy()
    copy[at] = to
    return copy


@pytest.mark.parametrize(
    "after",
    [
        changed(np.linspace(1, 2, 80), 5, np.nan),
        changed(np.linspace(1, 2, 80), 5, 1.5),
        np.linspace(1, 2, 80)[::-1].copy(),
        np.linspace(1, 2, 80).astype("f4"),
        np.linspace(1, 2, 81),
    ],
)
def test_a_column_differs_by_a_value_a_hole_an_order_a_type_or_a_length(after):
    before = {"column": _of_array(np.linspace(1, 2, 80))}

    assert first_difference(before, {"column": _of_array(after)}).startswith("column")


def test_values_of_trial_rows_differ_by_where_one_is_missing():
    before = {"column": _of_values([1.5, None, 2.5])}

    assert first_difference(before, {"column": _of_values([1.5, 2.5, None])})
    assert first_difference(before, {"column": _of_values([1.5, None, 2.6])})
    assert "" == first_difference(before, {"column": _of_values([1.5, None, 2.5])})


@pytest.mark.parametrize("length", [3, 300])
def test_a_payload_is_compared_whole_without_hashes(length):
    payload = {"points": [0.25] * length, "name": "wave", "wave_sha256": "ab"}
    before = {"event 1": ["wave", 5, _of_payload(payload)]}

    def after(**new):
        return {"event 1": ["wave", 5, _of_payload({**payload, **new})]}

    assert "" == first_difference(before, after(wave_sha256="cd"))
    assert first_difference(before, after(name="waves"))
    assert first_difference(before, after(points=[0.25] * (length - 1) + [0.26]))


@pytest.mark.parametrize("length", [3, 300])
def test_numbers_in_a_text_of_json_are_compared_as_numbers(length):
    def of(last, **more):
        text = json.dumps({"position_m": [[0.25] * length, [last]], **more})
        return {"event 1": ["crowd", 5, _of_payload({"people": text})]}

    before = of(3.7)

    assert "" == first_difference(before, of(np.nextafter(3.7, 4).item()))
    assert first_difference(before, of(3.71))
    assert first_difference(before, of(3.7, rows=2))


def test_a_fingerprint_is_read_as_it_was_written(tmp_path):
    found = table(tmp_path, ("S01", "10.5", "3"), ("Zoë", "nan", "-4"))

    write_fingerprint(found, tmp_path / "pinned.json")

    assert found == read_fingerprint(tmp_path / "pinned.json")


def test_a_table_in_another_layout_is_compared_cell_by_cell(tmp_path):
    before = table(tmp_path, ("S01", "10.5", "3"), ("S02", "11.5", "4"))
    path = tmp_path / "means_by_gaze.csv"

    def after(*rows):
        with path.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([("n", "new", "participant", "dwell_ms"), *rows])
        moved = {"means.csv": "means_by_gaze.csv", "means.csv: count": "n"}
        return in_layout(before, fingerprint_of_table(path), moved)

    same = after(("3", "x", "S01", "10.5"), ("4", "x", "S02", "11.5"))
    other = after(("3", "x", "S01", "10.5"), ("4", "x", "S02", "11.6"))
    gone = in_layout(before, fingerprint_of_table(path), {"means.csv": "means_by_gaze.csv"})

    assert "" == first_difference(before, same)
    assert "means.csv: row 2, dwell_ms: 11.5 pinned, 11.6 found" == first_difference(before, other)
    assert "count" in first_difference(before, gone)


def test_a_table_that_is_gone_and_an_event_that_is_new_are_differences(tmp_path):
    before = table(tmp_path, ("S01", "10.5", "3"))

    assert "means.csv: columns is gone" == first_difference(before, in_layout(before, {}))
    assert "event 2 is new" == first_difference(
        {"event 1": 1}, in_layout({"event 1": 1}, {"event 1": 1, "event 2": 2})
    )
    assert "" == first_difference(before, in_layout(before, {**before, "other.csv: rows": 2}))


def test_a_text_that_changed_its_name_is_compared_by_the_new_one(tmp_path):
    before = table(tmp_path, ("anxiety_total", "10.5", "3"))
    after = table(tmp_path, ("social_anxiety_total", "10.5", "3"))
    names = {"anxiety_total": "social_anxiety_total"}

    assert first_difference(before, in_layout(before, after))
    assert "" == first_difference(before, in_layout(before, after, renamed=names))
