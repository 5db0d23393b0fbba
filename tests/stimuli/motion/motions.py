"""Skeletons, clips and BVH texts for the motion tests."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tests.stimuli.motion.rotation_cases import random_quats
from visavis.lab.geometry import quat_multiply
from visavis.stimuli.motion.clip import Clip, Frames
from visavis.stimuli.motion.rotations import quat_exp
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton

CANONICAL = canonical_skeleton()


def wandering(
    rng: np.random.Generator,
    n_frames: int = 40,
    swing_deg: float = 50.0,
    skeleton: Skeleton = CANONICAL,
    rate_hz: float = 60.0,
) -> Clip:
    """Return smooth random motion of every joint about its rest, the root walking off."""
    t = np.arange(n_frames) / rate_hz
    joints = len(skeleton.names)
    speed = rng.uniform(0.3, 2.0, (joints, 3))
    phase = rng.uniform(0, 2 * np.pi, (joints, 3))
    half = np.radians(swing_deg) / 4 * np.sin(2 * np.pi * speed * t[:, None, None] + phase)
    root = np.stack([0.3 * np.sin(t), 0.95 + 0.05 * np.cos(3 * t), -1.2 * t], axis=-1)
    return Clip(skeleton, 1 / rate_hz, root, quat_exp(half))


@dataclass(frozen=True, eq=False)
class Spinning:
    """Every joint turns steadily about one axis: a motion in closed form."""

    skeleton: Skeleton
    axis: Any
    rate_deg_s: float
    start_deg: float = 0.0
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def at(self, t_s: npt.ArrayLike) -> Frames:
        t = np.asarray(t_s, dtype=np.float64)
        half = np.radians(self.start_deg + self.rate_deg_s * t) / 2
        axis = np.asarray(self.axis) / np.linalg.norm(self.axis)
        turn = quat_exp(half[..., None] * axis)
        joints = len(self.skeleton.names)
        return Frames(
            t[..., None] * np.asarray(self.velocity_m_s),
            np.repeat(turn[..., None, :], joints, axis=-2),
        )


def random_skeleton(rng: np.random.Generator, n: int) -> Skeleton:
    parents = np.array([-1, *(int(rng.integers(0, j)) for j in range(1, n))], dtype=np.int64)
    offsets = rng.normal(0, 0.3, (n, 3))
    offsets[0] = 0.0
    return Skeleton(tuple(f"j{i}" for i in range(n)), parents, offsets, np.full((n, 3), np.nan))


def random_clip(rng: np.random.Generator, n_joints: int, n_frames: int) -> Clip:
    skeleton = random_skeleton(rng, n_joints)
    step = quat_exp(rng.normal(0, 0.1, (n_frames, n_joints, 3)))
    turns = [random_quats(rng, n_joints)]
    for s in step[1:]:
        turns.append(quat_multiply(turns[-1], s))
    return Clip(skeleton, 0.01, rng.normal(size=(n_frames, 3)), np.stack(turns))


SMALL_BVH = """HIERARCHY
ROOT Hips
{
	OFFSET 0 0 0
	CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
	JOINT Chest
	{
		OFFSET 0 10.5 0
		CHANNELS 3 Yrotation Xrotation Zrotation
		End Site
		{
			OFFSET 0 5 0
		}
	}
	JOINT Leg
	{
		OFFSET 3 -1 0
		CHANNELS 1 Xrotation
	}
}
MOTION
Frames: 2
Frame Time: .0083333
1 90 3 10 20 30 1 2 3 4
1.5 91 3 -10 -20 -30 -1 -2 -3 -4
"""
