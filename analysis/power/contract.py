"""The protocol of a study whose power can be simulated."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, Protocol, TypeAlias

import pandas as pd
from scipy import special

Source: TypeAlias = Literal["studies", "simulated pool", "study folder"]
"""Where a replicate's participants come from: simulated anew, or drawn from people at hand."""


@dataclass(frozen=True)
class PlannedTestResult:
    """Result of one planned test in one simulated study.

    `is_significant` is None when the test could not be made; it then counts as not found.
    `difference` is in the units of the measure, `standardised` in standard deviations of the
    differences (or the correlation itself); both NaN where the test has no such number.
    """

    is_significant: bool | None
    difference: float = float("nan")
    standardised: float = float("nan")


ANYTHING: Final = "anything"
"""Name of the test that asks of a whole study whether any of its headlines finds something: without
an effect, how often it would report what is not there."""
PRIMARY: Final = "primary"
"""The same of the primary claims alone, for which a study holds its error rate."""
Verdicts: TypeAlias = Mapping[str, PlannedTestResult]
"""By name of the planned test."""


@dataclass(frozen=True)
class PrintedTest:
    """A test as a source printed it, from which power follows without simulation.

    F (t² of a t test) with its degrees of freedom, on `n` people measured in all conditions;
    `n_tests` is by how many the level of significance is divided here.
    """

    text: str
    F: float
    df1: float
    df2: float
    n: int
    n_tests: int = 1

    def power(self, n: int, alpha: float) -> float:
        """Return the power with n people if the true effect is as printed.

        Noncentrality df1·F·n/n₀ takes the printed effect for the true one.
        """
        df2 = self.df2 * (n - 1) / (self.n - 1)
        critical = float(special.fdtri(self.df1, df2, 1 - alpha / self.n_tests))
        noncentrality = self.df1 * self.F * n / self.n
        return float(1 - special.ncfdtr(self.df1, df2, noncentrality, critical))

    @property
    def dz(self) -> float:
        """The standardised difference of a paired t test; NaN for an F of more than one df."""
        return math.sqrt(self.F / self.n) if self.df1 == 1 else float("nan")

    def of_dz(self, dz: float) -> "PrintedTest":
        """Return the same test as if it had found another standardised difference."""
        return replace(self, F=dz**2 * self.n)


class PowerStudy(Protocol):
    """A study whose power can be simulated; it travels between processes, so it must pickle.

    `effect` is a multiplier everywhere: 1 the published effect, 0 none.
    """

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        ...

    @property
    def tests(self) -> Mapping[str, str]:
        """Every planned test by name, with what it claims in words."""
        ...

    @property
    def printed_tests(self) -> Mapping[str, PrintedTest]:
        """Tests as a source printed them, by name; those it does not print are left out."""
        ...

    @property
    def shown_tests(self) -> Sequence[str]:
        """Tests shown when none is named; the first decides the number of participants."""
        ...

    @property
    def primary_tests(self) -> Sequence[str]:
        """The primary claims among the tests, by name; the others are secondary."""
        ...

    @property
    def smallest_n(self) -> int:
        """Participants below which the planned tests cannot be made."""
        ...

    def rule(self, alpha: float) -> str:
        """Return how a test of this study becomes significant, in words."""
        ...

    def effect_meaning(self, effect: float, source: Source) -> str:
        """Return what the multiplier did to the data, in words."""
        ...

    def prepare(self, on_progress: Callable[[int, int], None]) -> None:
        """Compute and store what every process would otherwise have to compute.

        `on_progress` receives the number of steps done and of all steps.
        """
        ...

    def simulate(
        self,
        numbers: Sequence[int],
        tests: Sequence[str],
        *,
        effect: float,
        seed: int,
        alpha: float,
    ) -> Mapping[int, Verdicts]:
        """Simulate a study of the largest number and test it at every number of participants."""
        ...

    def simulate_people(self, indices: Sequence[int], *, effect: float, seed: int) -> pd.DataFrame:
        """Return what the analysis needs of some simulated people, for a pool to draw from."""
        ...

    def people_of(self, folder: Path, *, effect: float) -> tuple[pd.DataFrame, bool]:
        """Return the same of the people in a study's folder, and whether they are simulated.

        Raises a DataError when the folder holds no trial table of this study.
        """
        ...

    def resample(
        self,
        people: pd.DataFrame,
        numbers: Sequence[int],
        tests: Sequence[str],
        *,
        seed: int,
        alpha: float,
    ) -> Mapping[int, Verdicts]:
        """Draw the largest number of people with replacement and test at every number."""
        ...
