"""Relaxed standing: weight from leg to leg, breathing, small drifts, several arm postures.

Every row of a crowd is written as posture numbers. Sizes: quiet standing sways by about 5 mm at
0.1–0.5 Hz (Winter 1995, Gait & Posture 3:193), breathing at rest has 12 to 18 cycles a minute.
"""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.quaternion_kernels import Triple
from visavis.stimuli.motion.rhythm_kernels import chance, drift, stepping

HANGING, CLASPED, FOLDED, BEHIND = 0, 1, 2, 3
"""Ways to keep the arms: hanging, hands clasped in front, folded, clasped behind the back."""


@compiled
def breathe(c: Vector, t_s: float, person: int, amount: float) -> None:
    """Lift chest and shoulders; the way in is shorter than the way out."""
    rate_hz = (12.0 + 6.0 * chance(person, 11, 0)) / 60.0
    phase = 2.0 * np.pi * (rate_hz * t_s + chance(person, 11, 1))
    # Depth wanders from breath to breath.
    depth = amount * (1.0 + 0.25 * drift(t_s, 0.02, person, 12))
    wave = 0.5 - 0.5 * np.cos(phase + 0.35 * np.sin(phase))
    c[p.TRUNK_LEAN] -= np.radians(0.9) * depth * wave
    c[p.HEAD_PITCH] -= np.radians(0.7) * depth * wave
    for side in range(2):
        c[p.ARM + side * p.ARM_SIZE + p.SHOULDER_UP] += np.radians(1.3) * depth * wave


@compiled
def stir(c: Vector, t_s: float, person: int, amount: float) -> None:
    """Add the small drifts of a body that nobody holds still: trunk, head, arms, fingers."""
    stir_body(c, t_s, person, amount)
    stir_fingers(c, t_s, person, amount)


@compiled
def stir_fingers(c: Vector, t_s: float, person: int, amount: float) -> None:
    """Add the small drifts of the fingers alone."""
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        for finger in range(4):
            a[p.CURL + finger] += amount * 0.022 * drift(t_s, 0.07, person, 41 + 4 * side + finger)
        a[p.THUMB] += amount * 0.05 * drift(t_s, 0.06, person, 49 + side)


@compiled
def stir_body(c: Vector, t_s: float, person: int, amount: float) -> None:
    """Add the small drifts of trunk, head and arms alone."""
    c[p.TRUNK_YAW] += amount * np.radians(1.1) * drift(t_s, 0.06, person, 21)
    c[p.TRUNK_LEAN] += amount * np.radians(0.6) * drift(t_s, 0.07, person, 22)
    c[p.TRUNK_ROLL] += amount * np.radians(0.7) * drift(t_s, 0.06, person, 23)
    c[p.HEAD_YAW] += amount * np.radians(1.6) * drift(t_s, 0.08, person, 24)
    c[p.HEAD_PITCH] += amount * np.radians(1.0) * drift(t_s, 0.09, person, 25)
    tilt, _ = stepping(t_s, 9.0, 1.4, person, 26)
    c[p.HEAD_ROLL] += amount * np.radians(2.6) * tilt
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        a[p.ARM_FLEX] += amount * np.radians(1.0) * drift(t_s, 0.10, person, 31 + side)
        a[p.ELBOW] += amount * np.radians(1.6) * drift(t_s, 0.08, person, 33 + side)
        a[p.PRONATION] += amount * np.radians(2.2) * drift(t_s, 0.06, person, 35 + side)
        a[p.WRIST] += amount * np.radians(1.8) * drift(t_s, 0.08, person, 37 + side)


@compiled
def relax_hand(a: Vector, person: int, side: int) -> None:
    """Let the fingers hang: each curls a little more than its neighbour towards the little one."""
    loose = 0.26 + 0.12 * chance(person, 52, side)
    for finger in range(4):
        own = 0.05 * (chance(person, 53 + side, finger) - 0.5)
        a[p.CURL + finger] = loose + 0.055 * finger + own
    a[p.THUMB] = 0.28 + 0.16 * chance(person, 55, side)
    a[p.OPPOSE] = np.radians(12.0 + 10.0 * chance(person, 56, side))
    a[p.SPREAD] = np.radians(4.0 + 5.0 * chance(person, 57, side))


@compiled
def hang_arms(c: Vector, person: int) -> None:
    """Hang both arms with bent elbows, palms to the thighs and a little back."""
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        a[p.ARM_FLEX] = np.radians(-2.0 + 7.0 * chance(person, 61, side))
        a[p.ARM_OUT] = np.radians(9.5 + 4.0 * chance(person, 62, side))
        a[p.ARM_INWARD] = np.radians(12.0 + 14.0 * chance(person, 63, side))
        a[p.ELBOW] = np.radians(14.0 + 13.0 * chance(person, 64, side))
        a[p.PRONATION] = np.radians(8.0 + 22.0 * chance(person, 65, side))
        a[p.WRIST] = np.radians(3.0 + 8.0 * chance(person, 66, side))
        a[p.DEVIATION] = np.radians(-4.0 + 5.0 * chance(person, 67, side))
        a[p.SHOULDER_FORWARD] = np.radians(1.0 + 4.0 * chance(person, 68, 0))
        relax_hand(a, person, side)


@compiled
def hold(
    a: Vector, which: int, weight: float, place: Triple, fingers: Triple, palm: Triple
) -> None:
    """Bring a wrist to a place of the held thing; fingers and palm point these ways."""
    x, y, z = place
    fx, fy, fz = fingers
    px, py, pz = palm
    h = a[p.HOLD + which * p.HOLD_SIZE : p.HOLD + (which + 1) * p.HOLD_SIZE]
    # Directions are stored multiplied by the weight, so that holds can be mixed by adding.
    f, q = (
        weight / np.sqrt(fx * fx + fy * fy + fz * fz),
        weight / np.sqrt(px * px + py * py + pz * pz),
    )
    h[0], h[1], h[2], h[3] = weight, weight * x, weight * y, weight * z
    h[4], h[5], h[6] = f * fx, f * fy, f * fz
    h[7], h[8], h[9] = q * px, q * py, q * pz


@compiled
def pole(a: Vector, x: float, y: float, z: float) -> None:
    """Say where the elbow of a held hand goes, in the chest's axes."""
    a[p.POLE], a[p.POLE + 1], a[p.POLE + 2] = x, y, z


@compiled
def clasp_in_front(c: Vector, b: Vector, height_m: float, weight: float, person: int) -> None:
    """Lay one hand over the other before the belly, `height_m` above the hips."""
    upper_side = 1 if chance(person, 71, 0) < 0.5 else 0
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        # The palm of one lies on the back of the other, knuckles on knuckles.
        over = b[p.B_HAND_THICK] + 0.003 if side == upper_side else 0.0
        place = (-0.85 * b[p.B_HAND], height_m, -b[p.B_BELLY] - 0.025 - over)
        hold(a, p.PELVIS, weight, place, (0.96, -0.20, -0.06), (0.06, 0.0, 1.0))
        pole(a, -1.0, -0.35, 0.75)
        for finger in range(4):
            flat = 0.14 if side == upper_side else 0.22
            a[p.CURL + finger] += weight * (flat + 0.03 * finger - a[p.CURL + finger])
        a[p.SPREAD] *= 1.0 - weight
        a[p.THUMB] += weight * (0.15 - a[p.THUMB])
        a[p.OPPOSE] *= 1.0 - weight


@compiled
def fold_arms(c: Vector, b: Vector, weight: float, person: int) -> None:
    """Fold the arms on the chest, one forearm over the other."""
    upper_side = 1 if chance(person, 72, 0) < 0.5 else 0
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        # The upper forearm lies higher and before the other.
        over = side == upper_side
        place = (
            0.52 * b[p.B_SHOULDER_X],
            -0.055 if over else -0.085,
            -b[p.B_BELLY] - (0.075 if over else 0.030),
        )
        hold(
            a,
            p.CHEST,
            weight,
            place,
            (0.93, 0.28 if over else 0.05, 0.42 if over else 0.30),
            (-0.25, -0.35, 1.0),
        )
        pole(a, -0.75, -1.0, -0.05)
        for finger in range(4):
            a[p.CURL + finger] += weight * (0.18 + 0.03 * finger - a[p.CURL + finger])


@compiled
def clasp_behind(c: Vector, b: Vector, weight: float) -> None:
    """Clasp the hands behind the back."""
    for side in range(2):
        a = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        place = (-0.055, 0.015 - 0.02 * side, 0.072 * b[p.B_STATURE] + 0.02 * side)
        hold(a, p.PELVIS, weight, place, (0.80, -0.60, 0.15), (0.0, 0.1, 1.0))
        pole(a, -1.0, -0.2, 0.85)
        for finger in range(4):
            a[p.CURL + finger] += weight * (0.45 - a[p.CURL + finger])


@compiled
def stand(c: Vector, t_s: float, b: Vector, person: int, lively: float) -> None:
    """Stand with the weight on one leg, then on the other; feet stay where they are."""
    scale = b[p.B_LEG] / 0.86
    shift, moving = stepping(t_s, 8.0 + 6.0 * chance(person, 1, 0), 1.6, person, 2)
    shift *= lively
    half = b[p.B_HIP_X] * (0.92 + 0.5 * chance(person, 3, 0))
    ahead = 0.045 * scale * (2.0 * chance(person, 4, 0) - 1.0)
    sway = 0.0045 * scale * lively
    x = 0.50 * half * shift + sway * drift(t_s, 0.11, person, 5)
    c[p.HIPS] = x
    c[p.HIPS + 1] = b[p.B_STAND] - 0.012 * b[p.B_LEG] - 0.006 * scale * shift * shift
    c[p.HIPS + 2] = sway * drift(t_s, 0.10, person, 6) + 0.010 * scale
    c[p.HIPS_YAW] = np.radians(5.0) * (chance(person, 7, 0) - 0.5) + np.radians(3.5) * shift
    # The hip over the standing leg rises, the trunk above bends back over the feet.
    c[p.HIPS_ROLL] = -np.radians(4.0) * shift
    c[p.TRUNK_ROLL] = np.radians(5.5) * shift
    c[p.HIPS_LEAN] = np.radians(2.0 + 2.0 * chance(person, 8, 0))
    c[p.TRUNK_LEAN] = np.radians(-1.0 + 4.0 * chance(person, 8, 1)) - c[p.HIPS_LEAN]
    c[p.TRUNK_LEAN] += np.radians(1.2) * lively * moving
    c[p.TRUNK_YAW] = -0.6 * c[p.HIPS_YAW]
    c[p.HEAD_PITCH] = np.radians(-2.0 + 3.0 * chance(person, 9, 0)) + c[p.TRUNK_LEAN]
    c[p.HEAD_PITCH] += c[p.HIPS_LEAN]
    c[p.HEAD_ROLL] = -0.25 * np.radians(4.0) * shift
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        leg = c[p.LEG + side * p.LEG_SIZE : p.LEG + (side + 1) * p.LEG_SIZE]
        leg[p.ANKLE] = sign * half
        leg[p.ANKLE + 1] = b[p.B_ANKLE]
        leg[p.ANKLE + 2] = -sign * ahead + 0.02 * scale
        leg[p.FOOT_YAW] = -sign * np.radians(5.0 + 9.0 * chance(person, 10, side))
        leg[p.KNEE_OUT] = np.radians(2.0)


@compiled
def arms_of(c: Vector, b: Vector, way: int, person: int) -> None:
    """Keep the arms in one of the ways."""
    hang_arms(c, person)
    if way == CLASPED:
        clasp_in_front(c, b, -0.02, 1.0, person)
    elif way == FOLDED:
        fold_arms(c, b, 1.0, person)
    elif way == BEHIND:
        clasp_behind(c, b, 1.0)


@compiled
def idle_but_fingers(
    c: Vector, t_s: float, b: Vector, person: int, lively: float, way: int
) -> None:
    """Write the posture of somebody who stands idle, but for how the fingers stir."""
    # Stirring and breath add to the posture, so that they come last.
    c[:] = 0.0
    stand(c, t_s, b, person, lively)
    arms_of(c, b, way, person)
    stir_body(c, t_s, person, lively)
    breathe(c, t_s, person, 1.0)


@compiled
def idle_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who stand idle.

    `numbers` (n, …): how lively (1 usual, 0 still) and the way of the arms.
    """
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        lively = numbers[r, 0]
        idle_but_fingers(c, t, b, person, lively, int(numbers[r, 1]))
        stir_fingers(c, t, person, lively)
