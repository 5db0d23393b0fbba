"""The table of genuine software: its rows are those of the bench, and their tests exist."""

import pytest

from tests.genuine.seen import HEAD, NOT_YET, PAGE, ROWS, Row, read_page, version_of, write_page
from tests.tiers import ROOT
from visavis.devices.registry import built_in


def test_page_has_the_rows_of_the_bench() -> None:
    text = PAGE.read_text("utf-8")
    seen = read_page(text)
    assert [row.key for row in ROWS] == list(seen)
    assert text == write_page(seen, text)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: "-".join(row.key[::-1]))
def test_row_names_drivers_and_tests_that_exist(row: Row) -> None:
    assert set(row.devices) <= set(built_in())
    assert all((ROOT / "tests" / test).is_file() for test in row.tests)


def test_row_that_was_not_run_keeps_what_was_seen_before() -> None:
    first = ROWS[0].key
    text = write_page({first: ("1.0", "2026-01-02")}, f"Before.\n\n{HEAD}\nold\n\nAfter.\n")
    assert text.startswith("Before.\n\n")
    assert text.endswith("\n\nAfter.\n")
    assert read_page(text)[first] == ("1.0", "2026-01-02")
    assert {day for _, day in list(read_page(text).values())[1:]} == {NOT_YET}


def test_software_that_is_not_installed_has_no_version() -> None:
    assert version_of("debian:no-such-package-at-all") is None
    assert version_of("no-such-package-at-all") is None
    assert version_of("numpy")
