"""Put motions together: weighted blends, cross-fades and inertial transitions without a pop."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply
from visavis.stimuli.motion.clip import Frames, Motion
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import (
    IDENTITY,
    continuous,
    quat_exp,
    quat_log,
    same_hemisphere,
    slerp_as_given,
    weighted_mean,
)
from visavis.stimuli.motion.skeleton import Skeleton

FADE_STEPS_HZ = 240.0
"""How densely a cross-fade follows the turn between its motions; they must turn less than 180°
against each other within one step."""
VELOCITY_STEP_S = 1e-4


def smootherstep(share: npt.ArrayLike) -> Vector:
    """Return a smooth rise from 0 to 1 with zero velocity and acceleration at both ends."""
    x = np.clip(np.asarray(share, dtype=np.float64), 0.0, 1.0)
    rise: Vector = x * x * x * (10.0 + x * (6.0 * x - 15.0))
    return rise


def _same_skeleton(motions: Sequence[Motion]) -> Skeleton:
    first = motions[0].skeleton
    for other in motions[1:]:
        if other.skeleton.names != first.names:
            raise MotionError("motions of different skeletons cannot be joined; retarget one first")
    return first


def blend_frames(frames: Sequence[Frames], weights: npt.ArrayLike) -> Frames:
    """Blend poses of one skeleton at the same times.

    `weights` (motions,) or (motions, times) are at least zero; they are divided by their sum. A
    weight of one gives that pose back.

    Raises:
        MotionError: a weight is negative or not finite, or all are zero.
    """
    w = np.asarray(weights, dtype=np.float64)
    if len(w) != len(frames) or not np.isfinite(w).all() or (w < 0).any():
        raise MotionError(f"{len(frames)} poses need as many weights of at least 0, got {w!s}")
    total = w.sum(axis=0)
    if (total <= 0).any():
        raise MotionError("all weights are zero; give one motion a weight")
    times = frames[0].root_m.shape[:-1]
    share = w / total
    if w.ndim == 1:
        share = share.reshape(-1, *[1] * len(times))
    share = np.broadcast_to(share, (len(w), *times))
    root = np.sum(share[..., None] * np.stack([f.root_m for f in frames]), axis=0)
    turns = np.stack([f.orientation_wxyz for f in frames])
    return Frames(root, weighted_mean(turns, np.broadcast_to(share[..., None], turns.shape[:-1])))


@dataclass(frozen=True, eq=False)
class CrossFade:
    """Pass from one motion to another while both go on.

    Until `start_s` it is `before`; then `after`, whose time starts at `after_start_s` when the
    fade does, takes over within `duration_s`. Each joint keeps turning the same way round, even
    where the motions come to lie 180° apart in the middle of the fade; a shorter-arc rule would
    jump there. Motions that turn by nearly 360° against each other during the fade swing fast;
    `InertialTransition` does not.
    """

    before: Motion
    after: Motion
    start_s: float
    duration_s: float
    after_start_s: float = 0.0

    def __post_init__(self) -> None:
        _same_skeleton((self.before, self.after))
        if not 0 < self.duration_s < np.inf:
            raise MotionError(f"cross-fade of {self.duration_s} s; give a time above 0")

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton whose joints turn."""
        return self.before.skeleton

    def _pair(self, since_s: Vector) -> tuple[Frames, Frames]:
        return (
            self.before.at(self.start_s + since_s),
            self.after.at(self.after_start_s + since_s),
        )

    @cached_property
    def _turns(self) -> tuple[float, Vector]:
        """The turn from before to after at even steps of the fade, followed without a flip."""
        n = int(np.ceil(self.duration_s * FADE_STEPS_HZ)) + 1
        step_s = self.duration_s / (n - 1)
        a, b = self._pair(np.linspace(0.0, self.duration_s, n))
        turn = quat_multiply(quat_conjugate(a.orientation_wxyz), b.orientation_wxyz)
        turn = continuous(turn)
        # Go the way round that is the shorter one on the whole, not only when the fade starts.
        way = np.where(turn[..., :1].sum(axis=0, keepdims=True) < 0, -1.0, 1.0)
        return step_s, way * turn

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        since = np.asarray(t_s, dtype=np.float64) - self.start_s
        a, b = self._pair(since)
        share = smootherstep(since / self.duration_s)
        step_s, turns = self._turns
        row = np.clip(np.round(since / step_s), 0, len(turns) - 1).astype(np.int64)
        turn = quat_multiply(quat_conjugate(a.orientation_wxyz), b.orientation_wxyz)
        turn = same_hemisphere(turn, turns[row])
        part = slerp_as_given(np.broadcast_to(IDENTITY, turn.shape), turn, share[..., None])
        root = (1 - share[..., None]) * a.root_m + share[..., None] * b.root_m
        return Frames(root, quat_multiply(a.orientation_wxyz, part))


@dataclass(frozen=True, eq=False)
class InertialTransition:
    """Switch to another motion at once and let the difference decay.

    At `at_s` the motion is that of `before` in place and velocity; from then on only `after` is
    played, plus an offset that vanishes within `duration_s`. It costs one motion, and nothing of
    `before` need exist beyond `at_s`.
    """

    before: Motion
    after: Motion
    at_s: float
    duration_s: float
    after_start_s: float = 0.0

    def __post_init__(self) -> None:
        _same_skeleton((self.before, self.after))
        if not 0 < self.duration_s < np.inf:
            raise MotionError(f"transition of {self.duration_s} s; give a time above 0")

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton whose joints turn."""
        return self.before.skeleton

    @cached_property
    def _offset(self) -> tuple[Vector, Vector, Vector, Vector]:
        """Offset and its velocity at the change: of the root, of the joints as half turns."""
        d = VELOCITY_STEP_S
        ahead = self.after.at(self.after_start_s + np.array([0.0, d]))
        past = self.before.at(self.at_s + np.array([-d, 0.0]))
        last = same_hemisphere(past.orientation_wxyz[0], past.orientation_wxyz[1])
        # Where `before` would be a moment later if it went on as it does.
        on = slerp_as_given(last, past.orientation_wxyz[1], np.full(last.shape[:-1], 2.0))
        past_turns = np.stack([past.orientation_wxyz[1], on])
        turn = quat_multiply(past_turns, quat_conjugate(ahead.orientation_wxyz))
        turn[0] = same_hemisphere(turn[0], IDENTITY)
        half = quat_log(continuous(turn))
        root_offset_m = (
            np.stack([past.root_m[1], 2 * past.root_m[1] - past.root_m[0]]) - ahead.root_m
        )
        return (
            root_offset_m[0],
            (root_offset_m[1] - root_offset_m[0]) / d,
            half[0],
            (half[1] - half[0]) / d,
        )

    def _fading(self, share: Vector, offset: Vector, velocity: Vector) -> Vector:
        """Return the offset at shares (...,) of the time: a quintic that ends at rest at zero."""
        x = share.reshape(*share.shape, *[1] * offset.ndim)
        rest = 1.0 - x
        still = rest**3 * (1 + 3 * x + 6 * x * x)
        moving = x * rest**3 * (1 + 3 * x)
        fading: Vector = still * offset + moving * velocity * self.duration_s
        return fading

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        since = np.asarray(t_s, dtype=np.float64) - self.at_s
        early = since < 0
        share = np.clip(since / self.duration_s, 0.0, 1.0)
        root, root_velocity, half, half_velocity = self._offset
        before = self.before.at(self.at_s + np.minimum(since, 0.0))
        after = self.after.at(self.after_start_s + np.maximum(since, 0.0))
        joint_turns = quat_multiply(
            quat_exp(self._fading(share, half, half_velocity)), after.orientation_wxyz
        )
        root_m = after.root_m + self._fading(share, root, root_velocity)
        return Frames(
            np.where(early[..., None], before.root_m, root_m),
            np.where(early[..., None, None], before.orientation_wxyz, joint_turns),
        )
