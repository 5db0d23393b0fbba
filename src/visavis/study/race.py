"""Answers with a time: evidence for each option is gathered until one reaches a threshold."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds


@dataclass(frozen=True)
@of_kinds()
class Race:
    """What a simulated person's answer may be instead of an option: a race of accumulators.

    Evidence for each option grows at its rate in `drift` (thresholds a second; options with 0 or
    less never arrive) with Gaussian noise of `noise` thresholds a square root of a second; the
    first to arrive is the answer. Arrivals are those of Wald distributions, to which `other_s` adds
    what seeing and pressing take.

    Source: Heathcote & Love (2012), Frontiers in Psychology 3:292, doi:10.3389/fpsyg.2012.00292;
    Logan et al. (2014), Psychological Review 121:66, doi:10.1037/a0035230.

    Raises:
        DesignError: no option has a drift above 0, or a number is not possible.
    """

    drift: Mapping[str, float]
    noise: float = 0.35
    other_s: float = 0.25

    def __post_init__(self) -> None:
        if not any(rate > 0.0 for rate in self.drift.values()):
            raise DesignError("Race: no option has a drift above 0, so that none is ever chosen")
        if not (self.noise > 0.0 and self.other_s >= 0.0):
            raise DesignError(
                f"Race: noise is {self.noise:g}, which is above 0, and other_s {self.other_s:g}, "
                "which is 0 or more"
            )

    def run(self, rng: np.random.Generator) -> tuple[str, float]:
        """Return the option that arrives first, and after how many seconds."""
        arrivals_s = {
            option: float(rng.wald(1.0 / rate, self.noise**-2))
            for option, rate in self.drift.items()
            if rate > 0.0
        }
        first = min(arrivals_s, key=lambda option: arrivals_s[option])
        return first, arrivals_s[first] + self.other_s
