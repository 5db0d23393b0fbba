"""How far one motion is from another, joint by joint, at times aligned by their key times.

Source: a study in which people match a target walk by sliders; a match is a mean below 0.06 m.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton, forward
from visavis.stimuli.motion.synthesis.example_blend import blend_at
from visavis.stimuli.motion.synthesis.examples import Examples

MATCH_M: Final = 0.06
"""Below this mean distance two motions match, as the source's success does."""
POSES: Final = 10
"""Moments of a cycle at which motions are compared, as in the source."""
LEFT_OUT: Final = ("thumb", "index", "middle", "ring", "little", "eye", "jaw", "chest")
"""Joints that say nothing of a motion; without them 20 of our bodies' are left, as in the source.
"""


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


def compared_joints(skeleton: Skeleton) -> tuple[int, ...]:
    """Return the numbers of the joints that are compared."""
    return tuple(j for j, n in enumerate(skeleton.names) if not any(w in n for w in LEFT_OUT))


def aligned_places(
    examples: Examples, weights: Vector, poses: int, joints: Sequence[int]
) -> Vector:
    """Return where joints of a blend are (poses, joints, 3) at so many moments of its cycle.

    Moments are evenly spaced in key moments from the cycle's begin; the figure walks in place. A
    page compares the same places (`site/live.js`).
    """
    keys = examples.key_s.shape[1] - 1
    phases = keys * np.arange(poses) / poses
    frames = blend_at(examples, weights, phases)
    key_s = weights @ examples.key_s
    share = np.interp(phases, np.arange(keys + 1.0), key_s) / key_s[-1]
    root = frames.root_m - share[:, None] * (weights @ examples.travel_m)
    body = forward(examples.skeleton, root, frames.orientation_wxyz)
    places: Vector = body.position_m[:, list(joints)]
    return places


@dataclass(frozen=True, eq=False)
class Likeness:
    """How far blends of examples are from a target, both given by weights (n,).

    Over `poses` moments and the `joints` by number (`aligned_places`).
    """

    examples: Examples
    target: Vector
    poses: int
    joints: tuple[int, ...]

    @cached_property
    def target_m(self) -> Vector:
        """The target's places (poses, joints, 3)."""
        return aligned_places(self.examples, self.target, self.poses, self.joints)

    @cached_property
    def _example_places(self) -> Vector:
        return _places_of_examples(self.examples, self.poses, self.joints)

    def exact_m(self, weights: Vector) -> float:
        """Return the mean distance of joints in metres, as a page measures it."""
        made = aligned_places(self.examples, weights, self.poses, self.joints)
        return pose_distance(self.target_m, made).mean_m

    def rough_m(self, weights: Vector) -> float:
        """Return about the same, a hundred times as fast: places are blended instead of turns."""
        apart = (weights @ self._example_places).reshape(-1, 3) - self.target_m.reshape(-1, 3)
        return float(np.sqrt(np.einsum("ij,ij->i", apart, apart)).mean())


@lru_cache(maxsize=16)
def _places_of_examples(examples: Examples, poses: int, joints: tuple[int, ...]) -> Vector:
    own = np.eye(len(examples))
    rows = [aligned_places(examples, weights, poses, joints).ravel() for weights in own]
    return np.array(rows)
