"""What one participant of the crowd study will do, planned before anything runs."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Final

from devices.contracts import VibrationPattern
from experiments.crowd.patterns import PATTERNS
from lab.errors import DesignError
from protocol.design import Design, Factor, make_plan
from protocol.plan import Block, SessionPlan, Trial
from protocol.steps import Scalar
from stimuli.scenes.station_crowd import (
    CONFIGURATIONS,
    ROOM_SIDE_M,
    START_M,
    TRAINING_CONFIGURATION,
)

STUDY: Final = "crowd"
STUDY_VERSION: Final = "1"

BEFORE: Final = "NoHaptic1"
HAPTIC: Final = "Haptic"
AFTER: Final = "NoHaptic2"
CONDITIONS: Final = (BEFORE, HAPTIC, AFTER)
"""The three blocks, in this order for everybody: order and condition are one."""

HAPTICS_GROUP: Final = "haptics"
CONTROL_GROUP: Final = "control"
"""With a control group, half of the participants never feel a vibration in any block."""

AFTER_BLOCK: Final = ("embodiment", "presence")
AT_END: Final = ("demographics", "free_comment")
QUESTIONNAIRES: Final = (*AFTER_BLOCK, *AT_END)

NEEDED_SIDE_M: Final = 2 * max(abs(START_M[0]), abs(START_M[1]))
"""Side of the smallest tracked square that holds the crowd and the mark."""
FARTHEST_HOME_M: Final = 2.0
QUIET_AFTER_MS: Final = (50.0, 1000.0)
"""Shorter than a few samples of a slow tracker would be silence in between, longer is no rule."""
SLOWEST_MODULATION_HZ: Final = 0.1
FASTEST_MODULATION_HZ: Final = 50.0

TRAINING_INSTRUCTION: Final = (
    "You will find yourself in a metro station, in your own body, at the edge of a crowd. Across "
    "the crowd, on the far side, hangs a board. Walk through to the board, read aloud the track "
    "of the next train, which it shows when you come close, and walk back to the mark where you "
    "started. Please walk as you would in a real station. This first time is for practice."
)
BLOCK_INSTRUCTION: Final = (
    "Eight walks follow, each through another crowd. Go to the board, read the track number "
    "aloud, and come back to the mark. Walk as you would in a real station. Say so if you need "
    "a pause."
)


@dataclass(frozen=True)
class CrowdParameters:
    """What can be set in the study; the defaults are those of the source where it says them.

    `pattern` names a vibration pattern of `experiments.crowd.patterns`; `pattern_low_hz`,
    `pattern_high_hz` and `pattern_modulation_hz` replace its numbers (0 keeps them).
    `nearest_motor` drives only the motor nearest the contact, which the source could not.
    `haptic_update_hz` looks at contacts only so often (the source's link: 4), 0 at every sample.
    `quiet_after_ms` silences the bands when the body tracker says nothing or stands still.
    `limit_s` ends a walk that does not come back. `with_control_group` adds the second group.
    `tracking_side_m` is the side of the tracked area. `record_gaze` connects the lab's eye tracker
    too, which the study does not need.
    """

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
    configurations: int = CONFIGURATIONS
    with_control_group: bool = False
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
        if not 0 < self.limit_s < math.inf:
            yield f"limit_s is a time above 0, not {self.limit_s:g}"
        if not 0 < self.home_within_m <= FARTHEST_HOME_M:
            yield f"home_within_m is above 0 and at most {FARTHEST_HOME_M:g}"
        if not 0 <= self.intertrial_s < math.inf:
            yield f"intertrial_s is a time from 0 on, not {self.intertrial_s:g}"
        if not 1 <= self.configurations <= CONFIGURATIONS:
            yield f"configurations is 1 to {CONFIGURATIONS}"
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


DEFAULT_PARAMETERS: Final = CrowdParameters()


def design_of(params: CrowdParameters = DEFAULT_PARAMETERS) -> Design:
    """Return three blocks in fixed order, each with every configuration in random order."""
    groups = (Factor("group_of", (HAPTICS_GROUP, CONTROL_GROUP), between=True),)
    return Design(
        study=STUDY,
        version=STUDY_VERSION,
        factors=(
            Factor("condition", CONDITIONS),
            Factor("configuration", tuple(range(1, params.configurations + 1))),
            *(groups if params.with_control_group else ()),
        ),
        order="random",
        blocked_by="condition",
        block_order="fixed",
        practice=({"condition": BEFORE, "configuration": 1},),
        practice_instruction=TRAINING_INSTRUCTION,
        instruction=BLOCK_INSTRUCTION,
        calibrate_blocks=False,
        calibrate_practice=False,
        questionnaires=AT_END,
        parameters=asdict(params),
    )


def plan_session(
    participant_index: int,
    seed: int,
    *,
    group: str = "",
    params: CrowdParameters = DEFAULT_PARAMETERS,
) -> SessionPlan:
    """Plan a participant's session: one training walk, then the three blocks; pure."""
    design = design_of(params)
    chosen = None if params.with_control_group and not group else group
    plan = make_plan(design, seed=seed, participant_index=participant_index, group=chosen)
    training, *blocks = plan.blocks
    return replace(
        plan,
        blocks=(
            replace(training, name="Training", trials=tuple(map(_training, training.trials))),
            *(_block(block, plan.group) for block in blocks),
        ),
    )


def _training(trial: Trial) -> Trial:
    factors: dict[str, Scalar] = {
        "condition": "Training",
        "configuration": TRAINING_CONFIGURATION,
        "vibrates": False,
    }
    return replace(trial, factors=factors)


def _block(block: Block, group: str) -> Block:
    trials = []
    for trial in block.trials:
        condition = trial.factors["condition"]
        factors: dict[str, Scalar] = {
            "condition": condition,
            "configuration": trial.factors["configuration"],
            "vibrates": condition == HAPTIC and group != CONTROL_GROUP,
        }
        trials.append(replace(trial, factors=factors))
    name = str(block.trials[0].factors["condition"])
    return replace(block, name=name, trials=tuple(trials), questionnaires=AFTER_BLOCK)
