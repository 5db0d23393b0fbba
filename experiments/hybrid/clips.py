"""Four motions of ours as clips played frame by frame, and as hybrids of a few of their poses.

The source's own clips had flaws that its results rest on; they are parameters here: `limp` lowers
one half of every round of the run, as a run cut from a transition, and `excess_hips` swings the
hips of the walk further on the left.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.build import Build
from visavis.stimuli.motion.clip import Clip, KeyPoses, Motion, placed_joints, sample_clip
from visavis.stimuli.motion.gait_kernels import step_m
from visavis.stimuli.motion.kinds import Crouch, Idle, Kind, Run, Walk
from visavis.stimuli.motion.people import Doing, Person
from visavis.stimuli.motion.synthesis.hybrid import Controls, Sprung, authored_poses, hybrid

CHARACTER: Final = "male_02"
CLIPS: Final = ("walk", "run", "crouch", "idle")
SOURCE_HZ: Final = 120.0
PLAYED_HZ: Final = 30.0
BEGIN_S: Final = 3.0
"""When a gait is under way."""
IDLE_S: Final = 4.0
CROUCH_S: Final = 2.4
DIP_M: Final = 0.05
"""How far a full limp lowers the hips in the middle of its half of a round."""
SWING: Final = 1.0
"""How much further a full excess swings the hips on the left: twice as far."""


@dataclass(frozen=True)
class Flaws:
    """Flaws of the source's clips: 0 for none, 1 for as much as there."""

    limp: float = 1.0
    excess_hips: float = 1.0


def _build() -> Build:
    return build_of(default_casting(CHARACTER))


@cache
def _source(name: str) -> Clip:
    """Return a motion of ours, finely sampled."""
    build = _build()
    if name == "crouch":
        plan = (
            Doing(Idle("hanging", 0.0)),
            Doing(Crouch(0.8, 0.0), 0.2, 0.7),
            Doing(Idle("hanging", 0.0), 1.3, 0.7),
        )
        return bake(Person(build, plan, 1), CROUCH_S, rate_hz=SOURCE_HZ)
    kinds: dict[str, Kind] = {
        "walk": Walk(1.3, stride_cv=0.0),
        "run": Run(3.0),
        "idle": Idle("hanging"),
    }
    kind = kinds[name]
    return bake(Person(build, kind, 1), BEGIN_S + 5.0, rate_hz=SOURCE_HZ)


def period_s(name: str) -> float:
    """Return how long a round of a motion takes."""
    if name in ("walk", "run"):
        speed_mps = {"walk": 1.3, "run": 3.0}[name]
        leg_m = _build().skeleton.leg_m
        return 2.0 * step_m(speed_mps, leg_m, np.inf, name == "run") / speed_mps
    return CROUCH_S if name == "crouch" else IDLE_S


@cache
def begin_s(name: str) -> float:
    """Return when a round begins: with the left foot farthest ahead in a gait."""
    if name not in ("walk", "run"):
        return 0.0 if name == "crouch" else BEGIN_S
    clip = _source(name)
    t_s = BEGIN_S + np.arange(0.0, period_s(name), 1.0 / SOURCE_HZ)
    joints_m = placed_joints(clip, t_s).position_m
    ahead = joints_m[:, clip.skeleton.index("left_foot"), 2] - joints_m[:, 0, 2]
    return float(t_s[int(np.argmin(ahead))])


@cache
def key_frame_clip(name: str, flaws: Flaws) -> Clip:
    """Return a motion as a clip in place, played frame by frame, with the source's flaws."""
    round_s = period_s(name)
    frames = round(round_s * PLAYED_HZ)
    cut = sample_clip(_source(name), begin_s(name), round_s / frames, frames)
    share = np.arange(frames) / frames
    root = _in_place(cut.root_m, name)
    if name == "run":  # in the half of which no poses are taken: a hybrid mirrors the other
        root[:, 1] -= flaws.limp * DIP_M * np.where(share >= 0.5, np.sin(2 * np.pi * share) ** 2, 0)
    if name == "walk":
        root[:, 0] += flaws.excess_hips * SWING * np.where(root[:, 0] < 0, root[:, 0], 0.0)
    return replace(cut, root_m=root, is_loop=True)


@cache
def hybrid_clip(name: str, increment: int, controls: Controls, flaws: Flaws) -> KeyPoses | Sprung:
    """Return the hybrid of a motion, from poses of the clip as it is played."""
    round_s = period_s(name)
    clip = key_frame_clip(name, flaws)
    if name == "crouch":
        down = sample_clip(clip, 0.0, clip.frame_s, len(clip.root_m) // 2)
        lowest = float(np.argmin(down.root_m[:, 1])) * clip.frame_s
        return hybrid(
            name, authored_poses(name, clip, 0.0, lowest, increment), round_s, controls=controls
        )
    return hybrid(
        name, authored_poses(name, clip, 0.0, round_s / 2, increment), round_s, controls=controls
    )


def motion_of(name: str, increment: int | None, controls: Controls, flaws: Flaws) -> Motion:
    """Return a clip played frame by frame (increment None), or its hybrid."""
    if increment is None:
        return key_frame_clip(name, flaws)
    return hybrid_clip(name, increment, controls, flaws)


def _in_place(root_m: Vector, name: str) -> Vector:
    """Return roots without the way ahead, so that every round is alike."""
    root: Vector = root_m.copy()
    if name in ("walk", "run"):
        root[:, 2] = 0.0
        root[:, 0] -= root[:, 0].mean()
    return root
