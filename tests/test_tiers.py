from pathlib import Path

import pytest

from tests.tiers import COSTS, LIMIT_S, MARGIN, complaint, is_slow, read_costs, write_costs

TESTS = Path(__file__).parent


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
    assert "5.1 s" in complaint(limit_s + 0.1, is_marked_slow=False)
    assert "" == complaint(100.0, is_marked_slow=True)


@pytest.mark.parametrize(
    "file", sorted({t.partition("::")[0] for t in read_costs(COSTS.read_text())})
)
def test_every_test_that_has_a_cost_is_there(file: str) -> None:
    text = (TESTS.parent / file).read_text("utf-8")
    names = {
        test.partition("::")[2].partition("[")[0]
        for test in read_costs(COSTS.read_text())
        if test.startswith(f"{file}::")
    }
    assert [] == sorted(name for name in names if f"def {name}(" not in text)
