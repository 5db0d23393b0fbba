"""The result of every factorial test: one effect per term, with design and provenance."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from visavis.analysis.statistics.design import Design
from visavis.analysis.statistics.results import Provenance, Result, Row


class TermEffect(Protocol):
    """The test of one term."""

    @property
    def term(self) -> tuple[str, ...]:
        """The factors it is about."""
        ...

    def sentence(self) -> str:
        """Return the effect as an APA sentence."""
        ...

    def row(self) -> Row:
        """Return the effect as one flat table row."""
        ...


E = TypeVar("E", bound=TermEffect)


@dataclass(frozen=True)
class EffectTable(Result, Generic[E]):
    """Tests of all terms of a design."""

    effects: tuple[E, ...]
    design: Design
    provenance: Provenance

    def effect(self, term: str | Sequence[str]) -> E:
        """Return one effect by term, 'A:B' or ('A', 'B'), in any order of the factors."""
        factors = self.design.term(term)
        return next(e for e in self.effects if e.term == factors)

    def sentence(self) -> str:
        """Return all effects, one sentence each."""
        lines = [f"{self.provenance.test}, n = {self.provenance.n}."]
        lines += [effect.sentence() + "." for effect in self.effects]
        lines += [f"Note: {note}." for note in self.provenance.notes]
        return "\n".join(lines)

    def rows(self) -> tuple[Row, ...]:
        """Return one flat table row per effect."""
        common = self.provenance.row()
        # The columns of an effect come first, and win where both have one.
        return tuple({**row, **common, **row} for row in (e.row() for e in self.effects))

    def row(self) -> Row:
        """Return the first effect's row; `rows` has them all."""
        return self.rows()[0]
