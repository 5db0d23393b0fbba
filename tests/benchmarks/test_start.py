"""A goal is asked for on another computer as the same improvement over the start."""

from pathlib import Path

import pytest

from benchmarks import start
from benchmarks.all import GOALS, with_goals_here
from benchmarks.table import Row


def test_a_goal_is_larger_by_as_much_as_the_start_took_longer_here() -> None:
    row = Row("1000 ART studies 16x2x3", 1.3, "s", 0.8)
    (here,) = with_goals_here([row], {row.name: 2.7})
    assert pytest.approx(1.6) == here.limit
    assert not here.is_missed


def test_a_goal_of_a_rate_is_smaller_by_as_much_as_the_start_was_slower_here() -> None:
    row = Row("Squad", 60.0, "million/s", 90.0, at_least=True)
    (here,) = with_goals_here([row], {"Squad": 33.5})
    assert pytest.approx(45.0) == here.limit


def test_a_goal_stays_where_the_start_was_not_measured() -> None:
    row = Row("Squad", 60.0, "million/s", 90.0, at_least=True)
    assert [row] == with_goals_here([row], {})


def test_every_figure_of_the_start_belongs_to_a_goal() -> None:
    assert set(start.AT_START) <= {*GOALS, "Squad"} | {
        "off-screen, 12 people, stereo",
    }


def checkout(tmp_path: Path, code: str) -> Path:
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "benchmarks" / "__init__.py").touch()
    (tmp_path / "benchmarks" / "crowd_contact.py").write_text(code, "utf-8")
    return tmp_path


def test_figures_of_an_older_checkout_have_the_names_of_today(tmp_path: Path) -> None:
    rows = '[{"people": 299.0, "cpu_ms": 0.02}]'
    older = checkout(tmp_path, f"print({rows!r})\nraise SystemExit(1)")
    assert {"contacts, 6 × 300": 0.02} == start.rows_at_start(older, "crowd_contact")


def test_an_older_checkout_that_prints_nothing_is_named(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"(?s)crowd_contact printed no figures.*gone"):
        start.rows_at_start(checkout(tmp_path, "raise ValueError('gone')"), "crowd_contact")
