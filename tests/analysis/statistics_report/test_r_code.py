"""R code that repeats a test: run where Rscript and its packages are, read everywhere."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest

from visavis.analysis.statistics.gee import gee
from visavis.analysis.statistics_report import TESTS, Outcome, Question, answer
from visavis.analysis.statistics_report.outcome_files import write_outcome
from visavis.analysis.statistics_report.r_code import r_code

ONE = {"within": ("b",), "subject": "who"}
TWO = {"within": ("a", "b"), "subject": "who"}
PAIR = {"within": ("a",), "subject": "who"}
GROUPS = {"between": ("g",), "subject": "who"}
VOTES = {"dv": "vote", "within": ("one", "other"), "subject": "who"}
RATED = {"dv": "rating", "within": ("who",), "subject": "clip"}
RATED_BY_TWO = {"dv": "hit", "within": ("two",), "subject": "thing"}
QUESTIONS: dict[str, dict[str, Any]] = {
    "art": {"test": "art", **TWO, "between": ("g",)},
    "int": {"test": "art", "transform": "int", **TWO},
    "rm": {"test": "rm", **TWO, "between": ("g",)},
    "gg": {"test": "rm", "correction": "gg", **ONE},
    "mixed": {"test": "mixed", **TWO},
    "lmm": {"test": "lmm", **TWO, "random": "components"},
    "gee": {"test": "gee", **ONE},
    "clmm": {"test": "clmm", **ONE, "dv": "rating"},
    "art of conditions": {"test": "art", **TWO},
    "art of groups": {"test": "art", "between": ("g", "sex"), "subject": "who"},
    "rm beside two": {"test": "rm", **TWO, "between": ("g", "sex")},
    "anova of two": {"test": "anova", "between": ("g", "sex"), "subject": "who"},
    "clmm with slopes": {"test": "clmm", **PAIR, "dv": "rating", "random": "a"},
    "clmm, maximal": {"test": "clmm", **PAIR, "dv": "rating", "random": "maximal"},
    "ancova": {"test": "rm", **TWO, "between": ("g",), "covariates": ("age",)},
    "ancova of groups": {
        "test": "anova",
        "between": ("g", "sex"),
        "subject": "who",
        "covariates": ("age", "height"),
    },
    "rm, simple": {"test": "rm", **TWO, "simple": "b"},
    "art, simple": {"test": "art", **TWO, "simple": "b"},
    "anova, simple": {"test": "anova", "between": ("g", "sex"), "subject": "who", "simple": "g"},
    "bradleyterry": {"test": "bradleyterry", **VOTES, "side": True},
    "bradleyterry of groups": {"test": "bradleyterry", **VOTES, "between": ("g",)},
    "bradleyterry of people": {"test": "bradleyterry", **VOTES, "dv": "won", "random": "maximal"},
    "sign": {"test": "sign", **PAIR},
    "sign of one": {"test": "sign", "subject": "who", "mu": 1.0},
    "binomial": {"test": "binomial", "dv": "hit", "mu": 0.4},
    "icc": {"test": "icc", **RATED},
    "kappa": {"test": "kappa", **RATED_BY_TWO},
    "weighted kappa": {"test": "kappa", **RATED_BY_TWO, "dv": "rating", "scale": "interval"},
    "krippendorff": {"test": "krippendorff", **RATED, "scale": "ordinal"},
    "anova": {"test": "anova", **GROUPS},
    "welch": {"test": "welch", **GROUPS},
    "kruskal": {"test": "kruskal", **GROUPS},
    "friedman": {"test": "friedman", **ONE},
    "conditions": {"test": "conditions", **ONE},
    "paired": {"test": "paired", **ONE},
    "paired ranks": {"test": "paired", **PAIR, "dv": "skewed"},
    "t": {"test": "t", **PAIR},
    "t of groups": {"test": "t", **GROUPS},
    "t of one": {"test": "t", "subject": "who", "mu": 1.0},
    "wilcoxon": {"test": "wilcoxon", **PAIR},
    "mannwhitney": {"test": "mannwhitney", **GROUPS},
    "shapiro": {"test": "shapiro", **PAIR},
    "spearman": {"test": "spearman", "partner": "skewed", "subject": "who"},
    "pearson": {"test": "pearson", "partner": "skewed", "subject": "who"},
    "tost": {"test": "tost", **PAIR, "low": -0.5, "high": 0.5},
    "tost in SD": {"test": "tost", **GROUPS, "low": -0.5, "high": 0.5, "unit": "sd"},
    "cronbach": {"test": "cronbach", "items": ("y", "skewed"), "reverse": ("skewed",)},
}


@cache
def people() -> pd.DataFrame:
    rng = np.random.default_rng(7)
    rows = [
        (f"P{p}", a, b, "old" if p % 5 < 2 else "young")
        for p in range(14)
        for a in ("near 'x'", 'far "y"')
        for b in ("low", "mid", "high")
    ]
    frame = pd.DataFrame(rows, columns=["who", "a", "b", "g"])
    own = pd.Series(rng.normal(0, 2, size=14), [f"P{p}" for p in range(14)])
    slopes = {key: rng.normal(0, 0.8) for key in zip(frame["who"], frame["b"], strict=True)}
    slopes |= {key: rng.normal(0, 0.8) for key in zip(frame["who"], frame["a"], strict=True)}
    y = own[frame["who"]].to_numpy() + 0.9 * (frame["b"] == "high") + rng.normal(size=len(frame))
    for factor in ("a", "b"):
        y += [slopes[key] for key in zip(frame["who"], frame[factor], strict=True)]
    frame["y"] = np.round(y, 3)
    frame["sex"] = np.where(frame["who"].str[1:].astype(int) % 2, "f", "m")
    frame["age"] = [20 + 7 * int(w[1:]) % 31 for w in frame["who"]]
    frame["height"] = [1.5 + 0.05 * (int(w[1:]) % 9) for w in frame["who"]]
    frame["skewed"] = np.round(np.exp(2 * frame["y"]), 3)
    pairs = [("p", "q"), ("q", "r"), ("r", "p"), ("q", "p"), ("r", "q"), ("p", "r")]
    frame["one"], frame["other"] = zip(*(pairs[i % 6] for i in range(len(frame))), strict=True)
    frame["vote"] = rng.choice([-1, -1, 0, 1, 1], size=len(frame))
    liked = {(w, i): rng.normal(0, 1.5) for w in own.index for i in "pqr"}
    leads = [
        liked[w, a] - liked[w, b] + rng.logistic()
        for w, a, b in zip(frame["who"], frame["one"], frame["other"], strict=True)
    ]
    frame["hit"] = rng.integers(0, 2, size=len(frame))
    frame["clip"] = frame["a"] + frame["b"]
    frame["two"] = np.where(np.arange(len(frame)) % 2, "one", "two")
    frame["thing"] = [f"T{i // 2}" for i in range(len(frame))]
    frame["rating"] = np.clip(np.round(3 + frame["y"]), 1, 5)
    frame["won"] = np.where(np.array(leads) > 0, 1, -1)
    return frame


def outcome_of(name: str) -> Outcome:
    question = {"dv": "y", "levels": {}, "always_posthoc": True} | QUESTIONS[name]
    if "b" in question.get("within", ()):
        question["levels"] = {"b": ["low", "mid", "high"]}
    return answer(people(), Question(**question))


@pytest.mark.parametrize("name", QUESTIONS)
def test_code_reads_the_rows_beside_it_and_names_what_it_needs(name: str) -> None:
    outcome = outcome_of(name)
    code = r_code(outcome)
    assert 'read.csv("tested.csv"' in code
    for package in set(re.findall(r"(\w+)::", code)):
        assert package in code.split("\n")[1]
    for pair in ("()", "{}", "[]"):
        assert code.count(pair[0]) == code.count(pair[1])
    assert outcome.data is not None


def test_every_test_can_be_repeated() -> None:
    assert set(TESTS) == {q["test"] for q in QUESTIONS.values()}


RUN_ALL = """for (name in list.dirs(recursive = FALSE)) {
  cat("==", name, "\\n", sep = "\\t")
  tryCatch(source(file.path(name, "repeat.R"), local = new.env(), chdir = TRUE),
    error = function(e) cat("error", conditionMessage(e), "\\n", sep = "\\t"))
}
"""
Printed = dict[str, tuple[float, float]]


@pytest.fixture(scope="module")
def repeated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Printed | str]:
    """Run all code in one R; values and p by name, or the message of an error."""
    rscript = shutil.which("Rscript")
    if rscript is None:
        pytest.skip("Rscript is not installed")
    folder = tmp_path_factory.mktemp("r")
    for name in QUESTIONS:
        write_outcome(replace(outcome_of(name), samples=()), folder / name)
    (folder / "all.R").write_text(RUN_ALL, encoding="utf-8")
    done = subprocess.run(
        [rscript, "--vanilla", "all.R"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        timeout=90,
    )
    numbers: dict[str, Printed | str] = {}
    for part in re.split(r"^==\t\./", done.stdout, flags=re.MULTILINE)[1:]:
        name, *lines = part.splitlines()
        cells = [line.split("\t") for line in lines if "\t" in line]
        broken = [cell[1] for cell in cells if cell[0] == "error"]
        numbers[name.strip()] = (
            broken[0]
            if broken
            else {c[0]: (float(c[1]), float("nan") if c[2] == "NA" else float(c[2])) for c in cells}
        )
    return numbers


def read(repeated: dict[str, Printed | str], name: str) -> Printed:
    """Return what R printed; skip where a package is missing."""
    numbers = repeated[name]
    if isinstance(numbers, str):
        if "there is no package called" in numbers:
            pytest.skip(numbers)
        pytest.fail(numbers)
    return numbers


def expected(outcome: Outcome) -> Iterator[tuple[float, float]]:
    """Yield value and p of each row as Visavis has them."""
    for row in outcome.rows:
        if outcome.question.test in ("clmm", "bradleyterry"):
            yield float(row["chi2"] or 0), float(row["chi2_p"] or 0)
            continue
        names = ("agreement", "hits", "F", "t", "V", "U", "chi2", "H", "W", "r", "rho", "alpha")
        value = next(row[n] for n in names if row.get(n) is not None)
        p = next((row[n] for n in ("p_used", "p") if row.get(n) is not None), float("nan"))
        yield float(value or 0), float(p or 0)


COMPARED = [n for n, q in QUESTIONS.items() if q["test"] not in ("gee", "tost")]


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPARED)
def test_r_finds_the_same_statistic_and_p(name: str, repeated: dict[str, Printed | str]) -> None:
    beside = ("contrast ", "effect ")
    numbers = {
        k: v
        for k, v in read(repeated, name).items()
        if "Shapiro-Wilk" not in k and not k.startswith(beside)
    }
    want = list(expected(outcome_of(name)))
    assert len(want) == len(numbers), numbers
    for (value, p), (r_value, r_p) in zip(want, numbers.values(), strict=True):
        assert value == pytest.approx(r_value, rel=1e-4)
        assert p == pytest.approx(r_p, rel=1e-3, abs=1e-9, nan_ok=True)


WITH_CONTRASTS = {
    "rm": 47,
    "rm beside two": 78,
    "gg": 3,
    "mixed": 22,
    "lmm": 22,
    "int": 19,
    "art of conditions": 22,
    "art of groups": 9,
    "rm, simple": 13,
    "art, simple": 13,
    "anova, simple": 4,
    "anova": 1,
    "anova of two": 8,
    "welch": 1,
    "kruskal": 1,
    "friedman": 3,
    "conditions": 3,
}
ESTIMATES_ALONE = {"gee": 3, "clmm": 3}


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_CONTRASTS)
def test_r_finds_the_same_contrasts(name: str, repeated: dict[str, Printed | str]) -> None:
    numbers = [v for k, v in read(repeated, name).items() if k.startswith("contrast ")]
    rows = outcome_of(name).contrasts
    assert WITH_CONTRASTS[name] == len(rows) == len(numbers)
    for row, (value, p) in zip(rows, numbers, strict=True):
        ours = next(float(row[n] or 0) for n in ("t", "V", "z") if row.get(n) is not None)
        assert ours == pytest.approx(value, rel=1e-4, abs=1e-6)
        assert float(row["p_adjusted"] or 0) == pytest.approx(p, rel=1e-3, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ESTIMATES_ALONE)
def test_r_estimates_the_same_contrasts(name: str, repeated: dict[str, Printed | str]) -> None:
    numbers = [v for k, v in read(repeated, name).items() if k.startswith("contrast ")]
    rows = outcome_of(name).contrasts
    assert ESTIMATES_ALONE[name] == len(rows) == len(numbers)
    for row, (value, p) in zip(rows, numbers, strict=True):
        assert float(row["estimate"] or 0) == pytest.approx(value, rel=1e-3)
        assert np.isnan(p)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rm", "gg", "anova", "anova of two", "friedman", "kruskal"])
def test_r_finds_the_same_effect_sizes(name: str, repeated: dict[str, Printed | str]) -> None:
    outcome = outcome_of(name)
    numbers = {
        k.removeprefix("effect "): v for k, (v, _) in read(repeated, name).items() if "effect " in k
    }
    want = {str(row.get("term", "f1")): row["effect_size"] for row in outcome.rows}
    want |= {
        f"{row['family']}: {row['contrast']}": row["effect_size"]
        for row in outcome.contrasts
        if name in ("gg", "anova") and "contrast" in row
    }
    assert set(want) == set(numbers)
    for key, value in want.items():
        assert float(value or 0) == pytest.approx(numbers[key], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["t", "t of groups", "wilcoxon", "mannwhitney"])
def test_r_finds_the_same_effect_size_of_two(name: str, repeated: dict[str, Printed | str]) -> None:
    (numbers,) = [v for k, (v, _) in read(repeated, name).items() if k.startswith("effect ")]
    assert float(outcome_of(name).rows[0]["effect_size"] or 0) == pytest.approx(numbers, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tost", "tost in SD"])
def test_equivalence_is_the_larger_of_rs_two_tests(
    name: str, repeated: dict[str, Printed | str]
) -> None:
    larger = max(p for _, p in read(repeated, name).values())
    assert outcome_of(name).p() == pytest.approx(larger, rel=1e-4)


@pytest.mark.slow
def test_r_estimates_the_same_equations(repeated: dict[str, Printed | str]) -> None:
    frame, numbers = people(), read(repeated, "gee")
    model = gee(frame, "y", subject="who", within=("b",), levels={"b": ["low", "mid", "high"]})
    values = [value for name, (value, _) in numbers.items() if not name.startswith("contrast ")]
    assert model.model.beta == pytest.approx(values, rel=1e-4)
