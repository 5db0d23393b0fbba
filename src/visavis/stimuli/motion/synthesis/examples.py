"""Example motions to blend: one cycle each, of one skeleton, with key moments all have in common.

What a page needs to blend them stands in `Examples` alone; the formulas are in `example_blend`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import continuous
from visavis.stimuli.motion.skeleton import Skeleton, forward

FEET: Final = ("left_foot", "left_toes", "right_foot", "right_toes")
"""Joints of ankle and ball, whose turns in world are blended besides those against the parent."""
WALK_KEYS: Final = ("left_down", "right_up", "right_down", "left_up")
"""Contacts that are the key moments of a walk: heels that land, toes that leave."""
HEEL_OF_STATURE: Final = 0.028
"""How far the heel lies behind the ankle, as a share of stature."""
MIN_EXAMPLES: Final = 3


@dataclass(frozen=True, eq=False)
class Examples:
    """n cyclic motions of one skeleton of J joints, their frames stacked one after another.

    `first` (n + 1,): example i has the frames `first[i]` to `first[i + 1] - 1` of `turns`
    (S, J, 4), rotations (w, x, y, z) against the parent, and `root_m` (S, 3); they are `frame_s`
    apart, the first at time 0. One `frame_s` after its last frame comes the first again, moved by
    `travel_m` (n, 3). `key_s` (n, K + 1) are the times of its key moments, the first 0, the last
    the end of its cycle. `heel_m` (3,) leads from an ankle to the heel's sole on an unturned foot.
    From the rest follow `foot_m` (S, 4, 3), the places of left heel, left ball (the joint of the
    toes), right heel and right ball, and `foot_turns` (S, 4, 4), the turns in world of `FEET`.
    """

    skeleton: Skeleton
    names: tuple[str, ...]
    frame_s: float
    first: npt.NDArray[np.int64]
    key_s: Vector
    travel_m: Vector
    turns: Vector
    root_m: Vector
    heel_m: Vector
    foot_m: Vector
    foot_turns: Vector

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the number of an example.

        Raises:
            MotionError: there is no such example.
        """
        if name not in self.names:
            raise MotionError(f"no example {name!r}; there are {', '.join(self.names)}")
        return self.names.index(name)

    @property
    def flat_phases(self) -> Vector:
        """Phases (2,) at which left and right foot stand flat: in a walk, where the other's toes
        leave; in motions with other key moments, at the beginning.
        """
        return np.array([1.0, 3.0] if is_walk(self) else [0.0, 0.0])

    @property
    def cycle_s(self) -> Vector:
        """How long each cycle takes (n,)."""
        last: Vector = self.key_s[:, -1]
        return last

    def clip(self, i: int) -> Clip:
        """Return an example as a looping clip."""
        rows = slice(int(self.first[i]), int(self.first[i + 1]))
        x, y, z = self.travel_m[i].tolist()
        return Clip(
            self.skeleton, self.frame_s, self.root_m[rows], self.turns[rows], True, (x, y, z)
        )

    @cached_property
    def tree(self) -> tuple[npt.NDArray[np.int64], Vector, npt.NDArray[np.int64], Vector, Vector]:
        """Parents, offsets, joints of `FEET` (4,), heel and flat phases, for the kernel."""
        skeleton = self.skeleton
        feet = np.array([skeleton.index(name) for name in FEET], dtype=np.int64)
        return skeleton.parents, skeleton.offsets_m, feet, self.heel_m, self.flat_phases


def is_walk(examples: Examples) -> bool:
    """Return whether the key moments of examples are the contacts of a walk (`WALK_KEYS`)."""
    return bool(examples.key_s.shape[1] == len(WALK_KEYS) + 1)


def heel_of(skeleton: Skeleton) -> Vector:
    """Return where the heel's sole lies from the ankle, estimated from toes and stature."""
    toes, head = skeleton.index("left_toes"), skeleton.index("head")
    sole_y = skeleton.rest_m[toes, 1] + min(0.0, float(np.nan_to_num(skeleton.tips_m[toes, 1])))
    crown_y = skeleton.rest_m[head, 1] + float(np.nan_to_num(skeleton.tips_m[head, 1], nan=0.2))
    ankle_m = float(skeleton.rest_m[skeleton.index("left_foot"), 1] - sole_y)
    return np.array([0.0, -ankle_m, HEEL_OF_STATURE * (crown_y - sole_y)])


def examples_of_clips(
    names: Sequence[str], clips: Sequence[Clip], key_s: Vector, heel_m: Vector | None = None
) -> Examples:
    """Return looping clips of one skeleton and frame rate as examples, with `key_s` (n, K + 1).

    Without `heel_m` it is estimated from the skeleton.

    Raises:
        MotionError: fewer than three examples, or one that does not fit the others, by its name.
    """
    if len(names) != len(clips) or len(names) != len(key_s):
        raise MotionError(f"{len(names)} names and {len(key_s)} rows of keys of {len(clips)} clips")
    if len(clips) < MIN_EXAMPLES:
        raise MotionError(
            f"{len(clips)} examples cannot be blended by parameters; give at least {MIN_EXAMPLES}"
        )
    twice = next((name for name in names if list(names).count(name) > 1), None)
    if twice is not None:
        raise MotionError(f"two examples are called {twice!r}; rename one")
    skeleton, frame_s = clips[0].skeleton, clips[0].frame_s
    for name, clip, keys in zip(names, clips, key_s, strict=True):
        _check(name, clip, keys, skeleton, frame_s, names[0])
    turns = np.concatenate([continuous(clip.orientation_wxyz) for clip in clips])
    root = np.concatenate([clip.root_m for clip in clips])
    body = forward(skeleton, root, turns)
    feet = [skeleton.index(name) for name in FEET]
    foot_turns = np.ascontiguousarray(body.orientation_wxyz[:, feet])
    foot_m = np.ascontiguousarray(body.position_m[:, feet])
    heel = heel_of(skeleton) if heel_m is None else heel_m
    foot_m[:, ::2] += rotate(foot_turns[:, ::2], np.broadcast_to(heel, foot_m[:, ::2].shape))
    return Examples(
        skeleton,
        tuple(names),
        frame_s,
        np.concatenate([[0], np.cumsum([len(clip.root_m) for clip in clips])]).astype(np.int64),
        np.ascontiguousarray(key_s, dtype=np.float64),
        np.array([clip.travel_m for clip in clips], dtype=np.float64),
        np.ascontiguousarray(turns),
        np.ascontiguousarray(root),
        heel,
        foot_m,
        foot_turns,
    )


def _check(
    name: str, clip: Clip, keys: Vector, skeleton: Skeleton, frame_s: float, other: str
) -> None:
    if clip.skeleton.names != skeleton.names or not np.allclose(
        clip.skeleton.offsets_m, skeleton.offsets_m, atol=1e-6
    ):
        raise MotionError(
            f"the skeleton of example {name!r} is not that of {other!r}; bring them to one "
            "skeleton first"
        )
    if clip.frame_s != frame_s:
        raise MotionError(f"example {name!r} has another frame rate than {other!r}; resample it")
    if not clip.is_loop:
        raise MotionError(f"example {name!r} does not loop; cut one whole cycle")
    if (
        len(keys) < 2
        or not np.isfinite(keys).all()
        or not (np.diff(keys) > 0).all()
        or keys[0] != 0.0
        or abs(keys[-1] - clip.duration_s) > 1e-9
    ):
        raise MotionError(
            f"key times of example {name!r} are {np.round(keys, 3).tolist()} in a cycle of "
            f"{clip.duration_s:.3f} s; give growing times from 0 to its end"
        )
