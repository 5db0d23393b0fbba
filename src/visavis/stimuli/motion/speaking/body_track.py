"""What a speaker's lower body does: where its weight is, where the hips point, feet that step.

Measured from a recorded motion, relative to where the feet are and point, in sizes that another
body can take over.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip, sample_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Placement, Skeleton, forward

RATE_HZ: Final = 30.0
"""Frames a second of everything that is learnt from a speaker and planned for one."""
CUTOFF_HZ: Final = 6.0
"""Zero-phase Butterworth filter of fourth order that takes small jerks out of a recording."""
STEPPING_MPS: Final = 0.20
"""A foot that moves faster over the floor is not planted."""
MIN_STANCE_M: Final = 0.05
MAX_STANCE_M: Final = 0.9

_SEGMENTS: Final = (
    ("hips", "neck", 0.497, 0.50),
    ("neck", "head", 0.081, 1.00),
    *(
        (f"{side}_{one}", f"{side}_{other}", mass, along)
        for side in ("left", "right")
        for one, other, mass, along in (
            ("upper_arm", "lower_arm", 0.028, 0.436),
            ("lower_arm", "hand", 0.016, 0.430),
            ("hand", "middle_proximal", 0.006, 0.506),
            ("upper_leg", "lower_leg", 0.100, 0.433),
            ("lower_leg", "foot", 0.0465, 0.433),
            ("foot", "toes", 0.0145, 0.50),
        )
    ),
)
"""Joints at both ends of a segment, its share of the body's mass, and where along it its centre
lies (Winter 2009, table 4.1).
"""
X, Y, Z, YAW, LEAN, ROLL = range(6)
"""Columns of `BodyTrack.hips`."""


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """n frames at `RATE_HZ`.

    `com` (n,) is how far the centre of mass is to the right of the middle between the feet, in
    widths of the stance; `trunk_yaw` (n,) how far the shoulders are turned to the left of the hips
    (rad). `hips` (n, 6): x as `com`; y and z in lengths of the leg, above the ankles and behind
    the middle of the feet; yaw to the left, lean forward, roll to the right (rad). `steps` (n,):
    a foot moves.
    """

    com: Vector
    trunk_yaw: Vector
    hips: Vector
    steps: npt.NDArray[np.bool_]

    @property
    def yaw(self) -> Vector:
        """Where the hips point, to the left of where the feet do, radians (n,)."""
        column: Vector = self.hips[:, YAW]
        return column


def centre_of_mass(skeleton: Skeleton, placed: Placement) -> Vector:
    """Return the centre of mass (..., 3) of a body whose joints are placed."""
    at = placed.position_m
    total = np.zeros((*at.shape[:-2], 3))
    for one, other, mass, along in _SEGMENTS:
        a, b = at[..., skeleton.index(one), :], at[..., skeleton.index(other), :]
        total += mass * ((1 - along) * a + along * b)
    centre: Vector = total / sum(mass for _, _, mass, _ in _SEGMENTS)
    return centre


def measure_body(clip: Clip, name: str) -> BodyTrack:
    """Return what the lower body of a recorded speaker does; `name` appears in messages.

    Raises:
        MotionError: the clip is shorter than a second, or the speaker does not stand.
    """
    if clip.duration_s < 1.0:
        raise MotionError(f"{name} lasts {clip.duration_s:.2f} s; give at least a second of speech")
    n = int(np.floor(clip.duration_s * RATE_HZ + 1e-9)) + 1
    clip = sample_clip(clip, 0.0, 1.0 / RATE_HZ, n)
    skeleton = clip.skeleton
    placed = forward(skeleton, clip.root_m, clip.orientation_wxyz)

    # Yaw of hips and shoulders from the ways to the right; the front is where both feet point.
    def across(one: str, other: str) -> Vector:
        way: Vector = (
            placed.position_m[:, skeleton.index(other)] - placed.position_m[:, skeleton.index(one)]
        )
        return way

    def yaw_of(way: Vector) -> Vector:
        angle: Vector = np.unwrap(np.arctan2(-way[:, 2], way[:, 0]))
        return angle

    hip_way = across("left_upper_leg", "right_upper_leg")
    hips_yaw = yaw_of(hip_way)
    front = _front(skeleton, placed)
    # The nearer way round, so that hips are turned by little.
    hips_yaw = hips_yaw - 2 * np.pi * np.round((np.median(hips_yaw) - front) / (2 * np.pi))
    shoulders_yaw = yaw_of(across("left_upper_arm", "right_upper_arm"))
    right = np.array([np.cos(front), 0.0, -np.sin(front)])
    behind = np.array([np.sin(front), 0.0, np.cos(front)])

    ankles = [placed.position_m[:, skeleton.index(f"{side}_foot")] for side in ("left", "right")]
    middle = (ankles[0] + ankles[1]) / 2
    width_m = (ankles[1] - ankles[0]) @ right
    stance_m = float(np.median(width_m))
    if not MIN_STANCE_M <= stance_m <= MAX_STANCE_M:
        raise MotionError(
            f"{name}: the feet are {stance_m:.2f} m apart to the sides; give the motion of "
            "somebody who stands, in metres (--unit-m says what a BVH file's unit is)"
        )
    at = placed.position_m[:, 0] - middle
    # Lean and roll in the hips' own turn; the hips' roll from the line between the hip joints.
    turn = placed.orientation_wxyz[:, 0]
    up = _rotated_up(turn)
    ahead = np.stack([-np.sin(hips_yaw), np.zeros(n), -np.cos(hips_yaw)], axis=1)
    lean = np.arctan2((up * ahead).sum(axis=1), up[:, 1])
    roll = -np.arcsin(np.clip(hip_way[:, 1] / np.linalg.norm(hip_way, axis=1), -1.0, 1.0))
    hips = np.stack(
        [
            (at @ right) / stance_m,
            at[:, 1] / skeleton.leg_m,
            (at @ behind) / skeleton.leg_m,
            hips_yaw - front,
            lean,
            roll,
        ],
        axis=1,
    )
    com = (centre_of_mass(skeleton, placed) - middle) @ right / stance_m
    # The difference of the shoulders' turn and the hips', the nearer way round.
    trunk = np.mod(shoulders_yaw - hips_yaw + np.pi, 2 * np.pi) - np.pi
    speed = np.max(
        [np.linalg.norm(np.gradient(a[:, [0, 2]], axis=0), axis=1) * RATE_HZ for a in ankles],
        axis=0,
    )
    return BodyTrack(smooth(com), smooth(trunk), smooth(hips), speed > STEPPING_MPS)


def _front(skeleton: Skeleton, placed: Placement) -> float:
    """Return the middle of where both feet point, most of the time, left of −z in radians."""
    ways = []
    for side in ("left", "right"):
        foot, toes = (skeleton.index(f"{side}_{joint}") for joint in ("foot", "toes"))
        way = (placed.position_m[:, toes] - placed.position_m[:, foot])[:, [0, 2]]
        ways.append(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9))
    x, z = np.median(ways[0] + ways[1], axis=0)
    return float(np.arctan2(-x, -z))


def smooth(values: Vector) -> Vector:
    """Return values (n, ...) without what is faster than `CUTOFF_HZ`, none of it delayed."""
    sections = butter(4, CUTOFF_HZ, fs=RATE_HZ, output="sos")
    filtered: Vector = sosfiltfilt(sections, values, axis=0, padlen=min(15, len(values) - 1))
    return filtered


def _rotated_up(turn: Vector) -> Vector:
    """Return where the y axis points after turns (n, 4)."""
    w, x, y, z = np.moveaxis(turn, -1, 0)
    return np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
