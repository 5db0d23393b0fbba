"""Clips: recorded or computed motion of one skeleton at even times, and operations on them."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.interpolation import Interpolation
from visavis.stimuli.motion.key_kernels import path_rows
from visavis.stimuli.motion.rotations import continuous, mirrored_quat, unit_quats
from visavis.stimuli.motion.skeleton import Placement, Skeleton, forward
from visavis.stimuli.motion.slerp_kernels import slerp_segments


@dataclass(frozen=True, eq=False)
class Frames:
    """Poses of one skeleton at times of any shape.

    `root_m` (..., 3) in world, `orientation_wxyz` (..., n, 4) of every joint against its parent
    (the root's in world).
    """

    root_m: Vector
    orientation_wxyz: Vector


class Motion(Protocol):
    """Any motion of one skeleton as a pure function of time."""

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton whose joints turn."""
        ...

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape, in seconds from the motion's own zero."""
        ...


@dataclass(frozen=True, eq=False)
class Clip:
    """Poses every `frame_s` seconds, the first at zero; neighbours are joined by Slerp.

    `root_m` (frames, 3), `orientation_wxyz` (frames, n, 4). Before the first and after the last
    frame the pose rests. A `is_loop` clip has its first frame again one `frame_s` after its last,
    and each round starts `travel_m` (3,) further than the one before.
    """

    skeleton: Skeleton
    frame_s: float
    root_m: Vector
    orientation_wxyz: Vector
    is_loop: bool = False
    travel_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        n, joints = len(self.root_m), len(self.skeleton.names)
        if self.orientation_wxyz.shape != (n, joints, 4) or self.root_m.shape != (n, 3) or n == 0:
            raise MotionError(
                f"clip with roots {self.root_m.shape} and turns {self.orientation_wxyz.shape} "
                f"does not fit {joints} joints; give (frames, 3) and (frames, {joints}, 4)"
            )
        if not 0 < self.frame_s < np.inf:
            raise MotionError(f"clip with {self.frame_s} s between frames; give a time above 0")
        if not np.isfinite(self.root_m).all():
            row = int(np.argmin(np.isfinite(self.root_m).all(axis=1)))
            raise MotionError(f"root position of frame {row} is not a number; cut or repair it")
        turns = continuous(unit_quats(self.orientation_wxyz, "clip turns"))
        object.__setattr__(self, "orientation_wxyz", np.ascontiguousarray(turns))

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last frame, or of one round."""
        return self.frame_s * (len(self.root_m) if self.is_loop else len(self.root_m) - 1)

    @cached_property
    def frame_times_s(self) -> Vector:
        """Times of the frames, shape (frames,)."""
        return np.arange(len(self.root_m), dtype=np.float64) * self.frame_s

    @cached_property
    def _next_frames(self) -> tuple[Vector, Vector]:
        """The frame after each frame, in the hemisphere of the earlier; the last one rests."""
        last_root = self.root_m[0] + self.travel_m if self.is_loop else self.root_m[-1]
        last = self.orientation_wxyz[0] if self.is_loop else self.orientation_wxyz[-1]
        sign = np.where(np.sum(last * self.orientation_wxyz[-1], -1, keepdims=True) < 0, -1.0, 1.0)
        return (
            np.concatenate([self.root_m[1:], last_root[None]]),
            np.concatenate([self.orientation_wxyz[1:], (sign * last)[None]]),
        )

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        t = np.asarray(t_s, dtype=np.float64)
        if not np.isfinite(t).all():
            raise MotionError("asked for a pose at a time that is not a number; give finite times")
        place = t / self.frame_s
        rounds = np.zeros_like(place)
        if self.is_loop:
            rounds = np.floor(place / len(self.root_m))
            place = place - rounds * len(self.root_m)
        else:
            place = np.clip(place, 0.0, len(self.root_m) - 1.0)
        row = np.minimum(np.floor(place).astype(np.int64), len(self.root_m) - 1)
        h = place - row
        next_root, next_turn = self._next_frames
        turns = np.empty((row.size, *self.orientation_wxyz.shape[1:]))
        slerp_segments(self.orientation_wxyz, next_turn, row.ravel(), h.ravel(), turns)
        share = h[..., None]
        root = (1 - share) * self.root_m[row] + share * next_root[row]
        root += rounds[..., None] * np.asarray(self.travel_m)
        return Frames(root, turns.reshape(*t.shape, *turns.shape[1:]))


@dataclass(frozen=True, eq=False)
class KeyPoses:
    """Motion between key poses: turns by any interpolation, the root by Catmull-Rom or straight.

    `root_m` (k, 3) at the times of `turns`, whose keys have one joint axis of the skeleton's
    length. `smooth_root` belongs to Squad: the path then has a continuous velocity.
    """

    skeleton: Skeleton
    turns: Interpolation
    root_m: Vector
    smooth_root: bool = False

    def __post_init__(self) -> None:
        shape = (len(self.turns.times.t_s), 3)
        if self.root_m.shape != shape or not np.isfinite(self.root_m).all():
            raise MotionError(f"key roots must be finite, of shape {shape}")
        got = self.turns.in_segment(0, 0.0).shape
        if got != (len(self.skeleton.names), 4):
            raise MotionError(f"turns of shape {got} for {len(self.skeleton.names)} joints")

    @cached_property
    def _slopes(self) -> Vector:
        """Velocity of the root at every key, metres per second."""
        times = self.turns.times
        if times.is_closed:
            steps = np.roll(self.root_m, -1, axis=0) - self.root_m
            after = steps / times.segment_s[:, None]
            before = np.roll(after, 1, axis=0)
            lasts_before = np.roll(times.segment_s, 1)[:, None]
            lasts_after = times.segment_s[:, None]
            inner: Vector = (before * lasts_after + after * lasts_before) / (
                lasts_before + lasts_after
            )
            return inner
        speed = np.diff(self.root_m, axis=0) / times.segment_s[:, None]
        before, after = times.segment_s[:-1, None], times.segment_s[1:, None]
        between = (speed[:-1] * after + speed[1:] * before) / (before + after)
        return np.concatenate([speed[:1], between, speed[-1:]])

    def at(self, t_s: npt.ArrayLike) -> Frames:
        """Return the poses at times of any shape."""
        times = self.turns.times
        segment, h = times.locate(t_s)
        root = np.empty((*h.shape, 3))
        slopes = self._slopes if self.smooth_root else self.root_m
        path_rows(
            self.root_m,
            slopes,
            times.segment_s,
            self.smooth_root,
            segment.reshape(-1),
            h.reshape(-1),
            root.reshape(-1, 3),
        )
        return Frames(root, self.turns.in_segment(segment, h))


def placed_joints(motion: Motion, t_s: npt.ArrayLike) -> Placement:
    """Return where all joints of a motion stand in world."""
    frames = motion.at(t_s)
    return forward(motion.skeleton, frames.root_m, frames.orientation_wxyz)


def sample_clip(motion: Motion, start_s: float, frame_s: float, n_frames: int) -> Clip:
    """Return any motion as a clip of n frames from start_s on."""
    frames = motion.at(start_s + frame_s * np.arange(n_frames))
    return Clip(motion.skeleton, frame_s, frames.root_m, frames.orientation_wxyz)


def cut(clip: Clip, first: int, last: int) -> Clip:
    """Return frames `first` to `last` inclusive as an open clip."""
    if not 0 <= first <= last < len(clip.root_m):
        raise MotionError(f"frames {first} to {last} of a clip with {len(clip.root_m)}")
    rows = slice(first, last + 1)
    return Clip(clip.skeleton, clip.frame_s, clip.root_m[rows], clip.orientation_wxyz[rows])


def mirror_clip(clip: Clip) -> Clip:
    """Swap left and right: reflect across the plane x = 0 and exchange the sides' joints."""
    flip = np.array([-1.0, 1.0, 1.0])
    turns = mirrored_quat(clip.orientation_wxyz, "X")[:, clip.skeleton.mirror_index]
    x, y, z = clip.travel_m
    return replace(clip, root_m=clip.root_m * flip, orientation_wxyz=turns, travel_m=(-x, y, z))


def worn_by(clip: Clip, skeleton: Skeleton) -> Clip:
    """Give a clip to a person of another size: same turns, root scaled with the legs' length.

    Raises:
        MotionError: the joints are not the same.
    """
    if skeleton.names != clip.skeleton.names:
        raise MotionError("a clip fits only skeletons with the same joints; retarget it instead")
    scale = skeleton.leg_m / clip.skeleton.leg_m
    x, y, z = (scale * v for v in clip.travel_m)
    return replace(clip, skeleton=skeleton, root_m=scale * clip.root_m, travel_m=(x, y, z))


def standing_on_floor(clip: Clip, *, below_01: float = 0.1) -> Clip:
    """Shift a clip up or down so that its feet stand on the floor, y = 0.

    The lowest of ankles and toes, each against its own height at rest, is taken in every frame;
    the floor is where `below_01` of the frames lie lower: a pointed toe after a jump or a slip of
    the recording does not lift everything else.
    """
    placement = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz)
    joints = [clip.skeleton.index(f"{s}_{p}") for s in ("left", "right") for p in ("foot", "toes")]
    rest = clip.skeleton.rest_m[joints, 1] - floor_of_rest_m(clip.skeleton)
    lowest = (placement.position_m[:, joints, 1] - rest).min(axis=1)
    floor = float(np.quantile(lowest, below_01))
    return replace(clip, root_m=clip.root_m - np.array([0.0, floor, 0.0]))


def floor_of_rest_m(skeleton: Skeleton) -> float:
    """Return the height of the floor below the root of the canonical skeleton at rest, negative.

    The floor touches the lower end of the toes.
    """
    toes = skeleton.index("left_toes")
    tip = np.nan_to_num(skeleton.tips_m[toes, 1])
    return float(skeleton.rest_m[toes, 1] + min(tip, 0.0))


def standing(skeleton: Skeleton) -> Frames:
    """Return the pose at rest, a T-pose, with the feet on the floor at the origin."""
    turns = np.zeros((len(skeleton.names), 4))
    turns[:, 0] = 1.0
    return Frames(np.array([0.0, -floor_of_rest_m(skeleton), 0.0]), turns)
