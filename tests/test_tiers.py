from pathlib import Path

from tests.tiers import (
    COSTS,
    LIMIT_S,
    MARGIN,
    complaint,
    is_slow,
    is_there,
    read_costs,
    write_costs,
)


def test_costs_are_read_as_they_were_written_the_most_expensive_first() -> None:
    costs = {"tests/a.py::test_b[1 2-x]": 2.5, "tests/a.py::test_c": 0.1, "tests/a.py::test_d": 9.0}
    text = write_costs(costs)
    assert {"tests/a.py::test_b[1 2-x]": 2.5, "tests/a.py::test_d": 9.0} == read_costs(text)
    assert ["9.0", "2.5"] == [line.split()[0] for line in text.splitlines()[-2:]]


def test_a_test_of_more_than_two_seconds_belongs_to_the_second_tier() -> None:
    assert [False, True] == [is_slow(2.0), is_slow(2.1)]


def test_a_test_that_grew_out_of_the_first_tier_is_named_and_those_of_the_second_may_grow() -> None:
    limit_s = LIMIT_S * MARGIN
    assert "" == complaint(limit_s, is_marked_slow=False)
    assert f"{limit_s + 0.1:.1f} s" in complaint(limit_s + 0.1, is_marked_slow=False)
    assert "" == complaint(100.0, is_marked_slow=True)


def test_every_test_that_has_a_cost_is_there() -> None:
    assert [] == [test for test in read_costs(COSTS.read_text("utf-8")) if not is_there(test)]


def test_a_test_is_there_by_its_name_in_its_file(tmp_path: Path) -> None:
    (tmp_path / "test_a.py").write_text("def test_b() -> None: ...", "utf-8")
    names = (
        "test_a.py::test_b",
        "test_a.py::test_b[1-x]",
        "test_a.py::test_c",
        "test_d.py::test_b",
    )
    assert [True, True, False, False] == [is_there(name, tmp_path) for name in names]
