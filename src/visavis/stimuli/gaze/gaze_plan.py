"""A schedule of looks, as data; eyes, lids, head and trunk follow from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.gaze.gaze_shift_kernels import (
    AROUND,
    ASIDE,
    OBSERVER,
    PERSON,
    POINT,
    Schedule,
    gaze_rows,
    turn_rows,
)
from visavis.stimuli.gaze.turning import Aim, Look
from visavis.stimuli.motion.errors import MotionError

_NOBODY = np.full(3, np.nan)


@dataclass(frozen=True)
class LookAt:
    """A look at a target from `start_s` on. "around": anything in front of the person. "point":
    `where` (3,) in world. "person": `where[0]` is their number. "observer": the observer's eyes.
    "aside": `where` is yaw (left) and pitch (up) in degrees from the front of the own body.
    """

    start_s: float
    target: Literal["around", "point", "person", "observer", "aside"]
    where: tuple[float, ...] = ()


_CODES = {"around": AROUND, "point": POINT, "person": PERSON, "observer": OBSERVER, "aside": ASIDE}
_NEEDED = {"around": 0, "point": 3, "person": 1, "observer": 0, "aside": 2}


@dataclass(frozen=True, eq=False)
class GazePlan:
    """Looks of n people in order of time; people without one look around.

    `observer_m` (3,) is where the observer's eyes are now; `watched_from` gives a plan with it.
    """

    looks: tuple[tuple[LookAt, ...], ...]
    observer_m: Vector | None = None

    def __post_init__(self) -> None:
        for i, own in enumerate(self.looks):
            starts = [look.start_s for look in own]
            if starts != sorted(starts):
                raise MotionError(f"looks of person {i} are out of order; sort them by start_s")
            for look in own:
                if len(look.where) != _NEEDED[look.target] or not np.isfinite(look.where).all():
                    raise MotionError(
                        f"person {i} looks at {look.target!r} with {look.where}; "
                        f"it needs {_NEEDED[look.target]} finite numbers"
                    )
                if look.target == "person" and not 0 <= look.where[0] < len(self.looks):
                    raise MotionError(f"person {i} looks at person {look.where[0]:.0f}, who is not")

    @classmethod
    def of(cls, count: int, looks: Mapping[int, Sequence[LookAt]] | None = None) -> Self:
        """Return a plan for `count` people from the looks of some of them."""
        own = looks or {}
        return cls(tuple(tuple(own.get(i, ())) for i in range(count)))

    def watched_from(self, observer_m: Vector) -> Self:
        """Return the same plan with the observer's eyes at a point (3,) in world."""
        plan = replace(self, observer_m=np.asarray(observer_m, np.float64))
        # Both are the same however the observer moves, which it does every frame.
        plan.__dict__["_schedule"] = self._schedule
        plan.__dict__["_looks_at_observer"] = self._looks_at_observer
        return plan

    @cached_property
    def _looks_at_observer(self) -> bool:
        return any(look.target == "observer" for own in self.looks for look in own)

    @cached_property
    def _schedule(self) -> Schedule:
        flat = [look for own in self.looks for look in own]
        first = np.concatenate([[0], np.cumsum([len(own) for own in self.looks])])
        vectors = np.zeros((max(1, len(flat)), 3))
        for i, look in enumerate(flat):
            where = np.radians(look.where) if look.target == "aside" else look.where
            vectors[i, : len(look.where)] = where
        return Schedule(
            first.astype(np.int64),
            np.array([_CODES[look.target] for look in flat], dtype=np.int64),
            np.array([look.start_s for look in flat], dtype=np.float64),
            vectors,
        )

    def _checked_eyes(self, look: Look) -> Vector:
        if len(look.eyes_m) != len(self.looks):
            raise MotionError(
                f"a gaze plan for {len(self.looks)} people was given {len(look.eyes_m)}"
            )
        if self.observer_m is not None:
            return self.observer_m
        if self._looks_at_observer:
            raise MotionError("a look at the observer needs a place; give it with watched_from()")
        return _NOBODY

    def turns_rad(self, t_s: float, look: Look) -> Vector:
        """Return what trunk and head add (n, 3)."""
        observer = self._checked_eyes(look)
        out = np.zeros((len(look.eyes_m), 3))
        turn_rows(
            t_s,
            self._schedule,
            look.eyes_m,
            look.head_wxyz,
            look.front,
            look.seed,
            observer,
            out,
        )
        return out

    def aim(self, t_s: float, look: Look) -> Aim:
        """Return where the eyes point."""
        observer, n = self._checked_eyes(look), len(look.eyes_m)
        direction, distance, openness = np.empty((n, 3)), np.empty(n), np.empty(n)
        gaze_rows(
            t_s,
            self._schedule,
            look.eyes_m,
            look.front,
            look.seed,
            observer,
            direction,
            distance,
            openness,
        )
        return Aim(direction, distance, openness)
