"""QUEST+: the level of a trial is the one whose answer says most about a psychometric function.

Watson (2017), QUEST+: A general multidimensional Bayesian adaptive psychometric method, J. Vis.
17(3):10, doi:10.1167/17.3.10. As of a staircase, the state is the rows of finished trials.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.psychometric import INTERVAL_01, PsychometricFunction, share_right
from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.steps import Scalar
from visavis.study.staircase import require_verdict

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
@of_kinds(slopes=float | Sequence[float], lapses=float | Sequence[float])
class QuestPlus:
    """A rule by which the next of `levels` is the one after whose answer the least is unknown of
    the threshold, the slope and the lapses, each on its own grid and as likely at first.

    `function` is "weibull", right in guess + (1 - guess - lapse) (1 - exp(-(level / threshold) **
    slope)), so that at the threshold 63 % of the way is gone; or "normal", with the distribution
    function of a normal variable whose mean is the threshold and whose standard deviation is the
    slope, so that it is half. `guess` is the share of right answers by guessing.

    Raises:
        DesignError: a number is not possible, or a grid has no room.
    """

    name: str
    levels: Sequence[float]
    thresholds: Sequence[float]
    slopes: Sequence[float] = (3.5,)
    lapses: Sequence[float] = (0.02,)
    guess: float = 0.5
    function: PsychometricFunction = "weibull"

    def __post_init__(self) -> None:
        for name in ("levels", "thresholds", "slopes", "lapses"):  # hashable, whatever was given
            values = tuple(map(float, np.atleast_1d(getattr(self, name))))
            object.__setattr__(self, name, values)
            if not values or list(values) != sorted(set(values)) or not np.isfinite(values).all():
                raise DesignError(
                    f"QUEST+ {self.name}: {name} rise from the smallest to the largest, each once"
                )
        if not self.name.isidentifier():
            raise DesignError(f"QUEST+ is called {self.name!r}; give letters, digits and _")
        if len(self.levels) < 2 or len(self.thresholds) < 2:
            raise DesignError(f"QUEST+ {self.name}: give two or more levels and thresholds")
        if self.slopes[0] <= 0 or (
            self.function == "weibull" and min(self.levels[0], self.thresholds[0]) <= 0
        ):
            raise DesignError(
                f"QUEST+ {self.name}: slopes are above 0, and of weibull levels and thresholds, too"
            )
        if self.guess < 0 or self.lapses[0] < 0 or self.guess + self.lapses[-1] >= 1:
            raise DesignError(
                f"QUEST+ {self.name}: guess and lapses are 0 or more and below 1 together"
            )

    @cached_property
    def right(self) -> Floats:
        """The share of right answers, (levels, thresholds, slopes, lapses)."""
        level, threshold, slope, lapse = np.meshgrid(
            self.levels, self.thresholds, self.slopes, self.lapses, indexing="ij", sparse=True
        )
        return share_right(level, threshold, slope, self.guess, lapse, self.function)

    @property
    def first(self) -> "Posterior":
        """What is known before the first answer."""
        shape = (len(self.thresholds), len(self.slopes), len(self.lapses))
        return Posterior(self, np.full(shape, 1.0 / np.prod(shape)))


@dataclass(frozen=True, eq=False)
class Posterior:
    """How likely every threshold, slope and lapse is after some answers."""

    rule: QuestPlus
    probability: Floats = field(repr=False)
    """(thresholds, slopes, lapses), 1 in all."""

    def after(self, level: float, is_right: bool) -> "Posterior":
        """Return what is known after an answer at one of the levels."""
        right = self.rule.right[_place(self.rule.levels, level)]
        probability = self.probability * (right if is_right else 1.0 - right)
        return Posterior(self.rule, probability / probability.sum())

    @cached_property
    def entropies(self) -> Floats:
        """Expected entropy after an answer at every level, in nats."""
        right = self.rule.right
        total = np.zeros(len(self.rule.levels))
        for likelihood in (right, 1.0 - right):
            joint = self.probability * likelihood
            share = joint.sum(axis=(1, 2, 3))
            with np.errstate(divide="ignore", invalid="ignore"):
                after = joint / share[:, None, None, None]
                entropy = -np.nansum(after * np.log(after), axis=(1, 2, 3))
            total += share * entropy
        return total

    @property
    def next_level(self) -> float:
        """The level whose answer leaves the least unknown; of equal ones the lowest."""
        return self.rule.levels[int(np.argmin(self.entropies))]

    def mean(self, axis: int) -> float:
        """Return the mean of thresholds (0), slopes (1) or lapses (2)."""
        grid = (self.rule.thresholds, self.rule.slopes, self.rule.lapses)[axis]
        return float(self._marginal(axis) @ np.array(grid))

    def interval(self, axis: int) -> tuple[float, float]:
        """Return between which grid values 95 % of the probability lies, as much on both sides."""
        grid = (self.rule.thresholds, self.rule.slopes, self.rule.lapses)[axis]
        below = np.cumsum(self._marginal(axis))
        tail = (1.0 - INTERVAL_01) / 2
        low, high = np.searchsorted(below, (tail, 1.0 - tail))
        return grid[int(low)], grid[min(int(high), len(grid) - 1)]

    def _marginal(self, axis: int) -> Floats:
        others = tuple(other for other in range(3) if other != axis)
        return np.asarray(self.probability.sum(axis=others), np.float64)


def _place(levels: Sequence[float], level: float) -> int:
    return int(np.argmin(np.abs(np.array(levels) - level)))


def posterior_after(rule: QuestPlus, answers: Iterable[tuple[float, bool]]) -> Posterior:
    """Return what is known after all answers, each a level and whether it was right."""
    posterior = rule.first
    for level, is_right in answers:
        posterior = posterior.after(level, is_right)
    return posterior


class QuestPlusTrial:
    """QUEST+ in one trial: `level` is what to show, `take` hears whether the answer is right.

    It writes the columns of `columns_of_quest`; estimates are those after the trial's answer.
    """

    def __init__(
        self,
        rule: QuestPlus,
        of: str,
        rows: Sequence[Mapping[str, Any]],
        row: dict[str, Scalar | None],
    ) -> None:
        self._rule, self._row = rule, row
        name = rule.name
        answers = [
            (float(r[f"{name}_level"]), bool(r[f"{name}_is_right"]))
            for r in rows
            if r.get(f"{name}_of") == of and r.get(f"{name}_is_right") in (True, False)
        ]
        self._posterior = posterior_after(rule, answers)
        self.level = self._posterior.next_level
        row |= dict.fromkeys((c.name for c in columns_of_quest(rule)), None)
        row |= {f"{name}_of": of, f"{name}_level": self.level}

    def take(self, is_right: bool | None) -> None:
        """Hear whether the answer is right; None, for no answer, teaches nothing.

        Raises:
            DesignError: it is told something else.
        """
        require_verdict(self._rule.name, is_right)
        if is_right is None:
            return
        name = self._rule.name
        coming = self._posterior.after(self.level, bool(is_right))
        self._row[f"{name}_is_right"] = bool(is_right)
        for axis, what in enumerate(("threshold", "slope")):
            self._row[f"{name}_{what}"] = coming.mean(axis)
            self._row[f"{name}_{what}_low"], self._row[f"{name}_{what}_high"] = coming.interval(
                axis
            )


def columns_of_quest(rule: QuestPlus) -> tuple[Column, ...]:
    """Return the columns that QUEST+ adds to a trial's row."""
    name, words = rule.name, rule.name.replace("_", " ")
    estimates = (
        Column(f"{name}_{what}{end}", "", f"{what} of {words} after this answer, {meaning}")
        for what in ("threshold", "slope")
        for end, meaning in (
            ("", "mean of the posterior"),
            ("_low", "lower end of its 95 % interval"),
            ("_high", "upper end of its 95 % interval"),
        )
    )
    return (
        Column(f"{name}_of", "", f"which of several procedures of {words}"),
        Column(f"{name}_level", "", f"level of {words} in this trial"),
        Column(f"{name}_is_right", "", "whether the procedure heard of a right answer"),
        *estimates,
    )
