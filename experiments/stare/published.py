"""Numbers that the source of the stare study printed.

Source: A. Jovane, *Modeling of reactive movement and non-verbal behaviors for the creation of
digital agents for virtual reality*, thesis, Université de Rennes, 2023 (NNT 2023URENS005),
chapter 3 (sections 3.2 to 3.3.1 from p. 77, 3.3.2 on p. 87) and appendix A (from p. 152); the
experiment is that of Raimbaud et al. (2022). Thirty participants; each value averages a
participant's 18 trials of a condition. Times and durations are in milliseconds. The tables stand
beside this file as CSV, in which a test without t is a Wilcoxon test; values stand as printed, also
where they do not fit each other: `INCONSISTENCIES` lists where.
"""

import csv
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from visavis.study.look_measures import (
    DWELL_MS,
    FIRST_FIXATION_DURATION_MS,
    FIXATION_COUNT,
    MAIN_MEASURES,
)
from visavis.study.pairs import Printed
from visavis.study.source import MeanSd

CITATION: Final = (
    "Jovane, A. (2023). Modeling of reactive movement and non-verbal behaviors for the creation of "
    "digital agents for virtual reality. Thesis, Université de Rennes. NNT 2023URENS005. "
    "Chapter 3 and appendix A."
)

Comparison: TypeAlias = tuple[str, str]

PARTICIPANTS: Final = 30

COMPARISONS: Final[tuple[Comparison, ...]] = (
    ("A", "D"),
    ("A", "AD"),
    ("D", "AD"),
    ("A", "DA"),
    ("D", "DA"),
)
"""The five comparisons, in the order in which section 3.3.1 lists them."""


@dataclass(frozen=True)
class Inconsistency:
    """Where the printed numbers or words do not fit each other."""

    where: str
    what: str


def _rows(name: str) -> list[dict[str, str]]:
    with Path(__file__).with_name(name).open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def _number(text: str) -> float:
    return float(text) if "." in text else int(text)


MEANS: Final[dict[str, dict[str, MeanSd]]] = {}
"""Mean and SD by condition and measure (tables 3.1, 3.2, A.1, A.2, A.3)."""
for _row in _rows("published_means.csv"):
    _cell = MeanSd(_number(_row["mean"]), _number(_row["sd"]))
    MEANS.setdefault(_row["condition"], {})[_row["measure"]] = _cell

CELLS: Final = {m: {c: of[m] for c, of in MEANS.items()} for m in MAIN_MEASURES}
"""The same by measure and condition."""

TESTS: Final[dict[tuple[str, str, str], Printed]] = {}
"""The 30 tests of tables 3.1, 3.2, A.1, A.2 and A.3, by both conditions and measure."""

THRESHOLDS: Final = (0.00166, 0.00033, 0.00003)
"""One, two and three stars in tables 3.1, 3.2, A.1 to A.3, as printed (cut off, not rounded, from
0.05, 0.01 and 0.001 over 30)."""

POSITION_THRESHOLDS: Final = (0.00555, 0.00111, 0.000111)
"""Stars of table A.4: the same levels over nine places, cut off."""

ZONE_THRESHOLDS: Final = (0.0160, 0.0033, 0.0003)
"""Stars of table A.5: the same levels over three zones, cut off."""

POSITION_TESTS: Final[dict[str, dict[str, Printed]]] = {}
"""A against D at each place (table A.4); t or Wilcoxon, which of them is not printed."""

ZONE_TESTS: Final[dict[str, dict[Comparison, Printed]]] = {}
"""First fixation time by zone of the active agent (table A.5); "all" repeats the main tables."""

for _row in _rows("published_tests.csv"):
    _where, _measure, _pair = _row["table"], _row["measure"], (_row["first"], _row["second"])
    _test = Printed(
        _row["stars"] != "0",
        float(_row["p"]),
        int(_row["stars"]),
        where=f"table {_where}",
        p_is_bound=_row["sign"] == "<",
    )
    if _where == "A.4":
        POSITION_TESTS.setdefault(_row["seats"], {})[_measure] = _test
    elif _where == "A.5":
        ZONE_TESTS.setdefault(_row["seats"], {})[_pair] = _test
    else:
        TESTS[*_pair, _measure] = replace(
            _test,
            direction=int(np.sign(MEANS[_pair[1]][_measure].mean - MEANS[_pair[0]][_measure].mean)),
            statistic=float(_row["t"]) if _row["t"] else None,
            eta_p2=float(_row["eta_p2"]) if _row["eta_p2"] else None,
            is_wilcoxon=not _row["t"],
        )

CORRELATIONS: Final = {
    (condition, measure): Printed(True, p, direction=-1, r=r_s, where="section 3.3.2")
    for condition, measure, r_s, p in (
        ("D", DWELL_MS, -0.42, 0.022),
        ("AD", DWELL_MS, -0.57, 0.001),
        ("DA", DWELL_MS, -0.37, 0.047),
        ("A", FIRST_FIXATION_DURATION_MS, -0.40, 0.028),
        ("AD", FIXATION_COUNT, -0.49, 0.006),
    )
}
"""Every correlation of the anxiety score (0 to 144) that section 3.3.2 prints, by condition and
measure; it says that no other was significant."""

INCONSISTENCIES: Final = (
    Inconsistency(
        "table A.1, second fixation time",
        "p = 0.05246 does not follow from t = -2.03 with 29 degrees of freedom",
    ),
    Inconsistency(
        "table A.3, first fixation time",
        "p = 0.16703 does not follow from t = -1.41 with 29 degrees of freedom; it fits -1.42",
    ),
    Inconsistency(
        "thresholds of chapter 3 and appendix A",
        "0.00166, 0.00555 and 0.016 are cut off, not rounded, from 0.05 over 30, 9 and 3",
    ),
    Inconsistency(
        "table 3.2, first fixation duration",
        "p = 0.00003 carries three stars, which the text gives below that; 0.001 over 30 is meant",
    ),
    Inconsistency(
        "section 3.3.1",
        "announces A against AD as the dynamic case in detail; figure 3.5 and table 3.2 that "
        "follow are A against DA",
    ),
)
"""Two p values of 25 do not follow from their t; all effect sizes and all stars fit."""
