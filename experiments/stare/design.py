"""The parameters of the stare study and its conditions."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

from lab.errors import DesignError
from stimuli.scenes.audience import ACTIVE_PLACES, PLACES

AVERTED: Final = "A"
DIRECTED: Final = "D"
AVERTED_THEN_DIRECTED: Final = "AD"
DIRECTED_THEN_AVERTED: Final = "DA"
CONDITIONS: Final = (AVERTED, DIRECTED, AVERTED_THEN_DIRECTED, DIRECTED_THEN_AVERTED)
"""Where the active agent looks: away, at the participant, or first the one and then the other."""
DYNAMIC_CONDITIONS: Final = (AVERTED_THEN_DIRECTED, DIRECTED_THEN_AVERTED)

ZONES: Final = ("left", "centre", "right")
DEPTHS: Final = ("close", "middle", "far")
MAX_AGENTS: Final = len(PLACES)
MIN_AGENTS: Final = len(ACTIVE_PLACES)


@dataclass(frozen=True)
class StareParameters:
    """What can be set in the study; the defaults are those of the source.

    `agents` people sit in the audience, at least one on each of the nine places of the active
    agent. `pad_deg` widens heads in the area-of-interest rule that decides a look online and
    offline; `look_trigger_ms` lets a gaze change wait after the look that causes it; without a
    look it comes at `switch_at_01` of the trial. `drain_ms` is how long the scene stays after the
    trial's end, at most, for samples taken before the end that have not arrived yet. The training
    lasts as long as the participant likes: from `practice_s` on the operator's space bar or a key
    of the participant ends it (at once where nobody watches), at the latest `practice_limit_s`.
    """

    trial_s: float = 16.0
    intertrial_s: float = 3.0
    practice_s: float = 16.0
    practice_limit_s: float = 600.0
    repetitions: int = 2
    agents: int = MAX_AGENTS
    pad_deg: float = 1.0
    look_trigger_ms: float = 0.0
    switch_at_01: float = 0.5
    drain_ms: float = 50.0

    def __post_init__(self) -> None:
        if not (self.trial_s > 0 and self.intertrial_s >= 0 and self.practice_s > 0):
            raise DesignError(
                f"stare: trial_s {self.trial_s}, practice_s {self.practice_s} and intertrial_s "
                f"{self.intertrial_s} are durations; give seconds above 0 (intertrial_s from 0)"
            )
        if not self.practice_s <= self.practice_limit_s < math.inf:
            raise DesignError(
                f"stare: practice_s {self.practice_s} is the shortest training and "
                f"practice_limit_s {self.practice_limit_s} the longest; give a practice_limit_s "
                "that is not shorter"
            )
        if not MIN_AGENTS <= self.agents <= MAX_AGENTS:
            raise DesignError(
                f"stare: agents is {self.agents}; give {MIN_AGENTS} (the places that can hold the "
                f"active agent) to {MAX_AGENTS} (the seats there are)"
            )
        if not 0 < self.switch_at_01 < 1:
            raise DesignError(
                f"stare: switch_at_01 is {self.switch_at_01}; give a share of the trial between "
                "0 and 1"
            )
        if min(self.pad_deg, self.look_trigger_ms, self.drain_ms) < 0:
            raise DesignError("stare: pad_deg, look_trigger_ms and drain_ms cannot be negative")

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> "StareParameters":
        """Return the parameters of a plan; what it does not name is the source's."""
        known = {f.name for f in fields(cls)}
        return cls(**{k: v for k, v in parameters.items() if k in known})


DEFAULT_PARAMETERS: Final = StareParameters()


def check_levels(parameters: Mapping[str, Any]) -> None:
    """Refuse levels that the study does not have; a subset of them is a smaller study.

    Raises:
        DesignError: with the level and those there are.
    """
    for name, known in (("condition", CONDITIONS), ("zone", ZONES), ("depth", DEPTHS)):
        for level in parameters.get(name, ()):
            if level not in known:
                raise DesignError(f"stare has no {name} {level!r}; choose among {', '.join(known)}")


def place_of(factors: Mapping[str, Any]) -> str:
    """Return where the active agent of a trial sits."""
    return f"{factors['zone']}_{factors['depth']}"
