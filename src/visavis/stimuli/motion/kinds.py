"""Kinds of procedural motion and their parameters, as data."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.lab.kinds import of_kinds
from visavis.stimuli.motion.clip import Motion
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.gait_kernels import gait_rows, step_m
from visavis.stimuli.motion.gesture_kernels import (
    board_rows,
    crouch_rows,
    phone_rows,
    talk_rows,
    text_rows,
    wave_rows,
)
from visavis.stimuli.motion.seated_kernels import seated_rows
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.standing_kernels import idle_rows

Kernel = Callable[
    [npt.NDArray[np.int64], Vector, npt.NDArray[np.int64], Vector, Vector, Vector], None
]
Mouth = Callable[[float], tuple[float, float]]
NUMBERS: Final = 12
"""Largest number of parameters of a kernel per person."""

_CANONICAL_NAMES: Final = canonical_skeleton().names
StandingArms = Literal["any", "hanging", "clasped", "folded", "behind"]
SittingHands = Literal["any", "thighs", "lap", "folded"]
_STANDING: Final = {"hanging": 0, "clasped": 1, "folded": 2, "behind": 3}
_SITTING: Final = {"thighs": 0, "lap": 1, "folded": 2}


def _one_of(choice: str, ways: dict[str, int], shares: tuple[float, ...], seed: int) -> float:
    """Return the number of an option; "any" is drawn by seed with the given shares."""
    if choice == "any":
        return float(np.random.default_rng((seed, 7)).choice(len(shares), p=shares))
    if choice not in ways:
        raise MotionError(f"no way {choice!r} to keep the arms; use any, {', '.join(ways)}")
    return float(ways[choice])


MIN_SEAT_M: Final = 0.2
MAX_SEAT_M: Final = 1.0
"""Between these anybody can sit."""


def _check(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise MotionError(f"{name} is {value}; give a number from {least} to {most}")


@dataclass(frozen=True)
@of_kinds()
class Idle:
    """Stand relaxed. `lively` scales every movement but breathing: 0 keeps still, 1 is usual."""

    arms: StandingArms = "any"
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, _one_of(self.arms, _STANDING, (0.6, 0.16, 0.16, 0.08), seed)


@dataclass(frozen=True)
@of_kinds()
class Sit:
    """Sit and listen on a seat `seat_m` above the floor, leaning back by an angle; `tucked_01` is
    how far the feet are drawn back, 0 where they are by habit, 1 below the seat.
    """

    seat_m: float = 0.45
    hands: SittingHands = "any"
    lean_back_deg: float = 6.0
    lively: float = 1.0
    nods: float = 1.0
    tucked_01: float = 0.0

    def __post_init__(self) -> None:
        _check("seat_m", self.seat_m, MIN_SEAT_M, MAX_SEAT_M)
        _check("lean_back_deg", self.lean_back_deg, -25.0, 30.0)
        _check("lively", self.lively, 0.0, 2.0)
        _check("nods", self.nods, 0.0, 2.0)
        _check("tucked_01", self.tucked_01, 0.0, 1.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        hands = _one_of(self.hands, _SITTING, (0.55, 0.3, 0.15), seed)
        back_rad = float(np.radians(self.lean_back_deg))
        return self.lively, hands, self.seat_m, back_rad, self.nods, self.tucked_01


Hand = Literal["left", "right", "both", "any"]
_HANDS: Final = {"left": 0, "right": 1, "both": 2}


def _hand(choice: str, seed: int) -> float:
    """Return the number of a hand; nine of ten people prefer the right one."""
    if choice == "any":
        return float(np.random.default_rng((seed, 8)).random() < 0.9)
    return float(_HANDS[choice])


@dataclass(frozen=True)
@of_kinds()
class Wave:
    """Wave with one or both hands, standing or on a seat: `rate_hz` to and fro, `swing_deg` of the
    forearm from end to end, `elbow_01` 0 at the side, 1 at the height of the shoulder.
    """

    hand: Hand = "any"
    rate_hz: float = 1.8
    swing_deg: float = 46.0
    elbow_01: float = 0.45
    lively: float = 1.0
    seat_m: float | None = None

    def __post_init__(self) -> None:
        _check("rate_hz", self.rate_hz, 0.2, 4.0)
        _check("swing_deg", self.swing_deg, 0.0, 90.0)
        _check("elbow_01", self.elbow_01, 0.0, 1.0)
        _check("lively", self.lively, 0.0, 2.0)
        if self.seat_m is not None:
            _check("seat_m", self.seat_m, MIN_SEAT_M, MAX_SEAT_M)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        swing = float(np.radians(self.swing_deg))
        seat = self.seat_m or 0.0
        return self.lively, _hand(self.hand, seed), self.rate_hz, swing, self.elbow_01, seat


@dataclass(frozen=True)
@of_kinds()
class Phone:
    """Stand with a phone at the ear; `talk_01` is how much of the call one speaks oneself."""

    hand: Literal["left", "right", "any"] = "any"
    talk_01: float = 0.5
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("talk_01", self.talk_01, 0.0, 1.0)
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, _hand(self.hand, seed), self.talk_01


@dataclass(frozen=True)
@of_kinds()
class Text:
    """Stand reading and typing on a phone, with one hand or both by seed."""

    hand: Literal["left", "right", "any"] = "any"
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, _hand(self.hand, seed)


@dataclass(frozen=True)
@of_kinds()
class WatchBoard:
    """Stand watching a board that lies `yaw_deg` (left) and `pitch_deg` (up) from the front."""

    yaw_deg: float = 0.0
    pitch_deg: float = 16.0
    arms: StandingArms = "any"
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("yaw_deg", self.yaw_deg, -110.0, 110.0)
        _check("pitch_deg", self.pitch_deg, -60.0, 60.0)
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        arms = _one_of(self.arms, _STANDING, (0.6, 0.12, 0.2, 0.08), seed)
        return self.lively, arms, float(np.radians(self.yaw_deg)), float(np.radians(self.pitch_deg))


@dataclass(frozen=True)
@of_kinds()
class Talk:
    """Talk with gestures, standing or on a seat; `size` scales gestures, `voice_01` the jaw."""

    size: float = 1.0
    voice_01: float = 1.0
    seat_m: float | None = None
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("size", self.size, 0.0, 1.4)
        _check("voice_01", self.voice_01, 0.0, 1.0)
        _check("lively", self.lively, 0.0, 2.0)
        if self.seat_m is not None:
            _check("seat_m", self.seat_m, MIN_SEAT_M, MAX_SEAT_M)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, self.size, self.voice_01, self.seat_m or 0.0


@dataclass(frozen=True)
@of_kinds()
class Crouch:
    """Crouch on the balls of the feet; `depth_01` 0 stands, 1 is as low as it goes."""

    depth_01: float = 0.8
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("depth_01", self.depth_01, 0.0, 1.0)
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, self.depth_01


@dataclass(frozen=True)
@of_kinds()
class Walk:
    """Walk straight ahead from one's place, for `distance_m` or without end.

    `stride_cv` is the coefficient of variation of the stride's time, in healthy adults .02 to .03
    (Hausdorff 2005, J. NeuroEng. Rehabil. 2:19); 0 walks like a clock.
    """

    speed_mps: float = 1.3
    distance_m: float = np.inf
    lively: float = 1.0
    stride_cv: float = 0.025

    def __post_init__(self) -> None:
        _check("speed_mps", self.speed_mps, 0.4, 2.2)
        _check("distance_m", self.distance_m, 0.5, np.inf)
        _check("lively", self.lively, 0.0, 2.0)
        _check("stride_cv", self.stride_cv, 0.0, 0.1)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, self.speed_mps, self.distance_m, 0.0, self.stride_cv


@dataclass(frozen=True)
@of_kinds()
class Run:
    """Run straight ahead from one's place, for `distance_m` or without end."""

    speed_mps: float = 3.0
    distance_m: float = np.inf
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("speed_mps", self.speed_mps, 1.6, 4.0)
        _check("distance_m", self.distance_m, 2.0, np.inf)
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, self.speed_mps, self.distance_m, 1.0


@dataclass(frozen=True, eq=False)
class Recorded:
    """Play a clip (or any motion) of the canonical joints, its floor at y = 0 and its origin at
    one's place; eyes and lids are still steered by the gaze, the head is the clip's own.

    `mouth` says how far the jaw is open and the lips are wide, 0 to 1, at seconds from the clip's
    zero; without it the mouth stays shut.
    """

    motion: Motion
    mouth: Mouth | None = None

    def __post_init__(self) -> None:
        if self.motion.skeleton.names != _CANONICAL_NAMES:
            raise MotionError("a clip for people needs the 55 canonical joints; retarget it first")

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return the kernel's parameters: a person who stands still below the clip."""
        return 0.0, 0.0


def gait_duration_s(gait: Walk | Run, leg_m: float) -> float:
    """Return how long somebody with legs of a length (thigh and shin) is under way."""
    step = step_m(gait.speed_mps, leg_m, gait.distance_m, isinstance(gait, Run))
    return (gait.distance_m + 2.0 * step) / gait.speed_mps


Kind = Idle | Sit | Wave | Phone | Text | WatchBoard | Talk | Crouch | Walk | Run | Recorded
_KERNELS: Final[dict[type, tuple[int, Kernel]]] = {
    Idle: (0, idle_rows),
    Sit: (1, seated_rows),
    Wave: (2, wave_rows),
    Phone: (3, phone_rows),
    Text: (4, text_rows),
    WatchBoard: (5, board_rows),
    Talk: (6, talk_rows),
    Crouch: (7, crouch_rows),
    Walk: (8, gait_rows),
    Run: (8, gait_rows),
    Recorded: (0, idle_rows),
}


def code_of(kind: Kind) -> int:
    """Return the number of a kind."""
    return _KERNELS[type(kind)][0]


def kernel_of(code: int) -> Kernel:
    """Return the kernel that writes the posture of a kind."""
    return next(kernel for number, kernel in _KERNELS.values() if number == code)
