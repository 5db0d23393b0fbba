"""Perform a gesture script: planned lower body, turning spine and arms as one motion."""

from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.build import Build
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.posture_kernels import pose_rows
from visavis.stimuli.motion.speaking.body_plan import Fill, plan_body, trunk_of
from visavis.stimuli.motion.speaking.body_track import LEAN, RATE_HZ, ROLL, YAW, X, Y, Z
from visavis.stimuli.motion.speaking.gesture_script import GestureScript
from visavis.stimuli.motion.speaking.gesturing import gesture_arms, write_arms
from visavis.stimuli.motion.speaking.speaker import Speaker
from visavis.stimuli.motion.speaking.standing_kernels import speaker_rows

LIVELY: Final = 0.6
STRETCH_01: Final = 0.995
"""Legs are at most so straight; hips that were higher are lowered as a whole."""
HEAD_BACK_01: Final = 0.85
"""Share of the body's turn that the head turns back, towards the audience."""
ROLL_BACK: Final = -1.375
"""How much of the hips' roll the trunk bends back over the feet, as in `standing_kernels.stand`."""


def perform(
    script: GestureScript,
    speaker: Speaker,
    build: Build,
    *,
    fill: Fill,
    seed: int,
    rate_hz: float = 60.0,
) -> Clip:
    """Return somebody of a build who makes the gestures of a script, with the speaker's body.

    The same arguments give the same motion.

    Raises:
        DataError: the speaker's corpus is too small for the script; see `plan_body`.
        MotionError: a hand has no time to get to a stroke.
    """
    plan = plan_body(speaker, script, fill, seed)
    n = int(np.ceil(script.duration_s * rate_hz)) + 1
    t_s = np.arange(n) / rate_hz
    at_s = np.arange(len(plan.hips)) / RATE_HZ
    hips = CubicSpline(at_s, plan.hips)(np.minimum(t_s, at_s[-1])) if len(at_s) > 1 else plan.hips
    arms = gesture_arms(script, t_s, build.lengths_m, seed)
    return performed(build, t_s, hips, trunk_of(plan.turns, t_s), arms, seed)


def performed(
    build: Build, t_s: Vector, hips: Vector, trunk: Vector, arms: Vector, seed: int
) -> Clip:
    """Return a motion from hips (n, 6), turns of the spine (n,) and arms (n, 2, 18) at even times.

    Both feet stand still: their joints have the same numbers in every frame.
    """
    b = build.lengths_m
    controls = np.empty((len(t_s), p.SIZE))
    speaker_rows(t_s, seed, LIVELY, b, controls)
    _place_hips(controls, hips, b)
    controls[:, p.TRUNK_YAW] += trunk
    yaw_rad = hips[:, YAW] + trunk
    controls[:, p.HEAD_YAW] -= HEAD_BACK_01 * yaw_rad
    write_arms(controls, arms)
    root, turns = np.empty((len(t_s), 3)), np.empty((len(t_s), p.JOINTS, 4))
    nobody = np.zeros(len(t_s), np.bool_)
    nowhere = np.zeros((len(t_s), 3))
    pose_rows(
        controls,
        build.skeleton.offsets_m[None],
        np.zeros(len(t_s), dtype=np.int64),
        nobody,
        nowhere,
        nowhere,
        root,
        turns,
    )
    return Clip(build.skeleton, float(t_s[1] - t_s[0]), root, turns)


def _place_hips(controls: Vector, hips: Vector, b: Vector) -> None:
    """Write where the hips are and how they are turned, as far as both legs reach."""
    left, right = (controls[:, p.LEG + side * p.LEG_SIZE :][:, : p.ANKLE + 3] for side in (0, 1))
    middle = (left + right) / 2
    stance_m = right[:, 0] - left[:, 0]
    stood_lean, stood_roll = controls[:, p.HIPS_LEAN].copy(), controls[:, p.HIPS_ROLL].copy()
    stood_yaw = controls[:, p.HIPS_YAW].copy()
    controls[:, p.HIPS] = middle[:, 0] + stance_m * hips[:, X]
    controls[:, p.HIPS + 1] = middle[:, 1] + b[p.B_LEG] * hips[:, Y]
    controls[:, p.HIPS + 2] = middle[:, 2] + b[p.B_LEG] * hips[:, Z]
    controls[:, p.HIPS_YAW] = hips[:, YAW]
    controls[:, p.HIPS_LEAN] = hips[:, LEAN]
    controls[:, p.HIPS_ROLL] = hips[:, ROLL]
    # The trunk stays as upright as it stood; its own stirring is already in these numbers.
    controls[:, p.TRUNK_YAW] += 0.6 * stood_yaw
    controls[:, p.TRUNK_LEAN] += stood_lean - hips[:, LEAN]
    controls[:, p.TRUNK_ROLL] += ROLL_BACK * (hips[:, ROLL] - stood_roll)
    controls[:, p.HEAD_ROLL] += 0.25 * (hips[:, ROLL] - stood_roll)
    controls[:, p.HIPS + 1] -= max(0.0, *(_too_high(controls, b, side) for side in (0, 1)))


def _too_high(controls: Vector, b: Vector, side: int) -> float:
    """Return by how much the hips are too high at most for a leg that stands on its foot."""
    sign = -1.0 if side == 0 else 1.0
    yaw, lean, roll = (controls[:, c] for c in (p.HIPS_YAW, p.HIPS_LEAN, p.HIPS_ROLL))
    x, y = sign * b[p.B_HIP_X], -b[p.B_HIP_Y]
    # The hip joint in the person's axes: turned by roll, lean and yaw, in this order.
    x, y = x * np.cos(roll) + y * np.sin(roll), -x * np.sin(roll) + y * np.cos(roll)
    y, z = y * np.cos(lean), -y * np.sin(lean)
    x, z = x * np.cos(yaw) + z * np.sin(yaw), -x * np.sin(yaw) + z * np.cos(yaw)
    ankle = controls[:, p.LEG + side * p.LEG_SIZE :][:, : p.ANKLE + 3]
    off_x, off_z = controls[:, p.HIPS] + x - ankle[:, 0], controls[:, p.HIPS + 2] + z - ankle[:, 2]
    most = STRETCH_01 * b[p.B_LEG]
    reach = np.sqrt(np.maximum(most**2 - off_x**2 - off_z**2, 0.0))
    return float(np.max(controls[:, p.HIPS + 1] + y - ankle[:, 1] - reach))
