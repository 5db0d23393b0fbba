"""How far somebody who is shown is from the participant, and simulated people who go by that.

Distances lie on the floor: from between the participant's eyes to between those of the person, as
that one is drawn at the time, heights left out.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.lab.kinds import of_kinds
from visavis.lab.yaml_lines import did_you_mean
from visavis.stimuli.dressing.office import look_of
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.scene import SceneFrame
from visavis.study.scenes import StagedScene

LOOK_STEP_S: Final = 0.1
"""How often simulated people judge a distance; in between it changes evenly."""


def agent_of(role: str, staged_scene: StagedScene | None) -> int:
    """Return who plays a role, or has a place, in what is shown.

    Raises:
        DesignError: nobody does.
    """
    roles = {} if staged_scene is None else staged_scene.roles
    if role not in roles:
        near = did_you_mean(role, roles) or "; nobody is shown"
        raise DesignError(f"distance_to: there is no role or place {role!r}{near}")
    return roles[role]


def floor_distances_m(frame: SceneFrame, t_ns: int, eyes_m: Vector) -> npt.NDArray[np.float64]:
    """Return how far everybody in a scene (n) is at a session time from eyes (3,) in world."""
    picture = picture_of(replace(frame, t_ns=t_ns))
    people = picture.people
    theirs_m = np.array(
        [
            look_of(one, root_m, turns)[1]
            for one, root_m, turns in zip(
                picture.cast, people.root_m, people.orientation_wxyz, strict=True
            )
        ]
    ).reshape(-1, 3)
    x, _, z = (theirs_m - eyes_m).T
    distances_m: npt.NDArray[np.float64] = np.hypot(x, z)
    return distances_m


@dataclass(frozen=True)
@of_kinds()
class WhenNear:
    """What a simulated person's answer to `Keys` may be: to press `option` as soon as somebody whom
    they see is `within_m` or nearer, and `other_s` later, which seeing and pressing take.

    Who never comes so near is not stopped: nothing is pressed.

    Raises:
        DesignError: a number is not possible.
    """

    option: str
    within_m: float
    other_s: float = 0.25

    def __post_init__(self) -> None:
        if not (np.isfinite(self.within_m) and 0.0 <= self.other_s < np.inf):
            raise DesignError(
                f"WhenNear: within_m is {self.within_m:g} and other_s {self.other_s:g}; give "
                "metres, and seconds from 0"
            )

    def seconds(
        self, frame: SceneFrame, since_ns: int, eyes_m: Vector, limit_s: float
    ) -> float | None:
        """Return how long after `since_ns` somebody in a scene was near enough and the option is
        pressed; None if nobody is within a time.
        """
        if not frame.scene.agents:
            return None
        before_m = np.inf
        for step in range(round(limit_s / LOOK_STEP_S) + 1):
            t_ns = since_ns + round(step * LOOK_STEP_S * NS_PER_S)
            now_m = float(floor_distances_m(frame, t_ns, eyes_m).min())
            if now_m <= self.within_m:
                share = (before_m - self.within_m) / (before_m - now_m) if step else 1.0
                return max(0.0, step - 1 + share) * LOOK_STEP_S + self.other_s
            before_m = now_m
        return None
