"""Hybrid animation: a whole motion from two authored poses, or a few more midway between them.

Gaits pass through their poses and then through the poses' mirror images, round and round; an idle
person goes to and fro between them; somebody who crouches is drawn down by a spring, at first a
little beyond the last pose. Every increment puts one more pose midway between neighbours and keeps
the old ones. Source: a thesis of Blekinge Institute of Technology, 2017, which compares such
motion with playing every frame of the clips that the poses were taken from.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip, Frames, KeyPoses, Motion, mirror_clip, sample_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.interpolation import KeyTimes, Slerp, Squad
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.motion.spring import Spring

Controls: TypeAlias = Literal["shoemake", "neighbours"]
MIRRORED: Final = ("walk", "run")
"""Motions whose second half is the mirror image of the first."""
NAMES: Final = (*MIRRORED, "crouch", "idle")
MAX_INCREMENT: Final = 8


@dataclass(frozen=True)
class PoseCounts:
    """How many poses an increment takes: authored ones, all keys, and segments of a round.

    `kept` (authored poses without increment, mirrored ones included) tells at which keys they lie.
    """

    authored: int
    keys: int
    segments: int
    kept: tuple[int, ...]


def pose_counts(name: str, increment: int) -> PoseCounts:
    """Return the poses of a motion at an increment, 0 the plainest.

    Raises:
        MotionError: no such motion or increment.
    """
    if name not in NAMES:
        raise MotionError(f"no hybrid motion {name!r}; there are {', '.join(NAMES)}")
    if not 0 <= increment <= MAX_INCREMENT:
        raise MotionError(f"increment {increment}; give 0 to {MAX_INCREMENT}")
    step = 2**increment
    if name in MIRRORED:
        return PoseCounts(2 * step, 4 * step, 4 * step, tuple(range(0, 4 * step, step)))
    return PoseCounts(step + 1, step + 1, 2 * step, (0, step))


def authored_poses(name: str, source: Motion, begin_s: float, end_s: float, increment: int) -> Clip:
    """Return the poses that an increment takes from a motion, evenly between two times.

    A gait's poses lie from `begin_s` (one foot ahead) to before `end_s`, half a round later, where
    the mirror images begin; those of other motions from `begin_s` to `end_s` inclusive.
    """
    n = pose_counts(name, increment).authored
    step_s = (end_s - begin_s) / (n if name in MIRRORED else n - 1)
    if not step_s > 0:
        raise MotionError(f"poses of {name} from {begin_s} s to {end_s} s; let them end later")
    return sample_clip(source, begin_s, step_s, n)


def gait(poses: Clip, period_s: float, *, controls: Controls = "shoemake") -> KeyPoses:
    """Pass through poses and their mirror images, round after round of `period_s`.

    The poses stand in place: their roots' way ahead (z) is left out, so that every round is alike.
    """
    standing = poses.root_m * np.array([1.0, 1.0, 0.0])
    other = mirror_clip(poses)
    return _round(
        poses.skeleton,
        np.concatenate([poses.orientation_wxyz, other.orientation_wxyz]),
        np.concatenate([standing, standing * np.array([-1.0, 1.0, 1.0])]),
        period_s,
        controls,
    )


def to_and_fro(poses: Clip, period_s: float, *, controls: Controls = "shoemake") -> KeyPoses:
    """Go from the first pose through the others to the last, and back, in `period_s`."""
    n = len(poses.root_m)
    there_and_back = [*range(n), *range(n - 2, 0, -1)]
    return _round(
        poses.skeleton,
        poses.orientation_wxyz[there_and_back],
        poses.root_m[there_and_back],
        period_s,
        controls,
    )


def _round(
    skeleton: Skeleton, turns: Vector, roots: Vector, period_s: float, controls: Controls
) -> KeyPoses:
    times = KeyTimes(np.arange(len(turns)) * period_s / len(turns), period_s)
    return KeyPoses(skeleton, Squad(times, turns, controls=controls), roots, smooth_root=True)


@dataclass(frozen=True, eq=False)
class Sprung:
    """Drawn from the first pose to the last by a spring that lets go at zero; a `Motion`.

    From `back_s` on the way there is gone back in reverse, and so round after round. Beyond the
    last pose the last segment goes on, so that the spring's overshoot is seen.
    """

    poses: Clip
    spring: Spring = field(default_factory=Spring)
    back_s: float = np.inf

    def __post_init__(self) -> None:
        if len(self.poses.root_m) < 2:
            raise MotionError("a spring needs two poses to draw between; give at least two")
        if not self.back_s > 0:
            raise MotionError(f"back_s is {self.back_s}; the way back begins after the way there")

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton whose joints turn."""
        return self.poses.skeleton

    @cached_property
    def _between(self) -> KeyPoses:
        times = KeyTimes(np.linspace(0.0, 1.0, len(self.poses.root_m)), extrapolate=True)
        turns = Slerp(times, self.poses.orientation_wxyz)
        return KeyPoses(self.skeleton, turns, self.poses.root_m)

    def weight(self, t_s: npt.ArrayLike) -> Vector:
        """Return how far the way is gone: 0 the first pose, 1 the last, above 1 beyond it."""
        t = np.asarray(t_s, dtype=np.float64)
        if np.isfinite(self.back_s):
            t = self.back_s - np.abs(t % (2 * self.back_s) - self.back_s)
        there, _ = self.spring.at(np.maximum(t, 0.0))
        weight: Vector = 1.0 - there
        return weight

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        return self._between.at(self.weight(t_s))


def hybrid(
    name: str, poses: Clip, period_s: float, *, controls: Controls = "shoemake"
) -> KeyPoses | Sprung:
    """Return the hybrid motion of a name: walk, run, idle, crouch (down, then up at half a round).

    Raises:
        MotionError: no such motion.
    """
    pose_counts(name, 0)
    if name in MIRRORED:
        return gait(poses, period_s, controls=controls)
    if name == "idle":
        return to_and_fro(poses, period_s, controls=controls)
    return Sprung(poses, back_s=period_s / 2)
