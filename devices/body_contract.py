"""The body that simulated sensors measure: the contract of a simulated participant."""

from collections.abc import Iterator, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector

EYES_DTYPE = np.dtype(
    [
        ("left_direction_head", "f8", (3,)),
        ("right_direction_head", "f8", (3,)),
        ("openness_01", "f8"),
        ("pupil_mm", "f8"),
    ]
)
"""The state of two eyes at an instant, as an eye tracker's camera would see it."""


class Hand(Protocol):
    """Whatever presses; session time never goes back from call to call."""

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield (t_ns, control, value) of every press and release since the last call."""
        ...


class Body(Hand, Protocol):
    """The body that simulated sensors measure: one body, so that eyes, head and hands agree.

    Times are session nanoseconds; calls come with non-decreasing times.
    """

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states, shape (n,), dtype `EYES_DTYPE`; directions converge on the
        point looked at and are unit vectors in the head frame.
        """
        ...

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return position (3,) in metres and orientation (4,) (w, x, y, z) in world."""
        ...

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour (a trial, a validation).

        Simulators draw their noise from (their seed, stretch), anew whenever it changes, so
        that a stretch performed again gives the same samples.
        """
        ...

    def fit(self) -> int:
        """Return how the headset sits; it changes when it is taken off and put on again.

        The systematic error of a simulated eye tracker is drawn from (its seed, fit).
        """
        ...


@runtime_checkable
class RecallingBody(Body, Protocol):
    """A body that can be asked later what its eyes did; see `recalls_ns`."""

    @property
    def recalls_ns(self) -> int:
        """How long after a time `eyes` still returns the same for it, within one stretch."""
        ...


@runtime_checkable
class PlanningBody(Body, Protocol):
    """A body whose head and eyes follow plans of its own, and can be asked for coming times."""

    @property
    def plan_number(self) -> int:
        """A number that is another one as soon as something shown or said may change the plans."""
        ...

    def heads_ahead(
        self, t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return what `head` will return for coming times (n,): positions (n, 3) and orientations
        (n, 4). It changes nothing, and holds while `plan_number` is the same.
        """
        ...

    def eyes_ahead(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return what `eyes` will return for times (n,) of which the last are coming, likewise."""
        ...


def has_plans_of(kind: type) -> bool:
    """Tell whether a class itself says what its head and eyes will do, and not only a base class
    whose head or eyes, or whose ways to see and hear, it replaced.
    """
    others = ("head", "eyes", "sense", "see", "look_at", "prepare")
    return _says_itself(kind, "heads_ahead", others)


def foresees_presses(kind: type) -> bool:
    """Tell whether a class itself predicts its presses, and not only a base class."""
    return _says_itself(kind, "next_press_ns", ("presses",))


def _says_itself(kind: type, name: str, others: Sequence[str]) -> bool:
    """Tell whether no class before the one that defines a method defines one of the others."""
    place, *places = (
        next((i for i, c in enumerate(kind.__mro__) if one in vars(c)), len(kind.__mro__))
        for one in (name, *others)
    )
    return place <= min(places)


@runtime_checkable
class ForeseeableHand(Body, Protocol):
    """A body that can tell until when it presses nothing."""

    def next_press_ns(self) -> int | None:
        """Return the session time of the next press, None when none is planned.

        It holds until the body is shown or asked something.
        """
        ...


@runtime_checkable
class MovingBody(Body, Protocol):
    """A body whose limbs are tracked and whose skin feels an armband."""

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        ...

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Receive what the motors of the band worn as `role` do from `t_ns` on."""
        ...


@runtime_checkable
class HearingBody(Body, Protocol):
    """A body with ears."""

    def hear(self, samples: npt.NDArray[np.float32], rate_hz: int, t_ns: int) -> None:
        """Receive what reaches the left and the right ear (n, 2) from `t_ns` on."""
        ...


class PressesNothing:
    """The hands of a body that never presses anything."""

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield nothing."""
        return iter(())


class OneStretch(PressesNothing):
    """Stretch and fit of a body that does one thing all the time and keeps the headset on."""

    def stretch(self) -> int:
        """Return 0, the only stretch."""
        return 0

    def fit(self) -> int:
        """Return 0, the only fit."""
        return 0
