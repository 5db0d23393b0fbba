"""A simulated body whose head rests before a screen.

Its own head may turn and sway; in the chin rest it does not, and the eyes do what the head did:
they converge on the same point of the world. Not modelled: things outside the screen are hidden,
and people turn the head to look far aside.
"""

from collections.abc import Iterator, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from visavis.devices.body_contract import foresees_presses, has_plans_of
from visavis.devices.contracts import (
    EYES_DTYPE,
    Body,
    ForeseeableHand,
    HearingBody,
    MovingBody,
    PlanningBody,
    RecallingBody,
)
from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate, unit

EYE_X_M = 0.032
EYES_M = np.array([[-EYE_X_M, 0.0, 0.0], [EYE_X_M, 0.0, 0.0]])
FAR_M = 50.0
PARALLEL = 1e-7


class BodyBeforeScreen:
    """Follow `Body` with the head at `place`."""

    def __init__(self, body: Body, place: Pose) -> None:
        self._body = body
        self._place = place

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return true eye states (n,) in the head that rests."""
        own = self._body.eyes(t_ns)
        poses = [self._body.head(int(t)) for t in t_ns]
        place_m = np.array([position for position, _ in poses]).reshape(-1, 3)
        turn = np.array([orientation for _, orientation in poses]).reshape(-1, 4)
        return self._in_rest(own, place_m, turn)

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return where the head rests."""
        self._body.head(t_ns)
        return self._place.position_m, self._place.orientation_wxyz

    def stretch(self) -> int:
        """Return the number of the present stretch of behaviour."""
        return self._body.stretch()

    def fit(self) -> int:
        """Return how the person sits; it changes when they got up and sat down again."""
        return self._body.fit()

    def presses(self, until_ns: int) -> Iterator[tuple[int, str, float]]:
        """Yield what was pressed since the last call."""
        return self._body.presses(until_ns)

    def hear(self, samples: npt.NDArray[np.float32], rate_hz: int, t_ns: int) -> None:
        """Hear a block of samples."""
        if isinstance(self._body, HearingBody):
            self._body.hear(samples, rate_hz, t_ns)

    def _in_rest(
        self, own: npt.NDArray[np.void], place_m: Vector, turn: Vector
    ) -> npt.NDArray[np.void]:
        """Return eye states (n,) in the head that rests for those in the body's own head, at places
        (n, 3) and in orientations (n, 4).
        """
        eyes: npt.NDArray[np.void] = own.copy()
        if len(own):
            point_m = _convergence_points(place_m, turn, own)
            back = quat_conjugate(self._place.orientation_wxyz)
            in_head = rotate(back, point_m - self._place.position_m)
            # Both eyes at once: each call costs more than the numbers of one sample or two.
            directions = unit(in_head - EYES_M[:, None])
            eyes["left_direction_head"], eyes["right_direction_head"] = directions
        return eyes


@runtime_checkable
class _Planner(PlanningBody, RecallingBody, ForeseeableHand, Protocol):
    """A body whose head, eyes and hands follow plans."""


class PlanningBodyBeforeScreen(BodyBeforeScreen):
    """Follow `PlanningBody`, `RecallingBody` and `ForeseeableHand`, too, with a body that does."""

    def __init__(self, body: _Planner, place: Pose) -> None:
        super().__init__(body, place)
        self._plans = body

    @property
    def recalls_ns(self) -> int:
        """The body's own."""
        return self._plans.recalls_ns

    @property
    def plan_number(self) -> int:
        """The body's own."""
        return self._plans.plan_number

    def heads_ahead(self, t_ns: npt.NDArray[np.int64]) -> tuple[Vector, Vector]:
        """Return where the head rests, at each of the times (n,)."""
        place, n = self._place, len(t_ns)
        return np.tile(place.position_m, (n, 1)), np.tile(place.orientation_wxyz, (n, 1))

    def eyes_ahead(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return eye states (n,) at times of which the last are coming."""
        return self._in_rest(self._plans.eyes_ahead(t_ns), *self._plans.heads_ahead(t_ns))

    def next_press_ns(self) -> int | None:
        """Return the time of the next press; None when none is planned."""
        return self._plans.next_press_ns()


class MovingBodyBeforeScreen(BodyBeforeScreen):
    """Follow `MovingBody`: the limbs stay the body's own."""

    def __init__(self, body: MovingBody, place: Pose) -> None:
        BodyBeforeScreen.__init__(self, body, place)
        self._limbs = body

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true positions (t, n, 3) and orientations (t, n, 4) of segments in world."""
        return self._limbs.segments(names, t_ns)

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Take in what the motors of a band do."""
        self._limbs.feel(role, amplitudes_01, t_ns)


class PlanningMovingBodyBeforeScreen(PlanningBodyBeforeScreen, MovingBodyBeforeScreen):
    """Follow what both do."""

    def __init__(self, body: _Planner, limbs: MovingBody, place: Pose) -> None:
        PlanningBodyBeforeScreen.__init__(self, body, place)
        self._limbs = limbs


def before_screen(body: Body, place: Pose) -> BodyBeforeScreen:
    """Return a body with its head at `place`, which follows the contracts that it follows."""
    kind = type(body)
    if isinstance(body, _Planner) and has_plans_of(kind) and foresees_presses(kind):
        if isinstance(body, MovingBody):
            return PlanningMovingBodyBeforeScreen(body, body, place)
        return PlanningBodyBeforeScreen(body, place)
    if isinstance(body, MovingBody):
        return MovingBodyBeforeScreen(body, place)
    return BodyBeforeScreen(body, place)


def _convergence_points(place_m: Vector, turn: Vector, eyes: npt.NDArray[np.void]) -> Vector:
    """Return the points of the world (n, 3) on which both eyes converge."""
    assert eyes.dtype == EYES_DTYPE  # noqa: S101 - the contract of a body
    own = np.empty((3, len(eyes), 3))
    own[0] = EYES_M[1]
    own[1], own[2] = eyes["left_direction_head"], eyes["right_direction_head"]
    side, left, right = rotate(turn, own)
    between = 2 * side
    cosine = np.einsum("ij,ij->i", left, right)
    across = np.einsum("ij,ij->i", left, between) - cosine * np.einsum("ij,ij->i", right, between)
    spread = 1 - cosine**2
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(spread > PARALLEL, across / spread, FAR_M)
    reach = np.where(np.isfinite(reach) & (reach > 0), np.minimum(reach, FAR_M), FAR_M)
    points_m: Vector = place_m - side + reach[:, None] * left
    return points_m
