"""What a gaze asks of a body: turns of trunk and head, and where the eyes end up."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector


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
    """Gaze that somebody else has worked out, such as a study; bodies add nothing of their own.

    `direction` (n, 3) unit vectors in world, `openness_01` (n,) as in `SceneFrame`. `distance_m`
    is where both eyes' axes meet; without it they are parallel, each exactly along `direction`.
    """

    direction: Vector
    openness_01: Vector
    distance_m: float = np.inf

    def turns_rad(self, t_s: float, look: Look) -> Vector:
        """Return zeros."""
        return np.zeros((len(look.eyes_m), 3))

    def aim(self, t_s: float, look: Look) -> Aim:
        """Return what was given."""
        n = len(look.eyes_m)
        return Aim(
            np.ascontiguousarray(self.direction, np.float64),
            np.full(n, self.distance_m),
            np.ascontiguousarray(self.openness_01, np.float64),
        )
