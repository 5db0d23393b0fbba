"""What a claim expects, read from a text: which level gives the greater values."""

import re
from dataclasses import dataclass
from typing import Final

from visavis.lab.errors import DesignError

HOW_TO_WRITE: Final = (
    'say which level gives the greater values: expects="waves > stands", of more levels '
    '"a > b > c" or "a > b, c", of one of several factors "motion: waves > stands", of their '
    'interaction "motion: waves > stands; distance: near > far"'
)


@dataclass(frozen=True)
class Order:
    """Levels from greater to smaller values: "a > b, c" is (("a",), ("b", "c")).

    `factor` names what they are levels of; empty where the text does not say.
    """

    levels: tuple[tuple[str, ...], ...]
    factor: str = ""

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Every two levels of neighbouring steps, the greater one first."""
        steps = zip(self.levels, self.levels[1:], strict=False)
        return tuple((a, b) for greater, less in steps for a in greater for b in less)

    @property
    def names(self) -> tuple[str, ...]:
        """All levels, the greatest first."""
        return tuple(level for step in self.levels for level in step)


def orders_of(text: str, about: str) -> tuple[Order, ...]:
    """Return the orders in a text: one of an effect, two of an interaction of two factors.

    In an interaction, the difference of the first two levels is greater at the first of the second
    two. `about` begins messages.

    Raises:
        DesignError: the text is no order; it says how to write one.
    """
    orders = tuple(_order(part.strip(), about) for part in text.split(";"))
    if len(orders) > 2:
        raise DesignError(f"{about} expects {text!r}, of more than two factors; name one or two")
    if len(orders) == 2:
        if any(len(o.names) != 2 for o in orders) or not all(o.factor for o in orders):
            raise DesignError(
                f"{about} expects {text!r}; an interaction is written with two factors and two "
                'levels of each: expects="motion: waves > stands; distance: near > far"'
            )
        if orders[0].factor == orders[1].factor:
            raise DesignError(f"{about} expects {text!r}, which names {orders[0].factor} twice")
    return orders


def _order(text: str, about: str) -> Order:
    factor, colon, order = text.rpartition(":")
    steps = [step.strip() for step in re.split("[<>]", order)]
    levels = tuple(tuple(name.strip() for name in step.split(",")) for step in steps)
    names = [name for step in levels for name in step]
    is_mixed = "<" in order and ">" in order
    if len(steps) < 2 or is_mixed or not all(names) or bool(colon) != bool(factor.strip()):
        raise DesignError(f"{about} expects {text!r}, which is no order of levels; {HOW_TO_WRITE}")
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise DesignError(f"{about} expects {text!r}, which names {twice[0]!r} twice")
    return Order(levels[::-1] if "<" in order else levels, factor.strip())
