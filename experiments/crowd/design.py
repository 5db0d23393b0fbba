"""Blocks, groups and parameters of the crowd study."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

from devices.contracts import VibrationPattern
from experiments.crowd.patterns import PATTERNS
from lab.errors import DesignError
from stimuli.scenes.station_crowd import (
    CONFIGURATIONS,
    DENSITY_PER_M2,
    MAX_DENSITY_PER_M2,
    MIN_DENSITY_PER_M2,
    ROOM_SIDE_M,
    START_M,
)

BEFORE: Final = "NoHaptic1"
HAPTIC: Final = "Haptic"
AFTER: Final = "NoHaptic2"
CONDITIONS: Final = (BEFORE, HAPTIC, AFTER)
"""The three blocks, in this order for everybody: order and condition are one."""

HAPTICS_GROUP: Final = "haptics"
CONTROL_GROUP: Final = "control"
GROUPS: Final = (HAPTICS_GROUP, CONTROL_GROUP)
"""With a control group, half of the participants never feel a vibration in any block."""

CROWDS: Final = tuple(range(1, CONFIGURATIONS + 1))

AFTER_BLOCK: Final = ("embodiment", "presence")
AT_END: Final = ("demographics", "free_comment")
TRAINING: Final = "Training"
"""The condition of the training walk."""

NEEDED_SIDE_M: Final = 2 * max(abs(START_M[0]), abs(START_M[1]))
"""Side of the smallest tracked square that holds the crowd and the mark."""
FARTHEST_HOME_M: Final = 2.0
QUIET_AFTER_MS: Final = (50.0, 1000.0)
"""Shorter than a few samples of a slow tracker would be silence in between, longer is no rule."""
SLOWEST_MODULATION_HZ: Final = 0.1
FASTEST_MODULATION_HZ: Final = 50.0


@dataclass(frozen=True)
class CrowdParameters:
    """What can be set in the study; the defaults are those of the source where it says them.

    `density_per_m2` is how many people stand on a square metre of every crowd.
    `pattern` names a vibration pattern of `experiments.crowd.patterns`; `pattern_low_hz`,
    `pattern_high_hz` and `pattern_modulation_hz` replace its numbers (0 keeps them).
    `nearest_motor` drives only the motor nearest the contact, which the source could not.
    `haptic_update_hz` looks at contacts only so often (the source's link: 4), 0 at every sample.
    `quiet_after_ms` silences the bands when the body tracker says nothing or stands still.
    `limit_s` ends a walk that does not come back.
    `tracking_side_m` is the side of the tracked area. `record_gaze` connects the lab's eye tracker
    too, which the study does not need.
    """

    density_per_m2: float = DENSITY_PER_M2
    pattern: str = "published"
    pattern_low_hz: float = 0.0
    pattern_high_hz: float = 0.0
    pattern_modulation_hz: float = 0.0
    nearest_motor: bool = False
    haptic_update_hz: float = 0.0
    quiet_after_ms: float = 150.0
    limit_s: float = 180.0
    home_within_m: float = 0.45
    intertrial_s: float = 2.0
    tracking_side_m: float = ROOM_SIDE_M
    record_gaze: bool = False

    def __post_init__(self) -> None:
        problems = [*self._vibration_problems(), *self._procedure_problems()]
        if problems:
            raise DesignError(f"crowd: {'; '.join(problems)}")

    def _vibration_problems(self) -> Iterator[str]:
        if self.pattern not in PATTERNS:
            yield f"pattern {self.pattern!r} is none of {', '.join(PATTERNS)}"
            return
        asked = (self.pattern_low_hz, self.pattern_high_hz, self.pattern_modulation_hz)
        if not all(0 <= rate_hz < math.inf for rate_hz in asked):
            yield (
                "pattern_low_hz, pattern_high_hz and pattern_modulation_hz are rates above 0, or 0 "
                "for the pattern's own"
            )
            return
        vibration = self.vibration
        if vibration.low_hz > vibration.high_hz:
            yield (
                f"the pattern would swing from {vibration.low_hz:g} Hz down to "
                f"{vibration.high_hz:g} Hz; give pattern_low_hz and a higher pattern_high_hz"
            )
        if not SLOWEST_MODULATION_HZ <= vibration.modulation_hz <= FASTEST_MODULATION_HZ:
            yield (
                f"pattern_modulation_hz is {SLOWEST_MODULATION_HZ:g} to "
                f"{FASTEST_MODULATION_HZ:g}, not {vibration.modulation_hz:g}"
            )
        if not 0 <= self.haptic_update_hz < math.inf:
            yield f"haptic_update_hz is 0 or above, not {self.haptic_update_hz:g}"
        shortest, longest = QUIET_AFTER_MS
        if not shortest <= self.quiet_after_ms <= longest:
            yield f"quiet_after_ms is {shortest:g} to {longest:g}, not {self.quiet_after_ms:g}"

    def _procedure_problems(self) -> Iterator[str]:
        if not MIN_DENSITY_PER_M2 <= self.density_per_m2 <= MAX_DENSITY_PER_M2:
            yield (
                f"density_per_m2 is {MIN_DENSITY_PER_M2:g} to {MAX_DENSITY_PER_M2:g}, not "
                f"{self.density_per_m2:g}"
            )
        if not 0 < self.limit_s < math.inf:
            yield f"limit_s is a time above 0, not {self.limit_s:g}"
        if not 0 < self.home_within_m <= FARTHEST_HOME_M:
            yield f"home_within_m is above 0 and at most {FARTHEST_HOME_M:g}"
        if not 0 <= self.intertrial_s < math.inf:
            yield f"intertrial_s is a time from 0 on, not {self.intertrial_s:g}"
        if not self.tracking_side_m >= NEEDED_SIDE_M:
            yield (
                f"tracking_side_m is {self.tracking_side_m:g}, but the crowd and the start mark "
                f"need {NEEDED_SIDE_M:.1f} m on each side; track a larger area"
            )

    @property
    def vibration(self) -> VibrationPattern:
        """The pattern in force."""
        chosen = PATTERNS[self.pattern]
        return replace(
            chosen,
            low_hz=self.pattern_low_hz or chosen.low_hz,
            high_hz=self.pattern_high_hz or chosen.high_hz,
            modulation_hz=self.pattern_modulation_hz or chosen.modulation_hz,
        )

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> "CrowdParameters":
        """Return the parameters of a plan; what it does not name is the source's."""
        known = {f.name for f in fields(cls)}
        return cls(**{k: v for k, v in parameters.items() if k in known})


DEFAULT_PARAMETERS: Final = CrowdParameters()


def vibrates(factors: Mapping[str, Any]) -> bool:
    """Return whether contact is answered in a trial: in one block, but never for controls."""
    return factors["condition"] == HAPTIC and factors.get("group") != CONTROL_GROUP


def check_levels(parameters: Mapping[str, Any]) -> None:
    """Refuse conditions, crowds and groups that the study does not have; fewer are a smaller study.

    Raises:
        DesignError: with the level and those there are.
    """
    for name, known in (("condition", CONDITIONS), ("configuration", CROWDS), ("group", GROUPS)):
        for level in parameters.get(name, ()):
            if level not in known:
                there = ", ".join(map(str, known))
                raise DesignError(f"crowd has no {name} {level!r}; choose among {there}")
