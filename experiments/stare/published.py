"""Numbers that the source of the stare study printed.

Source: A. Jovane, *Modeling of reactive movement and non-verbal behaviors for the creation of
digital agents for virtual reality*, thesis, Université de Rennes, 2023 (NNT 2023URENS005),
chapter 3 (sections 3.2 to 3.3.1 from p. 77, 3.3.2 on p. 87) and appendix A (from p. 152); the
experiment is that of Raimbaud et al. (2022). Thirty participants; each value averages a
participant's 18 trials of a condition. Times and durations are in milliseconds. Values stand as
printed, also where they do not fit each other: `INCONSISTENCIES` lists where.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

import numpy as np

from visavis.study.look_measures import (
    DWELL_MS,
    FIRST_FIXATION_DURATION_MS,
    FIRST_FIXATION_TIME_MS,
    FIXATION_COUNT,
    MAIN_MEASURES,
    SECOND_FIXATION_DURATION_MS,
    SECOND_FIXATION_TIME_MS,
)
from visavis.study.pairs import Printed
from visavis.study.parts import MeanSd

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


MEANS: Final[Mapping[str, Mapping[str, MeanSd]]] = {
    "A": {
        DWELL_MS: MeanSd(504, 175),
        FIXATION_COUNT: MeanSd(1.15, 0.29),
        FIRST_FIXATION_DURATION_MS: MeanSd(332, 77),
        FIRST_FIXATION_TIME_MS: MeanSd(5173, 1213),
        SECOND_FIXATION_DURATION_MS: MeanSd(407, 282),
        SECOND_FIXATION_TIME_MS: MeanSd(8602, 1395),
    },
    "D": {
        DWELL_MS: MeanSd(1570, 864),
        FIXATION_COUNT: MeanSd(2.35, 1.03),
        FIRST_FIXATION_DURATION_MS: MeanSd(552, 185),
        FIRST_FIXATION_TIME_MS: MeanSd(4969, 1402),
        SECOND_FIXATION_DURATION_MS: MeanSd(554, 214),
        SECOND_FIXATION_TIME_MS: MeanSd(6861, 1785),
    },
    "AD": {
        DWELL_MS: MeanSd(1503, 789),
        FIXATION_COUNT: MeanSd(2.18, 0.79),
        FIRST_FIXATION_DURATION_MS: MeanSd(544, 176),
        FIRST_FIXATION_TIME_MS: MeanSd(5371, 1229),
        SECOND_FIXATION_DURATION_MS: MeanSd(644, 226),
        SECOND_FIXATION_TIME_MS: MeanSd(6978, 1544),
    },
    "DA": {
        DWELL_MS: MeanSd(808, 363),
        FIXATION_COUNT: MeanSd(1.56, 0.56),
        FIRST_FIXATION_DURATION_MS: MeanSd(483, 165),
        FIRST_FIXATION_TIME_MS: MeanSd(4847, 1307),
        SECOND_FIXATION_DURATION_MS: MeanSd(374, 95),
        SECOND_FIXATION_TIME_MS: MeanSd(7773, 1724),
    },
}
"""Mean and SD by condition and measure (tables 3.1, 3.2, A.1, A.2, A.3)."""


CELLS: Final = {m: {c: of[m] for c, of in MEANS.items()} for m in MAIN_MEASURES}
"""The same by measure and condition."""


_WILCOXON: Final = None
_BOUND_SIGN: Final = "<"

_Row: TypeAlias = tuple[str, float, int, tuple[float, float] | None]

# (printed sign, p, stars, (t, eta) or None for a Wilcoxon test), measures in table order.
_TABLES: Final[Mapping[tuple[str, str, str], tuple[_Row, ...]]] = {
    ("A", "D", "3.1"): (
        (_BOUND_SIGN, 0.00001, 3, (-6.75, 0.61)),
        (_BOUND_SIGN, 0.00001, 3, (-6.45, 0.59)),
        (_BOUND_SIGN, 0.00001, 3, (-5.61, 0.52)),
        ("", 0.53119, 0, (0.63, 0.014)),
        ("", 0.00158, 1, _WILCOXON),
        ("", 0.00031, 2, (4.09, 0.37)),
    ),
    ("A", "AD", "A.2"): (
        (_BOUND_SIGN, 0.00001, 3, _WILCOXON),
        (_BOUND_SIGN, 0.00001, 3, (-7.24, 0.64)),
        (_BOUND_SIGN, 0.00001, 3, (-6.22, 0.57)),
        ("", 0.87121, 0, _WILCOXON),
        ("", 0.00011, 2, _WILCOXON),
        ("", 0.00032, 2, (4.08, 0.36)),
    ),
    ("D", "AD", "A.3"): (
        ("", 0.45729, 0, (0.75, 0.02)),
        ("", 0.15961, 0, (1.44, 0.07)),
        ("", 0.85695, 0, (0.18, 0.00)),
        ("", 0.16703, 0, (-1.41, 0.06)),
        ("", 0.13021, 0, (-1.56, 0.08)),
        ("", 0.75169, 0, (0.32, 0.00)),
    ),
    ("A", "DA", "3.2"): (
        ("", 0.00005, 2, (-4.78, 0.44)),
        ("", 0.00015, 2, (-4.37, 0.40)),
        ("", 0.00003, 3, (-4.92, 0.45)),
        ("", 0.32902, 0, (0.99, 0.03)),
        ("", 0.34921, 0, _WILCOXON),
        ("", 0.05175, 0, (2.03, 0.12)),
    ),
    ("D", "DA", "A.1"): (
        (_BOUND_SIGN, 0.00001, 3, (6.83, 0.62)),
        (_BOUND_SIGN, 0.00001, 3, (6.17, 0.57)),
        ("", 0.07638, 0, (1.84, 0.10)),
        ("", 0.69058, 0, (0.40, 0.01)),
        ("", 0.00016, 2, (4.32, 0.39)),
        ("", 0.05246, 0, (-2.03, 0.12)),
    ),
}


TESTS: Final[Mapping[tuple[str, str, str], Printed]] = {
    (first, second, measure): Printed(
        stars > 0,
        p,
        stars,
        int(np.sign(MEANS[second][measure].mean - MEANS[first][measure].mean)),
        statistic=None if t_and_eta is None else t_and_eta[0],
        eta_p2=None if t_and_eta is None else t_and_eta[1],
        is_wilcoxon=t_and_eta is None,
        where=f"table {table}",
        p_is_bound=sign == _BOUND_SIGN,
    )
    for (first, second, table), rows in _TABLES.items()
    for measure, (sign, p, stars, t_and_eta) in zip(MAIN_MEASURES, rows, strict=True)
}
"""The 30 tests of tables 3.1, 3.2, A.1, A.2 and A.3, by both conditions and measure."""


def _alone(where: str, p: float, stars: int, *, p_is_bound: bool = False) -> Printed:
    return Printed(stars > 0, p, stars, where=where, p_is_bound=p_is_bound)


_place, _zone = partial(_alone, "table A.4"), partial(_alone, "table A.5")

THRESHOLDS: Final = (0.00166, 0.00033, 0.00003)
"""One, two and three stars in tables 3.1, 3.2, A.1 to A.3, as printed (cut off, not rounded, from
0.05, 0.01 and 0.001 over 30)."""

POSITION_THRESHOLDS: Final = (0.00555, 0.00111, 0.000111)
"""Stars of table A.4: the same levels over nine places, cut off."""

ZONE_THRESHOLDS: Final = (0.0160, 0.0033, 0.0003)
"""Stars of table A.5: the same levels over three zones, cut off."""

POSITION_TESTS: Final[Mapping[str, Mapping[str, Printed]]] = {
    "left_close": {DWELL_MS: _place(0.00203, 1), FIXATION_COUNT: _place(0.00078, 2)},
    "left_middle": {DWELL_MS: _place(0.71318, 0), FIXATION_COUNT: _place(0.43556, 0)},
    "left_far": {DWELL_MS: _place(0.00902, 0), FIXATION_COUNT: _place(0.05810, 0)},
    "centre_close": {
        DWELL_MS: _place(0.00001, 3, p_is_bound=True),
        FIXATION_COUNT: _place(0.00001, 3, p_is_bound=True),
    },
    "centre_middle": {
        DWELL_MS: _place(0.00001, 3, p_is_bound=True),
        FIXATION_COUNT: _place(0.00001, 3, p_is_bound=True),
    },
    "centre_far": {DWELL_MS: _place(0.00137, 1), FIXATION_COUNT: _place(0.00399, 1)},
    "right_close": {
        DWELL_MS: _place(0.00001, 3),
        FIXATION_COUNT: _place(0.00001, 3, p_is_bound=True),
    },
    "right_middle": {DWELL_MS: _place(0.00006, 3), FIXATION_COUNT: _place(0.00074, 2)},
    "right_far": {DWELL_MS: _place(0.00008, 3), FIXATION_COUNT: _place(0.00021, 2)},
}
"""A against D at each place (table A.4); t or Wilcoxon, which of them is not printed."""

ZONE_TESTS: Final[Mapping[str, Mapping[Comparison, Printed]]] = {
    "left": {
        ("A", "D"): _zone(0.0745, 0),
        ("A", "DA"): _zone(0.0792, 0),
        ("D", "DA"): _zone(0.8816, 0),
        ("A", "AD"): _zone(0.0293, 0),
        ("D", "AD"): _zone(0.4587, 0),
    },
    "centre": {
        ("A", "D"): _zone(0.0027, 2),
        ("A", "DA"): _zone(0.0027, 2),
        ("D", "DA"): _zone(0.8340, 0),
        ("A", "AD"): _zone(0.3765, 0),
        ("D", "AD"): _zone(0.012, 1),
    },
    "right": {
        ("A", "D"): _zone(0.9018, 0),
        ("A", "DA"): _zone(0.2103, 0),
        ("D", "DA"): _zone(0.2421, 0),
        ("A", "AD"): _zone(0.7535, 0),
        ("D", "AD"): _zone(0.6181, 0),
    },
    "all": {
        ("A", "D"): _zone(0.5312, 0),
        ("A", "DA"): _zone(0.3290, 0),
        ("D", "DA"): _zone(0.6906, 0),
        ("A", "AD"): _zone(0.8712, 0),
        ("D", "AD"): _zone(0.1670, 0),
    },
}
"""First fixation time by zone of the active agent (table A.5); "all" repeats the main tables."""

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
