"""The publication that a study repeats: what is printed there, and what the study does.

A `Source` holds the printed values that reports show beside one's own, the facts about design,
procedure, measures and tests that `visavis fidelity` puts beside the study, and the orders that the
source states in words.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.steps import Scalar
from visavis.study.conditions import condition_of
from visavis.study.expectations import orders_of

FactKind: TypeAlias = Literal["design", "procedure", "measure", "test", "result"]


class MeanSd(NamedTuple):
    """A printed mean with its standard deviation over participants."""

    mean: float
    sd: float


@dataclass(frozen=True)
@of_kinds()
class Fact:
    """One thing that a source says about its study, and what this study does.

    `printed` is what the source prints (a number, or in words), `where` its table, section or page.
    What the study does is `of`, the name of a value of its design ("trials", "blocks", a parameter,
    a factor, a question: see `visavis.results.fidelity`), or `here`, a number or words with
    values of the design in braces. Left out both, it does the same; a printed result is then shown
    beside the study's own and not compared. Numbers and words that are not the printed ones are a
    difference, which needs `because`. `is_stronger` marks a difference that makes the study
    stricter or more exact than its source.

    Raises:
        DesignError: the kind is none, or it names `of` and `here` both, or is stronger without a
            reason, or gives a reason and does not say what the study does.
    """

    kind: FactKind
    what: str
    printed: Scalar
    where: str
    here: Scalar = ""
    of: str = ""
    because: str = ""
    is_stronger: bool = False

    def __post_init__(self) -> None:
        about = f"the fact {self.what!r} of the source"
        if self.of and self.here != "":
            raise DesignError(f"{about} says of= and here=; give one of them")
        if self.is_stronger and not self.because:
            raise DesignError(f"{about} is stronger here; say why: because=")
        if self.because and not self.of and self.here == "":
            raise DesignError(
                f"{about} gives a reason and no difference; say what this study does: here= or of="
            )


@dataclass(frozen=True)
@of_kinds()
class PrintedOrder:
    """An order that a source states, in words or by significant differences.

    `order` is written as in `Compare.expects`: "self, left > right" says that the measure is
    greater with both first levels than with the third. Its sides are levels of `factor`, of which
    participants' means are compared, or numbers ("run > 0.5"), or the name of the measure for the
    mean over all. With `answers`, values of the measure by name, shares of answers are compared:
    its sides are answers where there is no factor ("equal > clip"); with a factor the share of all
    of `answers` together is compared between levels. With `gain`, a factor and two of its levels,
    the sides are compared by the measure at the first of these minus that at the second. `only` are
    levels of other factors or groups of people that trials must have, `conditions` are further ones
    as in `Compare.where` ("age >= 30"). `where` is a table, figure or page. `words` say it in a
    table; left out, the measure and the order do. `not_reproduced` says why simulated people do not
    show it; without a reason at least nine of ten simulated studies must. `levels` are those of
    the factor, which are never read as numbers; the study's design gives them.

    Raises:
        DesignError: the order is none, or is of more than one factor.
    """

    order: str
    measure: str
    where: str
    factor: str = ""
    answers: Mapping[str, Scalar] = field(default_factory=dict)
    gain: tuple[str, Scalar, Scalar] | None = None
    only: Mapping[str, Scalar] = field(default_factory=dict)
    words: str = ""
    not_reproduced: str = ""
    conditions: Sequence[str] = ()
    levels: Sequence[Scalar] = ()

    def __post_init__(self) -> None:
        orders = orders_of(self.order, f"the source's order of {self.measure}")
        if len(orders) != 1 or orders[0].factor:
            raise DesignError(
                f"the source's order of {self.measure} is {self.order!r}; give levels of one "
                'factor ("a > b, c") and name it with factor='
            )
        for text in self.conditions:
            condition_of(text, f"the source's order of {self.measure}, conditions")

    @property
    def name(self) -> str:
        """What it says, for tables: measure, factor, gain, order and whom it is about."""
        if self.words:
            return self.words
        by = f" by {self.factor}" if self.factor else ""
        gain = "" if self.gain is None else "; {} {} minus {}".format(*self.gain)
        of = ", ".join((*(f"{name} {x}" for name, x in self.only.items()), *self.conditions))
        return f"{self.measure}{by}{gain}: {self.order}" + (f" ({of})" if of else "")


@dataclass(frozen=True)
@of_kinds()
class Source:
    """The publication that a study repeats: its citation and its published values.

    `cells` are published means (and SDs) by measure and level: {"dwell_ms": {"D": (1210, 480)}}.
    """

    citation: str
    participants: int | None = None
    cells: Mapping[str, Mapping[str, tuple[float, float | None]]] = field(default_factory=dict)
    note: str = ""
    only: Mapping[str, Scalar] = field(default_factory=dict)
    """Levels of other factors that trials must have to be compared with it."""
    where: str = ""
    """The section, tables or pages with number of participants and published values."""
    facts: Sequence[Fact] = ()
    """What the source says about its study, beside what this one does (`visavis fidelity`)."""
    orders: Sequence[PrintedOrder] = ()
    """Orders that it states, beside those of its significant published results."""
    not_reproduced: Mapping[str, str] = field(default_factory=dict)
    """Why simulated people do not show an order of its published results, by the order's name."""
