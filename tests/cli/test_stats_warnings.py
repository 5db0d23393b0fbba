"""Where a test finds what is not there more often than it says, its printed answer says so."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from benchmarks.false_positives import ALPHA, HELD, Situation, measure, situations
from visavis.cli.main import app

TWO = ["--dv", "y", "--within", "A", "B", "--subject", "s"]
GROUPS = ["--dv", "y", "--between", "g"]
LEAKS = [
    ("lognormal", "A", "art", ["--test", "art", *TWO]),
    ("lognormal", "A:B", "art", ["--test", "art", *TWO]),
    ("lognormal", "A:B", "rm", ["--test", "rm", *TWO]),
    ("lognormal", "A:B", "mixed", ["--test", "mixed", *TWO]),
    ("rating at its ceiling", "A:B", "art", ["--test", "art", *TWO]),
    ("rating at its ceiling", "A:B", "rm", ["--test", "rm", *TWO]),
    ("share of 9 trials", "A:B", "art", ["--test", "art", *TWO]),
    ("share of 9 trials", "A:B", "rm", ["--test", "rm", *TWO]),
    ("groups of 6 and 18, SD 3 and 1", "g", "mannwhitney", ["--test", "mannwhitney", *GROUPS]),
    ("groups of 6, 10, 18, SD 3, 2, 1", "g", "anova", ["--test", "anova", *GROUPS]),
    ("groups of 6, 10, 18, SD 3, 2, 1", "g", "kruskal", ["--test", "kruskal", *GROUPS]),
    (
        "the same, SD 3 and 1",
        "c:g",
        "rm",
        ["--test", "rm", "--dv", "y", "--within", "c", "--between", "g", "--subject", "s"],
    ),
]
"""Situation, null effect, test of the table that `benchmarks.false_positives` prints, command."""


def situation_of(name: str, null: str, test: str) -> Situation:
    found = next(s for s in situations() if (s.name, s.null) == (name, null))
    return Situation(name, null, found.make, {test: found.tests[test]})


@pytest.mark.parametrize(("name", "null", "test", "command"), LEAKS)
def test_most_false_findings_of_a_test_that_leaks_carry_a_warning(
    name: str, null: str, test: str, command: list[str]
) -> None:
    (rate,) = measure(situation_of(name, null, test), 100, seed=1)
    assert rate.rate > HELD[1]
    assert rate.warned >= 0.5


@pytest.mark.parametrize(("name", "null", "test", "command"), LEAKS)
def test_the_command_prints_the_warning_that_the_table_counts(
    name: str, null: str, test: str, command: list[str], tmp_path: Path
) -> None:
    situation = situation_of(name, null, test)
    rng = np.random.default_rng(2)
    path = tmp_path / "study.csv"
    for _ in range(200):
        frame = situation.make(rng)
        p, warnings = situation.tests[test](frame, null)
        if p < ALPHA and warnings:
            pd.DataFrame(frame).to_csv(path, index=False)
            break
    done = CliRunner().invoke(app, ["stats", str(path), *command, "-o", str(tmp_path / "out")])
    assert 0 == done.exit_code, done.output
    printed = " ".join(done.output.split())
    assert all(" ".join(warning.split())[:60] in printed for warning in warnings)
