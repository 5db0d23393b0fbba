"""The interface of gaze: turns of trunk and head, and the direction of the eyes."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.gaze.fixation_kernels import fixation_rows


@dataclass(frozen=True, eq=False)
class Look:
    """How n people stand at a moment: `eyes_m` (n, 3) between the eyes and `head_wxyz` (n, 4), in
    world; `front` (n, 4) is where their body belongs to (radians left of −z), whether they are busy
    with something (1 or 0) and its yaw and pitch from there; `seed` (n,) who they are.
    """

    eyes_m: Vector
    head_wxyz: Vector
    front: Vector
    seed: npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Aim:
    """Where the eyes of n people go: `direction` (n, 3) unit, world, from between the eyes.

    Both axes meet at `distance_m` (n,); infinite means parallel. Rows of NaN look straight ahead.
    `openness_01` (n,) is 0 for closed lids.
    """

    direction: Vector
    distance_m: Vector
    openness_01: Vector


class Gaze(Protocol):
    """Decides how people look; a pure function of time and of how they stand."""

    def turns_rad(self, t_s: float, look: Look) -> Vector:
        """Return what trunk and head add: yaw of trunk, yaw and pitch of the head (n, 3)."""
        ...

    def aim(self, t_s: float, look: Look) -> Aim:
        """Return where the eyes point, given how people finally stand."""
        ...


@dataclass(frozen=True, eq=False)
class Aimed:
    """Gaze that somebody else has worked out, such as a study; bodies add nothing of their own but
    what eyes do while they fixate.

    `direction` (n, 3) unit vectors in world, `openness_01` (n,) as in `SceneFrame`. `distance_m`
    (n,) is where both eyes' axes meet, seen from `origin_m` (n, 3) or, without, from between the
    eyes wherever these are; NaN or without it they are parallel. `fixates` moves both eyes alike
    by drift and micro-saccades.
    """

    direction: Vector
    openness_01: Vector
    distance_m: Vector | None = None
    origin_m: Vector | None = None
    fixates: bool = False

    def turns_rad(self, t_s: float, look: Look) -> Vector:
        """Return zeros."""
        return np.zeros((len(look.eyes_m), 3))

    def aim(self, t_s: float, look: Look) -> Aim:
        """Return what was given."""
        n = len(look.eyes_m)
        direction = np.array(self.direction, np.float64)
        distance_m = np.full(n, np.inf)
        if self.distance_m is not None:
            distance_m = np.where(np.isfinite(self.distance_m), self.distance_m, np.inf)
            hits = np.flatnonzero(np.isfinite(distance_m))
            if self.origin_m is not None and hits.size:
                goal = self.origin_m[hits] + distance_m[hits, None] * direction[hits]
                away = goal - look.eyes_m[hits]
                distance_m[hits] = np.sqrt((away * away).sum(axis=1))
                direction[hits] = away / distance_m[hits, None]
        if self.fixates:
            fixation_rows(t_s, look.seed, direction)
        return Aim(direction, distance_m, np.ascontiguousarray(self.openness_01, np.float64))
