"""Sitting and listening on any seat: feet on the floor, hands on the thighs, in the lap, folded."""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.rhythm_kernels import bump, chance, drift, stepping
from visavis.stimuli.motion.standing_kernels import (
    breathe,
    clasp_in_front,
    fold_arms,
    hang_arms,
    hold,
    pole,
    stir,
)

ON_THIGHS, IN_LAP, ARMS_FOLDED, MIXED = 0, 1, 2, 3
"""Where the hands of a sitter are; MIXED has one hand on a thigh and the other one over it."""
MAX_TUCKED = 0.34
"""How far an ankle is drawn back behind the knee at most, in lengths of the shin: 20°, which heels
on the floor allow.
"""


@compiled
def sit(
    c: Vector,
    t_s: float,
    b: Vector,
    seat_m: float,
    person: int,
    lively: float,
    back_rad: float,
    tucked_01: float,
) -> None:
    """Sit on a seat `seat_m` above the floor, leaning back by an angle, feet drawn back so far.

    The origin is on the floor below the hips.
    """
    scale = b[p.B_LEG] / 0.86
    posture, moving = stepping(t_s, 16.0 + 8.0 * chance(person, 101, 0), 2.2, person, 102)
    side_shift, _ = stepping(t_s, 14.0, 2.0, person, 103)
    c[p.HIPS] = 0.004 * scale * lively * side_shift
    c[p.HIPS + 1] = seat_m + b[p.B_SEAT_GAP]
    tuck = np.radians(10.0 + 8.0 * chance(person, 104, 0))
    c[p.HIPS_LEAN] = -tuck
    c[p.HIPS_YAW] = np.radians(4.0) * (chance(person, 105, 0) - 0.5)
    lean = -back_rad + np.radians(5.0) * (chance(person, 106, 0) - 0.5)
    lean += np.radians(2.6) * lively * posture + np.radians(1.5) * lively * moving
    c[p.TRUNK_LEAN] = lean + tuck
    c[p.TRUNK_ROLL] = np.radians(2.6) * lively * side_shift
    c[p.TRUNK_YAW] = -0.7 * c[p.HIPS_YAW]
    c[p.HEAD_PITCH] = lean + np.radians(-1.0 + 3.0 * chance(person, 107, 0))
    c[p.HEAD_ROLL] = -np.radians(2.0) * lively * side_shift
    # Ankles may lie as far before the knees as leaves these above the seat.
    knee_m = seat_m + b[p.B_KNEE_GAP]
    hip_m = c[p.HIPS + 1] - b[p.B_HIP_Y]
    drop = min(0.9 * b[p.B_THIGH], max(-0.5 * b[p.B_THIGH], hip_m - knee_m))
    knee_z = -np.sqrt(b[p.B_THIGH] ** 2 - drop * drop)
    # Who is too short for the seat stands on the balls of the feet.
    rise = max(0.0, knee_m - b[p.B_ANKLE] - 0.99 * b[p.B_SHIN])
    heel_up = np.arcsin(min(0.76, rise / b[p.B_FOOT]))
    over = b[p.B_ANKLE] - b[p.B_BALL_Y]
    ankle_m = b[p.B_ANKLE] + over * (np.cos(heel_up) - 1.0) + b[p.B_FOOT] * np.sin(heel_up)
    shin_up = min(0.999 * b[p.B_SHIN], max(0.1, knee_m - ankle_m))
    tilt = np.sqrt(b[p.B_SHIN] ** 2 - shin_up * shin_up)
    ankle_apart_m = b[p.B_HIP_X] * (0.75 + 0.85 * chance(person, 108, 0))
    aside = b[p.B_HIP_X] + 0.10 * scale
    # Crossing the ankles takes shins that can lean.
    are_crossed = tucked_01 == 0.0 and chance(person, 109, 0) < 0.22 and tilt > 1.05 * aside
    front = 0 if chance(person, 109, 1) < 0.5 else 1
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        leg = c[p.LEG + side * p.LEG_SIZE : p.LEG + (side + 1) * p.LEG_SIZE]
        leg[p.ANKLE] = sign * ankle_apart_m
        leg[p.ANKLE + 1] = ankle_m
        leg[p.FOOT_PITCH], leg[p.TOE_BEND] = heel_up, heel_up
        ahead = 0.9 * tilt - (0.7 * tilt + 0.05) * chance(person, 110, side)
        ahead = min(0.2 * scale, ahead)
        if tucked_01 > 0.0:
            ahead += tucked_01 * (-min(0.9 * tilt, MAX_TUCKED * b[p.B_SHIN]) - ahead)
        leg[p.ANKLE + 2] = knee_z - ahead
        leg[p.FOOT_YAW] = -sign * np.radians(4.0 + 10.0 * chance(person, 111, side))
        leg[p.KNEE_OUT] = np.radians(3.0)
        if are_crossed:
            # Ankles crossed before the seat, the outer edges of the feet on the floor.
            leg[p.ANKLE] = -sign * 0.028 * scale
            most = np.sqrt(max(0.0, tilt * tilt - aside * aside))
            leg[p.ANKLE + 2] = knee_z - most + (0.0 if side == front else 0.11 * scale)
            leg[p.FOOT_YAW] = -sign * np.radians(14.0)
            leg[p.FOOT_ROLL] = sign * np.radians(10.0)
            leg[p.ANKLE + 1] += 0.008 * scale
            leg[p.KNEE_OUT] = np.radians(9.0)


@compiled
def hand_on_thigh(a: Vector, b: Vector, person: int, side: int, weight: float) -> None:
    """Lay a palm on the thigh, fingers over it towards the knee."""
    along = b[p.B_THIGH] * (0.44 + 0.22 * chance(person, 121, side))
    # In the thigh's axes the knee is at −y, the upper side at −z, the inner one at +x.
    place = (-0.012, -along, -b[p.B_THIGH_RADIUS] - 0.030)
    hold(
        a,
        p.THIGH,
        weight,
        place,
        (0.22 + 0.25 * chance(person, 122, side), -1.0, 0.12),
        (0.10, 0.10, 1.0),
    )
    pole(a, -0.9, -0.5, 0.85)
    for finger in range(4):
        target = 0.14 + 0.03 * finger + 0.06 * chance(person, 123 + side, finger)
        a[p.CURL + finger] += weight * (target - a[p.CURL + finger])
    a[p.SPREAD] = np.radians(6.0 + 6.0 * chance(person, 125, side))


@compiled
def lap_arms(c: Vector, b: Vector, way: int, person: int) -> None:
    """Keep the arms of a sitter in one of the ways."""
    hang_arms(c, person)
    if way == IN_LAP:
        clasp_in_front(c, b, b[p.B_THIGH_RADIUS] - 0.02, 1.0, person)
        for side in range(2):
            a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
            hand = a[p.HOLD + p.PELVIS * p.HOLD_SIZE : p.HOLD + (p.PELVIS + 1) * p.HOLD_SIZE]
            hand[3] -= 0.055
            # Seen from above hands in a lap show their thumbs, which lie along them.
            a[p.THUMB_IN] = np.radians(11.0)
    elif way == ARMS_FOLDED:
        fold_arms(c, b, 1.0, person)
    else:
        for side in range(2):
            a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
            hand_on_thigh(a, b, person, side, 1.0)


@compiled
def seated_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who sit and listen.

    `numbers` (n, …): how lively, the way of the hands, height of the seat in metres, lean back in
    radians, nods (1 usual, 0 none), how far the feet are drawn back (0 to 1).
    """
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        c[:] = 0.0
        lively = numbers[r, 0]
        sit(c, t, b, numbers[r, 2], person, lively, numbers[r, 3], numbers[r, 5])
        lap_arms(c, b, int(numbers[r, 1]), person)
        if int(numbers[r, 1]) == ON_THIGHS:
            # Elbows stay within the width of the seat, clear of neighbours and of the own trunk.
            for side in range(2):
                a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
                pole(a, -0.15, -0.7, 0.85)
                a[p.ELBOW_BESIDE] = b[p.B_ELBOW_BESIDE]
        stir(c, t, person, 0.8 * lively)
        nod, size = bump(t, 11.0, 1.5, person, 131)
        beat = np.sin(2.0 * np.pi * 1.9 * t + 6.28 * size)
        c[p.HEAD_PITCH] += (
            numbers[r, 4] * lively * nod * np.radians(1.5 + 2.5 * size) * (beat - 0.4)
        )
        c[p.HEAD_YAW] += lively * np.radians(1.5) * drift(t, 0.05, person, 132)
        breathe(c, t, person, 1.0)
