"""What simulated viewers see of a speaker's body, and how natural that looks to them.

They see how the hips move and whether feet slide; nothing tells them how a clip was made.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Motion, placed_joints

EYES_HZ: Final = 30.0
STILL_MPS: Final = 0.012
STILL_RADPS: Final = float(np.radians(2.5))
"""Hips that move and turn by less stand still."""
FAST_01: Final = 0.99

# On the scale of ratings (−2 to 2), fitted so that mean ratings are those printed
# (benchmarks.speaking_viewers).
LEVEL: Final = 1.892
STILLNESS: Final = 2.583
ENGAGEMENT: Final = 0.05
KINKS: Final = 0.05
"""For each metre per second squared of the hips' sharpest accelerations."""
SLIDING: Final = 0.5
"""For each centimetre per second of feet on the floor."""


@dataclass(frozen=True)
class Looks:
    """Visible properties of a body: `still_01` share of time in which the hips stand still,
    `shift_mps` and `turn_radps` root mean square speeds of the hips, `kink_mps2` their sharpest
    accelerations, `sliding_cmps` the mean speed of both feet.
    """

    still_01: float
    shift_mps: float
    turn_radps: float
    kink_mps2: float
    sliding_cmps: float

    @property
    def engagement(self) -> float:
        """Movement of weight and hips together."""
        return self.shift_mps / 0.06 + self.turn_radps / 0.25

    @property
    def naturalness(self) -> float:
        """What viewers feel on average."""
        return (
            LEVEL
            - STILLNESS * self.still_01
            + ENGAGEMENT * min(self.engagement, 3.0)
            - KINKS * self.kink_mps2
            - SLIDING * self.sliding_cmps
        )


@lru_cache(maxsize=256)
def looks_of(motion: Motion, seconds: float) -> Looks:
    """Return what is seen of a motion for so long."""
    t_s = np.arange(0.0, seconds, 1.0 / EYES_HZ)
    joints = placed_joints(motion, t_s)
    skeleton = motion.skeleton
    at = joints.position_m
    hips = at[:, 0, [0, 2]]
    across = at[:, skeleton.index("right_upper_leg")] - at[:, skeleton.index("left_upper_leg")]
    yaw = np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))
    velocity = np.diff(hips, axis=0) * EYES_HZ
    speed, turn = np.linalg.norm(velocity, axis=1), np.abs(np.diff(yaw)) * EYES_HZ
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1) * EYES_HZ
    feet = at[:, [skeleton.index(f"{side}_foot") for side in ("left", "right")]]
    slides = np.linalg.norm(np.diff(feet, axis=0), axis=-1) * EYES_HZ
    return Looks(
        still_01=float(((speed < STILL_MPS) & (turn < STILL_RADPS)).mean()),
        shift_mps=_rms(speed),
        turn_radps=_rms(turn),
        kink_mps2=float(np.quantile(change, FAST_01)),
        sliding_cmps=100 * float(slides.mean()),
    )


def _rms(values: Vector) -> float:
    return float(np.sqrt((values**2).mean()))
