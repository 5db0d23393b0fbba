"""Four gestures as motions of ours, and what three methods make of four of their poses.

Arms are drawn by where upper arm and forearm point (unit vectors of the trunk: x to the right, y
up, −z ahead) at a few moments; between them they move smoothly and come to rest at both ends.
"""

from functools import cache
from typing import Final

import numpy as np
from scipy.interpolate import PchipInterpolator

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply, unit
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.clip import Clip, KeyPoses
from visavis.stimuli.motion.interpolation import Method
from visavis.stimuli.motion.kinds import Idle
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.rotations import quat_between
from visavis.stimuli.motion.synthesis.key_poses import between_keys, key_frames

CHARACTER: Final = "male_02"
RATE_HZ: Final = 60.0
KEYS: Final = 4
HOLD_S: Final = 0.4
"""How long the last pose is held before a film begins again, the same for every method."""
STILL_S: Final = 0.2
Vec = tuple[float, float, float]
Moment = tuple[float, Vec, Vec, Vec, Vec, float]
"""Time, right upper arm and forearm, left upper arm and forearm, turn of the trunk to the left."""
DOWN: Final[tuple[Vec, Vec]] = ((0.20, -0.97, 0.05), (0.12, -0.96, -0.24))


def _mirror(arm: tuple[Vec, Vec]) -> tuple[Vec, Vec]:
    (ux, uy, uz), (fx, fy, fz) = arm
    return (-ux, uy, uz), (-fx, fy, fz)


def _one(t_s: float, upper: Vec, fore: Vec, turn_deg: float = 0.0) -> Moment:
    return (t_s, upper, fore, *_mirror(DOWN), turn_deg)


def _both(t_s: float, upper: Vec, fore: Vec) -> Moment:
    return (t_s, upper, fore, *_mirror((upper, fore)), 0.0)


GESTURES: Final[dict[str, tuple[Moment, ...]]] = {
    "metaphoric": (
        _one(0.0, *DOWN),
        _one(0.55, (0.78, -0.10, 0.62), (0.30, 0.92, 0.25), -22.0),
        _one(0.95, (0.30, -0.02, -0.95), (0.05, 0.05, -1.0), 14.0),
        _one(1.25, (0.05, -0.60, -0.80), (-0.45, -0.45, -0.77), 18.0),
        _one(2.0, *DOWN),
    ),
    "iconic": (
        _both(0.0, *DOWN),
        _both(0.65, (0.35, -0.80, -0.48), (-0.40, 0.20, -0.89)),
        _both(1.2, (0.78, -0.48, -0.40), (0.55, 0.25, -0.80)),
        _both(1.65, (0.75, -0.52, -0.40), (0.50, 0.20, -0.84)),
        _both(2.4, *DOWN),
    ),
    "deictic": (
        _one(0.0, *DOWN),
        _one(0.55, (0.35, -0.25, -0.90), (0.10, 0.75, -0.65)),
        _one(0.95, (0.30, 0.82, -0.48), (0.12, 0.95, -0.28)),
        _one(1.4, (0.28, 0.84, -0.46), (0.10, 0.96, -0.26)),
        _one(2.0, *DOWN),
    ),
    "beat": (
        _both(0.0, *DOWN),
        _both(0.45, (0.22, -0.72, -0.66), (0.02, 0.45, -0.89)),
        _both(0.75, (0.18, -0.82, -0.54), (0.0, -0.25, -0.97)),
        _both(1.0, (0.20, -0.76, -0.62), (0.02, 0.25, -0.97)),
        _both(1.6, *DOWN),
    ),
}
METHODS: Final[tuple[Method, ...]] = ("lineuler", "slerp", "squad")


def seconds_of(gesture: str) -> float:
    """Return how long a film of a gesture is: the motion, and its last pose held."""
    return GESTURES[gesture][-1][0] + HOLD_S


@cache
def source_of(gesture: str) -> Clip:
    """Return a gesture as drawn, sixty poses a second."""
    build = build_of(default_casting(CHARACTER))
    standing = bake(Person(build, Idle("hanging", 0.0), seed=3), 1.0, rate_hz=RATE_HZ)
    moments = GESTURES[gesture]
    frames = round(moments[-1][0] * RATE_HZ) + 1
    t_s = np.arange(frames) / RATE_HZ
    turns = np.repeat(standing.orientation_wxyz[:1], frames, axis=0)
    skeleton = standing.skeleton
    # Half of the turn in the spine, half in the chest.
    each_rad = np.radians(_smooth(moments, 5, t_s)[:, 0]) / 2
    none = np.zeros_like(each_rad)
    half = np.stack([np.cos(each_rad / 2), none, np.sin(each_rad / 2), none], axis=-1)
    for joint in ("spine", "chest"):
        i = skeleton.index(joint)
        turns[:, i] = quat_multiply(turns[:, i], half)
    for side, place, out in (("right", 1, 1.0), ("left", 3, -1.0)):
        rest = np.array([out, 0.0, 0.0])
        shoulder = turns[:, skeleton.index(f"{side}_shoulder")]
        upper = quat_between(rest, unit(_smooth(moments, place, t_s)))
        fore = quat_between(rest, unit(_smooth(moments, place + 1, t_s)))
        turns[:, skeleton.index(f"{side}_upper_arm")] = quat_multiply(
            quat_conjugate(shoulder), upper
        )
        turns[:, skeleton.index(f"{side}_lower_arm")] = quat_multiply(quat_conjugate(upper), fore)
        i = skeleton.index(f"{side}_hand")
        turns[:, i] = np.array([1.0, 0.0, 0.0, 0.0])
    roots = np.repeat(standing.root_m[:1], frames, axis=0)
    return Clip(skeleton, 1.0 / RATE_HZ, roots, turns)


@cache
def keys_of(gesture: str) -> tuple[int, ...]:
    """Return the frames of a gesture's key poses, the same for every method."""
    return key_frames(source_of(gesture), KEYS)


@cache
def motion_of(gesture: str, method: Method) -> KeyPoses:
    """Return what a method makes of a gesture's key poses."""
    return between_keys(source_of(gesture), keys_of(gesture), method)


def _smooth(moments: tuple[Moment, ...], place: int, t_s: Vector) -> Vector:
    """Interpolate one entry of the moments smoothly, at rest at both ends."""
    values = np.array([np.atleast_1d(m[place]) for m in moments], dtype=np.float64)
    at_s = np.array([m[0] for m in moments])
    at_s = np.concatenate([[at_s[0] - STILL_S], at_s, [at_s[-1] + STILL_S]])
    values = np.concatenate([values[:1], values, values[-1:]])
    smooth: Vector = PchipInterpolator(at_s, values)(t_s)
    return smooth
