"""One cycle of a styled walk as rows of posture: feet, hips and arms by a few numbers."""

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.gait_kernels import WALK_SHIFT_M, FootRoll, place_foot, reach_height_m
from visavis.stimuli.motion.standing_kernels import hang_arms

LEAD_STRIDES = 4.0
"""The cycle is taken from the fifth stride of a way, where walking is even."""
ENDLESS_M = 1e6
HOLD = 3.0
"""How flat a sharp swing is at its ends: tanh of so many times the cosine."""


@compiled
def sharpened(wave: float, sharp_01: float) -> float:
    """Return a wave from −1 to 1 that rests longer at its ends and passes quicker between them."""
    return float((1.0 - sharp_01) * wave + sharp_01 * np.tanh(HOLD * wave) / np.tanh(HOLD))


@compiled
def styled_rows(shares: Vector, style: Vector, b: Vector, person: int, controls: Vector) -> None:
    """Write postures (n, SIZE) at shares (n,) of a cycle; the left foot lands at 0, the right at ½.

    A foot comes down flat as the other one's toes leave. `style` are the numbers of a `WalkStyle`
    in its order, angles in radians.
    """
    (
        step_01,
        stance,
        width,
        toes_out,
        lift,
        roll,
        crouch_01,
        bounce,
        sway,
        hips,
        lean,
        twist,
        shoulders,
        slump,
        swing_size,
        arm_out,
        elbow,
        head,
        sharp,
    ) = style
    leg, scale = b[p.B_LEG], b[p.B_LEG] / 0.86
    step = step_01 * leg
    relative = min(1.3, step_01 / 0.83)
    strike = np.radians(19.0 * min(1.2, relative)) * roll
    push = np.radians(50.0 * min(1.15, relative)) * roll
    shift = scale * WALK_SHIFT_M * (0.4 + 0.6 * min(1.0, roll))
    reach = reach_height_m(b, stance * step, shift, strike, push)
    middle = np.pi * stance
    bob = scale * 0.019 * relative * bounce
    # Legs reach the floor when both feet stand, and are not straight when one does.
    height = min(0.978 * leg - bob, reach - 0.020 * leg - bob * np.cos(2.0 * middle))
    height -= crouch_01 * leg
    for r in range(len(shares)):
        c = controls[r]
        c[:] = 0.0
        cycle = 2.0 * np.pi * shares[r]
        clock = (LEAD_STRIDES + shares[r]) * 2.0 * step
        for side in range(2):
            sign = -1.0 if side == 0 else 1.0
            foot = c[p.LEG + side * p.LEG_SIZE : p.LEG + (side + 1) * p.LEG_SIZE]
            foot[p.ANKLE] = sign * b[p.B_HIP_X] * width
            foot[p.FOOT_YAW] = -sign * toes_out
            offset = 0.0 if side == 0 else step
            roll = FootRoll(strike, push, scale * 0.055 * lift, stance - 0.5)
            place_foot(foot, b, clock, offset, step, ENDLESS_M, stance, shift, roll)
            foot[p.ANKLE + 2] += LEAD_STRIDES * 2.0 * step
            foot[p.KNEE_OUT] = np.radians(1.0)
        over_left = np.cos(cycle - middle)
        swing = sharpened(np.cos(cycle - 0.10), sharp)
        late = sharpened(np.cos(cycle - 0.45), sharp)
        yaw = np.radians(5.5) * relative
        c[p.HIPS + 1] = b[p.B_STAND] - leg + height + bob * np.cos(2.0 * (cycle - middle))
        c[p.HIPS] = -0.020 * scale * sway * over_left
        c[p.HIPS + 2] = -2.0 * step * shares[r] + 0.25 * b[p.B_TRUNK] * np.sin(max(0.0, lean))
        c[p.HIPS_YAW] = -yaw * hips * swing
        c[p.HIPS_ROLL] = -np.radians(2.4) * hips * np.cos(cycle - middle + 0.5)
        c[p.HIPS_LEAN] = np.radians(2.5) + 0.25 * lean
        c[p.TRUNK_LEAN] = 0.75 * lean - np.radians(1.0) + 0.6 * slump
        c[p.TRUNK_LEAN] += np.radians(1.0) * bounce * np.cos(2.0 * cycle)
        c[p.TRUNK_YAW] = yaw * (hips + 0.9 * twist) * swing
        c[p.TRUNK_ROLL] = -0.9 * c[p.HIPS_ROLL] - np.radians(2.2) * (sway - 1.0) * over_left
        c[p.HEAD_YAW] = -(c[p.HIPS_YAW] + c[p.TRUNK_YAW])
        # Eyes stay level, but for the head's own pitch.
        c[p.HEAD_PITCH] = c[p.HIPS_LEAN] + c[p.TRUNK_LEAN] - np.radians(2.0) + head
        c[p.HEAD_ROLL] = np.radians(1.6) * (sway - 1.0) * over_left
        hang_arms(c, person)
        for side in range(2):
            a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
            ahead = -swing if side == 0 else swing
            behind = -late if side == 0 else late
            # Both sides alike: what differs from person to person is not style.
            a[p.ARM_FLEX] = np.radians(2.0) + swing_size * ahead + 0.5 * lean + 0.35 * slump
            a[p.ARM_OUT] = arm_out
            a[p.ARM_INWARD] = np.radians(18.0) + 0.25 * elbow
            a[p.ELBOW] = elbow + swing_size * 0.45 * (0.4 + behind)
            a[p.PRONATION] = np.radians(18.0)
            a[p.WRIST] = np.radians(6.0)
            a[p.DEVIATION] = np.radians(-2.0)
            a[p.SHOULDER_FORWARD] = np.radians(2.0) + 0.5 * slump
            a[p.SHOULDER_UP] = shoulders
