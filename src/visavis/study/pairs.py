"""Families of simple tests that a study plans, with the published results."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from visavis.analysis.statistics.results import p_text
from visavis.lab.kinds import of_kinds

SharedAlpha = Literal["measures", "levels", "each"]


@dataclass(frozen=True)
@of_kinds()
class Printed:
    """The published result of one test.

    `direction` is the sign of second minus first (of the coefficient in a correlation), 0 where
    none is printed; `statistic` is the t of two levels, the F, t or z of a comparison, with its
    `df`; `p_is_bound` where p is printed as "<"; `is_wilcoxon` where a test without a statistic
    was named. `order` says which levels an effect found greater ("warping > orientation"), where
    the source prints it. `where` says in which table, `text` is the whole of it ("F(1, 15) = 7.09,
    p = .017"), `misfits` name printed numbers that contradict each other.
    """

    is_significant: bool
    p: float | None = None
    stars: int = 0
    direction: int = 0
    statistic: float | None = None
    eta_p2: float | None = None
    r: float | None = None
    is_wilcoxon: bool = False
    where: str = ""
    text: str = ""
    df: tuple[float, float] | None = None
    misfits: tuple[str, ...] = ()
    p_is_bound: bool = False
    order: str = ""

    def __str__(self) -> str:
        """Return its whole text, else its p with the verdict."""
        verdict = "different" if self.is_significant else "not different"
        return self.text or (verdict if self.p is None else f"{verdict}, {p_text(self.p)}")


# A test holds the family that it was made for, so its class stands above: the tests of
# visavis.results.family_tests, which study files name in their own functions.
PrintedOf: TypeAlias = Callable[[Any], Printed | None]
"""Returns the published result of a `PairTest` or a `CorrelationTest`; None without one."""


@dataclass(frozen=True)
@of_kinds()
class Pairs:
    """A family of paired tests: every measure between every pair of levels of one factor.

    With `each`, a factor or a derived column, they are made at every level of it. `shared` says
    which tests share alpha: with ("measures", "levels") all of them, with ("each",) those that
    differ only in the level of `each`. `names` are the words for levels, `noun` follows them in
    sentences ("averted and directed gaze"). `printed` returns the published result of a test. An
    `exploratory` family makes no headline and has no power.
    """

    family: str
    measures: Sequence[str]
    factor: str
    levels: Sequence[tuple[str, str]]
    each: str = ""
    shared: Sequence[SharedAlpha] = ("measures", "levels")
    words: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    noun: str = ""
    printed: PrintedOf | None = None
    exploratory: bool = False

    def level_words(self, level: str) -> str:
        """Return the words for a level."""
        return self.names.get(level, level.replace("_", " "))


@dataclass(frozen=True)
@of_kinds()
class Correlate:
    """A family of rank correlations: every measure at every level of a factor with one score.

    `score` is a column of the table of participants, called `score_words` in sentences and
    `score_name` in messages. Alpha is not shared; p adjusted by Holm stands beside it.
    """

    family: str
    measures: Sequence[str]
    factor: str
    score: str
    score_words: str
    score_name: str
    words: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    noun: str = ""
    printed: PrintedOf | None = None
    exploratory: bool = False


Family = Pairs | Correlate
