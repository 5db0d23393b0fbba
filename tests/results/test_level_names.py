"""Levels like 0.5, 1 and 2, which a table holds as 0.5, 1.0 and 2.0, keep their names."""

import numpy as np
import pandas as pd

from visavis.results.family_tests import CorrelationTest, results_of
from visavis.results.figures.family_figures import _values
from visavis.study.measures import Measure
from visavis.study.pairs import Correlate, Pairs

LEVELS = {"far": (0.5, 1, 2)}
MOOD = Measure("mood", "1", "Mood")
RNG = np.random.default_rng(4)
TRIALS = pd.DataFrame(
    {
        "participant": f"P{i:02d}",
        "far": far,
        "mood": far + (1 if far == 2 else 0) * i / 10 + RNG.normal(0, 0.2),
    }
    for i in range(12)
    for far in (0.5, 1.0, 2.0)
)
PEOPLE = pd.DataFrame({"participant": [f"P{i:02d}" for i in range(12)], "age": range(12)})


def test_pairs_of_such_levels_are_tested() -> None:
    of = Pairs("moods", ["mood"], "far", [("0.5", "1"), ("1", "2")])
    tests = results_of(of, TRIALS, PEOPLE, {"mood": MOOD}, LEVELS)
    assert [True, True] == [test.outcome is not None for test in tests]


def test_scores_are_correlated_at_such_levels() -> None:
    of = Correlate("ages", ["mood"], "far", "age", "age", "ages")
    tests = results_of(of, TRIALS, PEOPLE, {"mood": MOOD}, LEVELS)
    correlations = [test for test in tests if isinstance(test, CorrelationTest)]
    assert [("0.5", 12), ("1", 12), ("2", 12)] == [(test.level, test.n) for test in correlations]


def test_figures_of_such_levels_show_everybody() -> None:
    table, people = _values(TRIALS, "far", MOOD, ["0.5", "1", "2"], LEVELS)
    assert (12, 3) == table.shape
    assert np.isfinite(table).all()
    assert 12 == len(people)
