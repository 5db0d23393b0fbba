"""How fast and how jerkily joints turn, to hold a warped motion against its original."""

from dataclasses import dataclass

import numpy as np

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.rotations import quat_log


@dataclass(frozen=True)
class PeakTurning:
    """The largest of any joint at any moment; joints are turned in their parents' frames."""

    speed_deg_s: float
    acceleration_deg_s2: float
    jerk_deg_s3: float


def peak_turning(clip: Clip, joints: tuple[str, ...] | None = None) -> PeakTurning:
    """Measure a clip frame by frame, over all joints or those named.

    Angular velocity is the turn from frame to frame over its time, in the frame of the later one's
    parent; acceleration and jerk are its differences. An open clip's ends count as they are.

    Raises:
        MotionError: the clip has fewer than four frames, or lacks a joint.
    """
    names = clip.skeleton.names
    if joints is not None and not set(joints) <= set(names):
        raise MotionError(f"the clip has no joints {sorted(set(joints) - set(names))}")
    joint_numbers = [k for k, n in enumerate(names) if joints is None or n in joints]
    turns = clip.orientation_wxyz[:, joint_numbers]
    if len(turns) < 4:
        raise MotionError(f"jerk takes four frames; the clip has {len(turns)}")
    if clip.is_loop:
        turns = np.concatenate([turns, turns[:3]])
    between = quat_multiply(turns[1:], quat_conjugate(turns[:-1]))
    between = np.where(between[..., :1] < 0, -between, between)
    rate_hz = 1.0 / clip.frame_s
    velocity = np.degrees(2.0 * quat_log(between)) * rate_hz
    acceleration = np.diff(velocity, axis=0) * rate_hz
    return PeakTurning(
        _largest(velocity),
        _largest(acceleration),
        _largest(np.diff(acceleration, axis=0) * rate_hz),
    )


def _largest(vectors: Vector) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))
