"""A row says whether its limit is met, and whether the computer could meet it at all."""

import pytest

from benchmarks.all import line_of
from benchmarks.table import Row


@pytest.mark.parametrize(
    ("is_explained", "row"),
    [
        (True, Row("time", 3.0, "ms", 1.0, floor=2.0, floor_name="the driver alone")),
        (False, Row("time", 3.0, "ms", 1.0, floor=0.9, floor_name="the driver alone")),
        (True, Row("rate", 3.0, "1/s", 9.0, at_least=True, floor=6.0, floor_name="one pass")),
        (False, Row("rate", 3.0, "1/s", 9.0, at_least=True, floor=9.5, floor_name="one pass")),
        (False, Row("time", 3.0, "ms", 1.0, floor=2.0, floor_is_ours=True)),
        (False, Row("time", 3.0, "ms", 1.0)),
        (False, Row("time", 3.0, "ms", floor=2.0)),
    ],
)
def test_a_floor_explains_a_limit_only_where_it_misses_it_too(is_explained: bool, row: Row) -> None:
    assert is_explained == row.is_explained


def test_a_missed_row_says_what_its_floor_is_and_how_far_above_it_is() -> None:
    row = Row("time", 3.0, "ms", 1.0, floor=2.0, floor_name="the driver alone")
    assert "the driver alone: 2 ms; this is 1.50 times that" in line_of(row, None)
    rate = Row("rate", 3.0, "1/s", 9.0, at_least=True, floor=6.0, floor_name="one pass")
    assert "one pass: 6 1/s; this is 2.00 times that" in line_of(rate, None)


def test_a_row_within_its_limit_is_printed_without_its_floor() -> None:
    row = Row("time", 0.5, "ms", 1.0, floor=0.4, floor_name="the driver alone")
    assert "driver" not in line_of(row, None)


def test_a_floor_of_nothing_is_printed_without_a_ratio() -> None:
    row = Row("time", 3.0, "ms", 1.0, floor=0.0, floor_name="nothing")
    assert "nothing: 0 ms" == row.floor_line
