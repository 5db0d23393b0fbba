"""How far one motion is from another, joint by joint, at times aligned by their key times.

Source: a study in which people match a target walk by sliders; a match is a mean below 0.06 m.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError

MATCH_M: Final = 0.06
"""Below this mean distance two motions match, as the source's success does."""


@dataclass(frozen=True)
class PoseDistance:
    """Distances of joints summed over poses and joints; `samples` of them."""

    sum_m: float
    samples: int

    @property
    def mean_m(self) -> float:
        """The mean distance of a joint."""
        return self.sum_m / self.samples

    def matches(self, limit_m: float = MATCH_M) -> bool:
        """Whether the mean is below a limit."""
        return self.mean_m < limit_m


def pose_distance(target_m: Vector, made_m: Vector) -> PoseDistance:
    """Compare joint positions (poses, joints, 3) at the same normalised times.

    Raises:
        MotionError: the shapes differ, or a position is not finite.
    """
    if target_m.shape != made_m.shape or target_m.ndim != 3 or target_m.shape[-1] != 3:
        raise MotionError(
            f"poses {made_m.shape} are compared with {target_m.shape}; give both as "
            "(poses, joints, 3)"
        )
    distance_m = np.linalg.norm(target_m - made_m, axis=-1)
    if not distance_m.size or not np.isfinite(distance_m).all():
        raise MotionError("a pose to be compared is missing or not finite; leave it out")
    return PoseDistance(float(distance_m.sum()), distance_m.size)
