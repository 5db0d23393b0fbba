"""Kinds of procedural motion and their parameters, as data."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stimuli.motion.errors import MotionError
from stimuli.motion.seated_kernels import seated_rows
from stimuli.motion.standing_kernels import idle_rows

Kernel = Callable[[npt.NDArray[np.int64], Vector, npt.NDArray[np.int64], Vector, Vector, Vector],
                  None]  # fmt: skip
NUMBERS: Final = 12
"""How many numbers a kernel may be given a person."""

StandingArms = Literal["any", "hanging", "clasped", "folded", "behind"]
SittingHands = Literal["any", "thighs", "lap", "folded"]
_STANDING: Final = {"hanging": 0, "clasped": 1, "folded": 2, "behind": 3}
_SITTING: Final = {"thighs": 0, "lap": 1, "folded": 2}


def _one_of(choice: str, ways: dict[str, int], shares: tuple[float, ...], seed: int) -> float:
    """Return the number of a way; "any" is drawn by seed with the given shares."""
    if choice == "any":
        return float(np.random.default_rng((seed, 7)).choice(len(shares), p=shares))
    if choice not in ways:
        raise MotionError(f"no way {choice!r} to keep the arms; use any, {', '.join(ways)}")
    return float(ways[choice])


def _check(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise MotionError(f"{name} is {value}; give a number from {least} to {most}")


@dataclass(frozen=True)
class Idle:
    """Stand at ease. `lively` scales every movement but breathing: 0 keeps still, 1 is usual."""

    arms: StandingArms = "any"
    lively: float = 1.0

    def __post_init__(self) -> None:
        _check("lively", self.lively, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        return self.lively, _one_of(self.arms, _STANDING, (0.6, 0.16, 0.16, 0.08), seed)


@dataclass(frozen=True)
class Sit:
    """Sit and listen on a seat `seat_m` above the floor, leaning back by an angle."""

    seat_m: float = 0.45
    hands: SittingHands = "any"
    lean_back_deg: float = 6.0
    lively: float = 1.0
    nods: float = 1.0

    def __post_init__(self) -> None:
        _check("seat_m", self.seat_m, 0.25, 1.0)
        _check("lean_back_deg", self.lean_back_deg, -25.0, 30.0)
        _check("lively", self.lively, 0.0, 2.0)
        _check("nods", self.nods, 0.0, 2.0)

    def numbers(self, seed: int) -> tuple[float, ...]:
        """Return what the kernel is given."""
        hands = _one_of(self.hands, _SITTING, (0.55, 0.3, 0.15), seed)
        return self.lively, hands, self.seat_m, float(np.radians(self.lean_back_deg)), self.nods


Kind = Idle | Sit
_KERNELS: Final[dict[type, tuple[int, Kernel]]] = {
    Idle: (0, idle_rows),
    Sit: (1, seated_rows),
}


def code_of(kind: Kind) -> int:
    """Return the number of a kind."""
    return _KERNELS[type(kind)][0]


def kernel_of(code: int) -> Kernel:
    """Return the kernel that writes the posture of a kind."""
    return next(kernel for number, kernel in _KERNELS.values() if number == code)
