"""Blocks, groups and parameters of the crowd study."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from visavis.devices.contracts import VibrationPattern
from visavis.experiments.crowd.patterns import PATTERNS
from visavis.lab.errors import DesignError
from visavis.protocol.plan.parameters import Range, Within, known_of, out_of_range
from visavis.stimuli.scenes.station_crowd import (
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
ABOUT_OWN_BODY: Final = ("embodiment",)
"""Not asked where participants see no body of their own."""
AT_END: Final = ("demographics", "free_comment")
TRAINING: Final = "Training"
"""The condition of the training walk."""

NEEDED_SIDE_M: Final = 2 * max(abs(START_M[0]), abs(START_M[1]))
"""Side of the smallest tracked square that holds the crowd and the mark."""
FARTHEST_HOME_M: Final = 2.0
QUIET_AFTER_MS: Final = Within(50.0, 1000.0)
"""Below it the gap between a slow tracker's samples would count as silence; above it the rule would
hardly ever act."""
MODULATION_HZ: Final = Within(0.1, 50.0)


@dataclass(frozen=True)
class CrowdParameters:
    """Parameters of the study; the defaults are those of the source where it gives them.

    `density_per_m2` is how many people stand on a square metre of every crowd.
    `pattern` names a vibration pattern of `visavis.experiments.crowd.patterns`; `pattern_low_hz`,
    `pattern_high_hz` and `pattern_modulation_hz` replace its numbers (0 keeps them).
    `nearest_motor` drives only the motor nearest the contact, which the source could not.
    `haptic_update_hz` looks at contacts only so often (the source's link: 4), 0 at every sample.
    `quiet_after_ms` silences the bands when the body tracker says nothing or stands still.
    `limit_s` ends a walk that does not come back.
    `tracking_side_m` is the side of the tracked area. `record_gaze` connects the lab's eye tracker
    too, which the study does not need. `murmur` is a WAV file of a station's sound, heard
    from two loudspeakers in its far corners; the source had none. With
    `own_body` participants see a body of their sex and size where theirs is, as the source's did.
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
    murmur: str = ""
    own_body: bool = True

    @property
    def vibration(self) -> VibrationPattern:
        """The pattern in force."""
        pattern = PATTERNS[self.pattern]
        return replace(
            pattern,
            low_hz=self.pattern_low_hz or pattern.low_hz,
            high_hz=self.pattern_high_hz or pattern.high_hz,
            modulation_hz=self.pattern_modulation_hz or pattern.modulation_hz,
        )


DEFAULT_PARAMETERS: Final = CrowdParameters()
RANGES: Final[Mapping[str, Range]] = {
    "condition": CONDITIONS,
    "configuration": CROWDS,
    "group": GROUPS,
    "density_per_m2": Within(MIN_DENSITY_PER_M2, MAX_DENSITY_PER_M2),
    "pattern": tuple(PATTERNS),
    **dict.fromkeys(
        ("pattern_low_hz", "pattern_high_hz", "pattern_modulation_hz"),
        Within(0, why="0 for the pattern's own"),
    ),
    "haptic_update_hz": Within(0),
    "quiet_after_ms": QUIET_AFTER_MS,
    "limit_s": Within(0, open=True),
    "home_within_m": Within(0.05, FARTHEST_HOME_M),
    "intertrial_s": Within(0),
    "tracking_side_m": Within(
        NEEDED_SIDE_M, why=f"the crowd and the start mark need {NEEDED_SIDE_M:.1f} m on each side"
    ),
}


def vibrates(factors: Mapping[str, Any]) -> bool:
    """Return whether contact is answered in a trial: in one block, but never for controls."""
    return factors["condition"] == HAPTIC and factors.get("group") != CONTROL_GROUP


def check_vibration(parameters: Mapping[str, Any]) -> None:
    """Refuse a vibration that no band could play.

    Raises:
        DesignError: with what is wrong with its rates.
    """
    vibration = known_of(CrowdParameters, parameters).vibration
    if vibration.low_hz > vibration.high_hz:
        raise DesignError(
            f"the pattern would swing from {vibration.low_hz:g} Hz down to {vibration.high_hz:g} "
            "Hz; give pattern_low_hz and a higher pattern_high_hz"
        )
    problem = out_of_range("pattern_modulation_hz", vibration.modulation_hz, MODULATION_HZ)
    if problem:
        raise DesignError(f"crowd: {problem}")
