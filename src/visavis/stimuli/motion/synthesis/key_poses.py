"""Key poses of a clip: a few frames from which interpolation restores it well.

Keys are chosen greedily: beginning with first and last frame, the frame is added whose pose is
farthest from what Slerp between the keys so far gives (summed geodesic angle over the joints).
"""

from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip, KeyPoses
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.interpolation import (
    Interpolation,
    KeyTimes,
    LinEuler,
    Method,
    Slerp,
    interpolate,
)
from visavis.stimuli.motion.rotations import euler_from_quat

EULER_ORDER: Final = "ZXY"


def key_frames(clip: Clip, count: int) -> tuple[int, ...]:
    """Return the frames of the key poses, in order, chosen greedily: not the best there are.

    Raises:
        MotionError: fewer than two, or more than the clip has frames.
    """
    frames = len(clip.root_m)
    if not 2 <= count <= frames:
        raise MotionError(f"{count} key poses of a clip with {frames} frames; give 2 to {frames}")
    keys = [0, frames - 1]
    while len(keys) < count:
        error = summed_error_rad(clip, keys)
        error[keys] = -1.0
        keys = sorted([*keys, int(np.argmax(error))])
    return tuple(keys)


def summed_error_rad(clip: Clip, keys: list[int]) -> Vector:
    """Return the geodesic angle between a clip and Slerp between keys, summed over the joints.

    Shape (frames,), in radians.
    """
    times = KeyTimes(clip.frame_times_s[keys])
    between_keys = Slerp(times, clip.orientation_wxyz[keys]).at(clip.frame_times_s)
    same = np.sum(between_keys * clip.orientation_wxyz, axis=-1, keepdims=True)
    chord = np.linalg.norm(
        between_keys - np.where(same < 0, -1.0, 1.0) * clip.orientation_wxyz, axis=-1
    )
    return np.asarray((4.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0))).sum(axis=-1))


def continuous_euler_rad(clip: Clip, order: str = EULER_ORDER) -> Vector:
    """Return a clip's Euler angles (frames, joints, 3), without jumps from frame to frame.

    Curves as an animator's program draws them: angles taken pose by pose would jump by whole turns
    between keys, and their interpolation would whirl.
    """
    return np.unwrap(euler_from_quat(clip.orientation_wxyz, order), axis=0)


def between_keys(clip: Clip, keys: tuple[int, ...], method: Method) -> KeyPoses:
    """Return what a method makes of a clip's key poses, at their own times.

    The root moves straight from key to key; with Squad and Spline along a path of continuous
    velocity.
    """
    frames = list(keys)
    times = KeyTimes(clip.frame_times_s[frames])
    turns: Interpolation
    if method == "lineuler":
        turns = LinEuler(times, continuous_euler_rad(clip)[frames], EULER_ORDER)
    else:
        turns = interpolate(method, times, clip.orientation_wxyz[frames])
    smooth = method in ("squad", "spline")
    return KeyPoses(clip.skeleton, turns, clip.root_m[frames], smooth_root=smooth)
