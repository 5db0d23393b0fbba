"""Walk and run along a straight line, every footprint locked to the floor.

A clock runs in metres: it passes one step length a step. Footprints lie at fixed places along the
way; between them a foot swings, and on the floor it rolls over heel and ball without sliding. Who
has a way of a given length starts and ends with the feet side by side.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.rhythm_kernels import chance, drift, ease
from visavis.stimuli.motion.standing_kernels import breathe, hang_arms, stir

WALK_STANCE = 0.60
RUN_STANCE = 0.36
WALK_RATIO_M_PER_STEP_MIN = 0.0065
"""Step length over steps a minute of adults (Sekiya & Nagasaki 1998, Gait & Posture 7:225)."""
RUN_STEPS_HZ = 2.85
WALK_SHIFT_M, RUN_SHIFT_M = 0.095, 0.06
"""How much farther back than the hips' middle of stance a footprint's ankle lies, for legs of
0.86 m: the foot lands on the heel and leaves from the ball."""
MAX_STEP = 1.02
"""Steps of walkers are at most so many leg lengths, or hips would stretch too far; faster walkers
take quicker ones."""
TOES = 0.6
"""How far the toes of a shoe reach ahead of the ball, of the way from ankle to ball."""
TOE_CLEARANCE_M = 0.013
"""How high toes swing over the floor at least, for legs of 0.86 m (Winter 1992, Physical Therapy
72:45: 12.9 mm)."""
STRIDES_OF_DRIFT = 0.05
CV_OF_DRIFT = 0.355
"""Variation of a stride's time under a drift of unit size, whose slowest swing takes 20 strides."""
REACH = 0.984
"""Largest length of a leg as a share of its straight length."""


@compiled
def free_step_m(speed_mps: float, leg_m: float, runs: bool) -> float:
    """Return the step length people choose at a speed."""
    if runs:
        # Shorter legs and higher speeds take quicker steps.
        quicker = np.sqrt(0.86 / leg_m) * (1.0 + 0.10 * max(0.0, speed_mps - 2.5))
        return float(speed_mps / (RUN_STEPS_HZ * quicker))
    step_m = np.sqrt(WALK_RATIO_M_PER_STEP_MIN * (leg_m / 0.86) * 60.0 * speed_mps)
    return float(min(step_m, MAX_STEP * leg_m))


@compiled
def step_m(speed_mps: float, leg_m: float, distance_m: float, runs: bool) -> float:
    """Return the step length that fits a whole number of steps into a distance."""
    free = free_step_m(speed_mps, leg_m, runs)
    if not np.isfinite(distance_m):
        return free
    steps = max(1.0, np.round(distance_m / free))
    if not runs and distance_m / steps > MAX_STEP * leg_m:
        steps += 1.0
    return float(distance_m / steps)


@compiled
def gone_m(clock_m: float, step: float, distance_m: float) -> float:
    """Return where the body is when the clock shows `clock_m`, from −step to distance + step.

    It sets off and stops with constant acceleration, within two steps each.
    """
    x = min(distance_m + step, max(-step, clock_m))
    if x < step:
        x = (x + step) ** 2 / (4.0 * step)
    # On a short way setting off and stopping meet.
    if np.isfinite(distance_m) and clock_m > distance_m - step:
        left = distance_m + step - min(distance_m + step, clock_m)
        x = min(x, distance_m - left * left / (4.0 * step))
    return x


@compiled
def _hermite(x: float, x0: float, x1: float, y0: float, y1: float, m0: float, m1: float) -> float:
    # The cubic through both ends with slopes m0 and m1 there: no jump of place or speed.
    d = x1 - x0
    h = (x - x0) / d
    h2, h3 = h * h, h * h * h
    return (
        (2.0 * h3 - 3.0 * h2 + 1.0) * y0
        + (h3 - 2.0 * h2 + h) * d * m0
        + (3.0 * h2 - 2.0 * h3) * y1
        + (h3 - h2) * d * m1
    )


@compiled
def _foot_pitch(phase: float, stance: float, flat: float, strike: float, push: float) -> float:
    """Return how far the heel is up: −strike at contact, flat, push when the toes leave."""
    rise = 0.56 * stance
    slope = 1.5 * push / (stance - rise)
    if phase < flat:
        return -strike * (1.0 - ease(phase / flat))
    if phase < rise:
        return 0.0
    if phase < stance:
        return _hermite(phase, rise, stance, 0.0, push, 0.0, slope)
    return _hermite(phase, stance, 1.0, push, -strike, slope, 0.0)


@compiled
def about_ball(b: Vector, pitch: float) -> tuple[float, float]:
    """Return how far forward and up the ankle goes when a flat foot turns about its ball."""
    over, ahead = b[p.B_ANKLE] - b[p.B_BALL_Y], b[p.B_FOOT]
    s, c = np.sin(pitch), np.cos(pitch)
    return ahead * (1.0 - c) + over * s, over * (c - 1.0) + ahead * s


@compiled
def about_heel(b: Vector, pitch: float) -> tuple[float, float]:
    """Return how far forward and up the ankle goes when a flat foot turns about its heel."""
    s, c = np.sin(pitch), np.cos(pitch)
    return (
        b[p.B_HEEL] * (c - 1.0) + b[p.B_ANKLE] * s,
        b[p.B_ANKLE] * (c - 1.0) - b[p.B_HEEL] * s,
    )


@compiled
def _print_m(index: int, first_m: float, step: float, distance_m: float) -> float:
    """Return the place along the way of a foot's print number `index`."""
    return min(distance_m, max(0.0, first_m + 2.0 * step * index))


class FootRoll(NamedTuple):
    """How a foot rolls: pitch at landing and at pushing off (rad), lift of the swing (m), and the
    share of a stride from which it is flat on the floor.
    """

    strike: float
    push: float
    lift: float
    flat: float


@compiled
def place_foot(
    leg: Vector,
    b: Vector,
    clock_m: float,
    offset_m: float,
    step: float,
    distance_m: float,
    stance: float,
    shift: float,
    roll: FootRoll,
) -> None:
    """Place one foot along the way; its contacts come at clock = offset + whole strides."""
    strike, push, lift, flat = roll
    stride = 2.0 * step
    k = np.floor((clock_m - offset_m) / stride)
    phase = (clock_m - offset_m) / stride - k
    middle = 0.5 * stance * stride - shift
    first = offset_m + middle
    before = _print_m(int(k) - 1, first, step, distance_m)
    here = _print_m(int(k), first, step, distance_m)
    after = _print_m(int(k) + 1, first, step, distance_m)
    # A foot that only closes up rolls less.
    came, goes = (here - before) / stride, (after - here) / stride
    landing = strike * (came if phase < 0.5 * stance else goes)
    pitch = _foot_pitch(phase, stance, flat, landing, push * goes)
    ball_forward, ball_up = about_ball(b, pitch)
    heel_forward, heel_up = about_heel(b, pitch)
    u = 0.0
    if phase < stance:
        forward, up = (ball_forward, ball_up) if pitch >= 0.0 else (heel_forward, heel_up)
        along = here
    else:
        u = (phase - stance) / (1.0 - stance)
        # Late enough for the leg to reach, slow enough to land without a slide.
        e = 0.75 * u * u * (3.0 - 2.0 * u) + 0.25 * ease(u)
        forward = (1.0 - e) * ball_forward + e * heel_forward
        up = (1.0 - e) * ball_up + e * heel_up
        along = here + (after - here) * e
        hump = 4.0 * u * (1.0 - u)
        up += lift * goes * hump * hump
    leg[p.ANKLE] -= forward * np.sin(leg[p.FOOT_YAW])
    leg[p.ANKLE + 1] = b[p.B_ANKLE] + up
    leg[p.ANKLE + 2] = -along - forward * np.cos(leg[p.FOOT_YAW])
    leg[p.FOOT_PITCH] = pitch
    bend = max(0.0, pitch) * (1.0 if phase < stance else 1.0 - ease((phase - stance) * 4))
    if pitch < 0.0:
        bend = -0.35 * pitch
    if phase >= stance:
        # Toes stay bent, or are lifted, as far as they would meet the floor otherwise.
        clearance_m = (
            TOE_CLEARANCE_M * (b[p.B_LEG] / 0.86) * goes * ease(4.0 * u) * ease(4.0 - 4.0 * u)
        )
        below = (up - ball_up - clearance_m) / (TOES * b[p.B_FOOT])
        bend = max(bend, pitch - np.arcsin(min(1.0, max(-1.0, below))))
    leg[p.TOE_BEND] = bend


@compiled
def reach_height_m(b: Vector, half: float, shift: float, strike: float, push: float) -> float:
    """Return how high above a standing ankle both legs let the hip joints be, ahead and behind."""
    # The hips are lowest where a step is longest: the front leg stands on its heel, the rear one on
    # its ball, and neither may be stretched beyond its reach.
    forward, up = about_heel(b, -strike)
    ahead = half - shift + forward
    height = np.sqrt((REACH * b[p.B_LEG]) ** 2 - ahead * ahead) + up
    forward, up = about_ball(b, push)
    behind = half + shift - forward
    return float(min(height, np.sqrt((REACH * b[p.B_LEG]) ** 2 - behind * behind) + up))


@compiled
def _late_m(
    t_s: float, person: int, speed: float, step: float, distance_m: float, stride_cv: float
) -> float:
    """Return how far the clock of somebody's steps is from an even one: behind, or ahead.

    Strides grow and shrink over many, as people's do (Hausdorff et al. 1995, J. Appl. Physiol.
    78:349); beginning and end of a way are on time.
    """
    stride_s = 2.0 * step / speed
    end_s = (distance_m + 2.0 * step) / speed
    if t_s <= 0.0 or t_s >= end_s:
        return 0.0
    share = ease(t_s / (2.0 * stride_s)) * ease((end_s - t_s) / (2.0 * stride_s))
    uneven = drift(t_s / stride_s, STRIDES_OF_DRIFT, person, 403)
    return 2.0 * step * share * uneven * stride_cv / CV_OF_DRIFT


@compiled
def gait_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who walk or run.

    `numbers` (n, …): how lively, speed in m/s, distance in metres (may be infinite), 1 for a run,
    the coefficient of variation of the stride's time.
    """
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        c[:] = 0.0
        lively, speed, distance, runs = (
            numbers[r, 0],
            numbers[r, 1],
            numbers[r, 2],
            numbers[r, 3] > 0.5,
        )
        leg, scale = b[p.B_LEG], b[p.B_LEG] / 0.86
        step = step_m(speed, leg, distance, runs)
        clock = min(distance + step, max(-step, speed * t - step))
        if numbers[r, 4] > 0.0:
            clock += _late_m(t, person, speed, step, distance, numbers[r, 4])
        body = gone_m(clock, step, distance)
        # How much of a gait it is: nothing while the feet still stand side by side.
        full = ease((clock + step) / (2.0 * step)) * ease((distance + step - clock) / (2.0 * step))
        stance = WALK_STANCE
        if runs:
            stance = RUN_STANCE - 0.05 * max(0.0, speed / np.sqrt(scale) - 2.0)
        relative = step / (0.83 * leg)
        strike = np.radians(4.0 if runs else 19.0 * min(1.2, relative))
        push = np.radians(45.0 if runs else 50.0 * min(1.15, relative))
        lift = scale * (0.23 if runs else 0.055)
        shift = scale * (RUN_SHIFT_M if runs else WALK_SHIFT_M)
        reach = reach_height_m(b, stance * step, shift, strike, push)
        contact = -0.94 * step
        phase = (clock - contact) / (2.0 * step)
        cycle = 2.0 * np.pi * phase
        for side in range(2):
            sign = -1.0 if side == 0 else 1.0
            foot = c[p.LEG + side * p.LEG_SIZE : p.LEG + (side + 1) * p.LEG_SIZE]
            wide = b[p.B_HIP_X] * (0.5 if runs else 0.62)
            foot[p.ANKLE] = sign * wide
            offset = contact + (0.0 if side == 0 else step)
            foot[p.FOOT_YAW] = -sign * np.radians(3.0 + 5.0 * chance(person, 401, side))
            roll = FootRoll(strike, push, lift, 0.18 * stance)
            place_foot(foot, b, clock, offset, step, distance, stance, shift, roll)
            foot[p.KNEE_OUT] = np.radians(1.0)
        _carry(c, b, person, cycle, full, stance, step, reach, runs)
        c[p.HIPS + 2] = -body + (0.01 * scale if runs else 0.0)
        c[p.ATTEND], c[p.ATTEND + 1] = full, 0.0
        c[p.ATTEND + 2] = -np.radians(7.0) * full
        stir(c, t, person, 0.6 * lively)
        breathe(c, t, person, 1.6 if runs else 1.2)
        c[p.HEAD_YAW] += np.radians(2.0) * lively * drift(t, 0.06, person, 402)


@compiled
def _carry(
    c: Vector,
    b: Vector,
    person: int,
    cycle: float,
    full: float,
    stance: float,
    step: float,
    reach: float,
    runs: bool,
) -> None:
    """Move hips, trunk and arms with the legs; the left foot lands at cycle 0, the right at π."""
    leg, scale = b[p.B_LEG], b[p.B_LEG] / 0.86
    relative = min(1.3, step / (0.83 * leg))
    middle = np.pi * stance
    # A runner is lowest in the middle of stance, a walker highest.
    bob = scale * (-0.030 if runs else 0.019 * relative)
    height = reach - abs(bob * np.cos(2.0 * middle)) if runs else reach - bob * np.cos(2.0 * middle)
    height = min(0.955 * leg, height - 0.020 * leg) if runs else min(0.975 * leg, height)
    top = b[p.B_STAND] - leg
    height = full * height + (1.0 - full) * 0.985 * leg
    c[p.HIPS + 1] = top + height + full * bob * np.cos(2.0 * (cycle - middle))
    over_left = np.cos(cycle - middle)
    c[p.HIPS] = -full * (0.010 if runs else 0.020) * scale * over_left
    swing = np.cos(cycle - 0.10)
    yaw = full * np.radians(7.0 if runs else 5.5) * relative
    # With the left leg ahead the pelvis is turned to the right.
    c[p.HIPS_YAW] = -yaw * swing
    c[p.HIPS_ROLL] = -full * np.radians(2.4) * np.cos(cycle - middle + 0.5)
    c[p.HIPS_LEAN] = np.radians(2.0) + full * np.radians(5.0 if runs else 0.5)
    c[p.TRUNK_LEAN] = full * np.radians(5.0 if runs else 0.5) - np.radians(1.5)
    c[p.TRUNK_LEAN] += full * np.radians(1.0) * np.cos(2.0 * cycle)
    c[p.TRUNK_YAW] = yaw * swing * 1.9
    c[p.TRUNK_ROLL] = -0.9 * c[p.HIPS_ROLL]
    c[p.HEAD_YAW] = -(c[p.HIPS_YAW] + c[p.TRUNK_YAW])
    c[p.HEAD_PITCH] = 0.8 * (c[p.HIPS_LEAN] + c[p.TRUNK_LEAN]) - np.radians(3.0)
    hang_arms(c, person)
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        # An arm swings with the leg of the other side, a little late.
        ahead = -swing if side == 0 else swing
        late = np.cos(cycle - 0.45)
        late = -late if side == 0 else late
        if runs:
            a[p.ARM_FLEX] += full * (np.radians(-12.0) + np.radians(30.0) * ahead)
            a[p.ELBOW] += full * (np.radians(86.0) - a[p.ELBOW] + np.radians(14.0) * late)
            a[p.ARM_INWARD] += full * np.radians(14.0)
            a[p.PRONATION] += full * (np.radians(10.0) - a[p.PRONATION])
            for finger in range(4):
                a[p.CURL + finger] += full * 0.28
        else:
            size = (0.85 + 0.35 * chance(person, 411, 0)) * relative
            a[p.ARM_FLEX] += full * size * (np.radians(2.0) + np.radians(19.0) * ahead)
            a[p.ELBOW] += full * size * np.radians(9.0) * (0.4 + late)
            a[p.ARM_OUT] += full * np.radians(1.0)
