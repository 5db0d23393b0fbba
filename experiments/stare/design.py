"""The parameters of the stare study and its conditions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from visavis.protocol.plan.parameters import Range, Within
from visavis.stimuli.scenes.audience import ACTIVE_PLACES, PLACES

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
    """Parameters of the study; the defaults are those of the source.

    `agents` people sit in the audience, at least one on each of the nine places of the active
    agent. `pad_deg` widens heads in the area-of-interest rule that decides a look online and
    offline; `look_trigger_ms` lets a gaze change wait after the look that causes it; without a
    look it comes at `switch_at_01` of the trial. `drain_ms` is how long the scene stays after the
    trial's end, at most, for samples taken before the end that have not arrived yet. The training
    lasts as long as the participant likes: from `practice_s` on the operator's space bar or a key
    of the participant ends it (at once where nobody watches), at the latest `practice_limit_s`.
    `voice` is a WAV file in which the speaker talks, heard from where they stand; the source had
    none.
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
    voice: str = ""


DEFAULT_PARAMETERS: Final = StareParameters()
LEVELS: Final = {"condition": CONDITIONS, "zone": ZONES, "depth": DEPTHS}
RANGES: Final[Mapping[str, Range]] = {
    **LEVELS,
    **dict.fromkeys(("trial_s", "practice_s"), Within(0, open=True)),
    **dict.fromkeys(("intertrial_s", "pad_deg", "look_trigger_ms", "drain_ms"), Within(0)),
    "agents": Within(
        MIN_AGENTS, MAX_AGENTS, why="places that can hold the active agent, and seats there are"
    ),
    "switch_at_01": Within(0, 1, open=True, why="a share of the trial"),
}


def place_of(factors: Mapping[str, Any]) -> str:
    """Return where the active agent of a trial sits."""
    return f"{factors['zone']}_{factors['depth']}"
