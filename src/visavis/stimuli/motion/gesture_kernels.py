"""Activities while standing or sitting: wave, phone, text, watch a board, talk with gestures."""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.rhythm_kernels import bump, chance, drift, ease
from visavis.stimuli.motion.seated_kernels import lap_arms, sit
from visavis.stimuli.motion.standing_kernels import (
    arms_of,
    breathe,
    hang_arms,
    hold,
    pole,
    stand,
    stir,
    stir_body,
    stir_fingers,
)

LEFT, RIGHT, BOTH = 0, 1, 2


@compiled
def arm_of(c: Vector, side: int) -> Vector:
    """Return the numbers of one arm."""
    return c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]


@compiled
def curl(a: Vector, index: float, middle: float, ring: float, little: float, thumb: float) -> None:
    """Bend the fingers of one hand."""
    a[p.CURL], a[p.CURL + 1], a[p.CURL + 2], a[p.CURL + 3] = index, middle, ring, little
    a[p.THUMB], a[p.THUMB_IN] = thumb, 0.0


@compiled
def speak(c: Vector, t_s: float, person: int, loud: float) -> None:
    """Move the jaw as in speech: syllables four to five times a second, pauses between phrases."""
    phrase = drift(t_s, 0.16, person, 301) + 0.45
    voice = ease(2.0 * phrase)
    syllable = 0.5 + 0.5 * drift(t_s, 2.2, person, 302)
    c[p.JAW] = loud * voice * min(0.7, max(0.0, 0.42 * syllable))


@compiled
def _at_ease(
    c: Vector, t_s: float, b: Vector, seat_m: float, person: int, lively: float, hand: int
) -> None:
    """Write the posture of somebody who stands, or sits at `seat_m`, a hand or both off the lap."""
    c[:] = 0.0
    if seat_m > 0.0:
        sit(c, t_s, b, seat_m, person, lively, 0.0, 0.0)
        lap_arms(c, b, 0, person)
        # A hand that is about to do something else must no longer be held to the lap.
        for side in range(2):
            if hand == BOTH or hand == side:
                arm_of(c, side)[p.HOLD : p.HOLD + p.HOLDS * p.HOLD_SIZE] = 0.0
    else:
        stand(c, t_s, b, person, lively)
        hang_arms(c, person)
    stir(c, t_s, person, lively)
    breathe(c, t_s, person, 1.0)


@compiled
def wave_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who wave.

    `numbers` (n, …): how lively, hand (left, right, both), waves a second, swing of the forearm in
    radians from end to end, height of the elbow (0 at the side, 1 at the shoulder), seat in metres
    (0 stands).
    """
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        lively, hand, rate, swing, height = (
            numbers[r, 0],
            int(numbers[r, 1]),
            numbers[r, 2],
            numbers[r, 3],
            numbers[r, 4],
        )
        _at_ease(c, t, b, numbers[r, 5], person, lively, hand)
        for side in range(2):
            if hand != BOTH and hand != side:
                continue
            a = arm_of(c, side)
            # Nobody waves like a clock: tempo and width wander. Both hands wave against each other.
            uneven = 0.22 * drift(t, 0.35, person, 311 + side)
            phase = 2.0 * np.pi * rate * t + uneven + (np.pi * side if hand == BOTH else 0.0)
            size = 0.5 * swing * (1.0 + 0.12 * drift(t, 0.3, person, 313 + side))
            forearm = size * np.sin(phase) - 0.10
            # The hand trails behind the forearm and swings a little farther.
            palm_swing = 1.25 * size * np.sin(phase - 0.55) - 0.10
            # The upper arm sets the elbow's height; the hand's place follows along the forearm, so
            # that the arm is as long as it is.
            out = np.radians(28.0 + 58.0 * height)
            forward = np.radians(34.0 - 14.0 * height)
            ex, ey, ez = (
                -np.sin(out),
                -np.cos(out) * np.cos(forward),
                -np.cos(out) * np.sin(forward),
            )
            ex, ez = ex * np.cos(0.45), ez + ex * np.sin(0.45)
            length = np.sqrt(ex * ex + ey * ey + ez * ez)
            upper = b[p.B_UPPER_ARM] / length
            sx, sy, sz = -b[p.B_SHOULDER_X], b[p.B_SHOULDER_Y], b[p.B_SHOULDER_Z]
            fx, fy, fz = -np.sin(forearm), np.cos(forearm), -0.28
            f = b[p.B_FOREARM] / np.sqrt(fx * fx + fy * fy + fz * fz)
            lift = np.radians(2.0 + 8.0 * height)
            a[p.SHOULDER_UP] += lift
            place = (
                sx + upper * ex + f * fx,
                sy + upper * ey + f * fy + 0.6 * lift * b[p.B_SHOULDER_X],
                sz + upper * ez + f * fz,
            )
            hold(
                a,
                p.CHEST,
                1.0,
                place,
                (-np.sin(palm_swing), np.cos(palm_swing), -0.12),
                (0.10, 0.15, -1.0),
            )
            pole(a, ex, ey, ez)
            open_hand = 0.07 + 0.03 * chance(person, 315, side)
            curl(a, open_hand, open_hand + 0.02, open_hand + 0.04, open_hand + 0.08, 0.1)
            a[p.SPREAD] = np.radians(12.0)
            c[p.TRUNK_ROLL] += (1.0 if side == 0 else -1.0) * np.radians(1.6) * height
            c[p.TRUNK_YAW] += (1.0 if side == 0 else -1.0) * np.radians(1.0) * np.sin(phase - 0.8)
        c[p.SMILE] = 0.45


@compiled
def listen(a: Vector, b: Vector) -> None:
    """Bring a hand to where the telephone in it lies at the ear, as `telephoning` says."""
    at = b[p.B_AT_EAR : p.B_AT_EAR + 9]
    place = (at[0], at[1], at[2])
    hold(a, p.HEAD, 1.0, place, (at[3], at[4], at[5]), (at[6], at[7], at[8]))


@compiled
def grip(a: Vector, b: Vector) -> None:
    """Close a hand round the telephone in it, as `gripping` says."""
    g = b[p.B_GRIP : p.B_GRIP + p.GRIP_SIZE]
    for finger in range(4):
        a[p.CURL + finger], a[p.KNUCKLE + finger] = g[finger], g[4 + finger]
    a[p.SPREAD], a[p.THUMB], a[p.OPPOSE], a[p.THUMB_IN] = g[8], g[9], g[10], g[11]


@compiled
def phone_but_fingers(
    c: Vector, t_s: float, b: Vector, person: int, lively: float, side: int
) -> None:
    """Write the posture of somebody who phones, but for fingers and mouth."""
    c[:] = 0.0
    stand(c, t_s, b, person, 1.15 * lively)
    hang_arms(c, person)
    other = arm_of(c, 1 - side)
    if chance(person, 321, 0) < 0.4:
        # The free arm lies across the belly and carries the other elbow.
        place = (0.30 * b[p.B_SHOULDER_X], -0.115, -b[p.B_BELLY] - 0.055)
        hold(other, p.CHEST, 1.0, place, (0.95, 0.10, 0.10), (-0.1, 0.3, 1.0))
        pole(other, -0.7, -1.0, 0.2)
    stir_body(c, t_s, person, lively)
    breathe(c, t_s, person, 1.0)
    towards = -1.0 if side == 0 else 1.0
    c[p.HEAD_ROLL] += towards * np.radians(5.0)
    c[p.HEAD_PITCH] -= np.radians(3.0)
    c[p.HEAD_YAW] += np.radians(5.0) * lively * drift(t_s, 0.05, person, 322)
    c[p.TRUNK_YAW] += np.radians(4.0) * lively * drift(t_s, 0.04, person, 323)
    a = arm_of(c, side)
    listen(a, b)
    pole(a, -0.60, -1.0, 0.15)
    # Drawn down and back: elbows do not bend so far that a hand gets nearer to its shoulder.
    a[p.SHOULDER_UP] -= np.radians(6.0)
    a[p.SHOULDER_FORWARD] -= np.radians(7.0)


@compiled
def phone_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who phone. `numbers` (n, …): how lively, hand, how much talk."""
    for i in range(rows.shape[0]):
        r = rows[i]
        c, person, t = controls[r], persons[r], t_s[r]
        lively, side = numbers[r, 0], int(numbers[r, 1])
        phone_but_fingers(c, t, builds[r], person, lively, side)
        stir_fingers(c, t, person, lively)
        # The hand at the ear closes last: its grip replaces what stirs its fingers.
        a = arm_of(c, side)
        grip(a, builds[r])
        speak(c, t, person, numbers[r, 2])


@compiled
def text_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who read and type on a phone. `numbers` (n, …): lively, hand."""
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        c[:] = 0.0
        lively, side = numbers[r, 0], int(numbers[r, 1])
        stand(c, t, b, person, lively)
        hang_arms(c, person)
        stir(c, t, person, 0.7 * lively)
        breathe(c, t, person, 1.0)
        # The head bows and the trunk leans towards the phone; the eyes attend 40° below.
        c[p.HEAD_PITCH] -= np.radians(15.0)
        c[p.TRUNK_LEAN] += np.radians(4.0)
        c[p.ATTEND], c[p.ATTEND + 1] = 1.0, 0.0
        c[p.ATTEND + 2] = -np.radians(40.0)
        # Somewhat more than half of the people type with both hands.
        both = chance(person, 331, 0) < 0.55
        for k in range(2):
            if k != side and not both:
                continue
            a = arm_of(c, k)
            reach = 0.58 * (b[p.B_UPPER_ARM] + b[p.B_FOREARM])
            drop = 0.80 * b[p.B_UPPER_ARM]
            hand_apart_m = 0.058 if both else 0.015
            place = (-hand_apart_m, b[p.B_SHOULDER_Y] - drop - 0.008 * k, -reach)
            hold(
                a,
                p.CHEST,
                1.0,
                place,
                (0.50 if both else 0.30, 0.30, -0.80),
                (0.40 if both else 0.22, 0.72, 0.50),
            )
            curl(a, 0.36, 0.44, 0.48, 0.50, 0.25)
            pole(a, -0.8, -1.0, 0.35)
            a[p.OPPOSE] = np.radians(30.0)
            typing = ease(1.6 * drift(t, 0.22, person, 332))
            a[p.THUMB] += 0.30 * typing * max(0.0, drift(t, 1.6, person, 333 + k))


@compiled
def board_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who watch a board.

    `numbers` (n, …): how lively, way of the arms, yaw and pitch of the board from the front.
    """
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        c[:] = 0.0
        lively = numbers[r, 0]
        stand(c, t, b, person, lively)
        arms_of(c, b, int(numbers[r, 1]), person)
        stir(c, t, person, lively)
        breathe(c, t, person, 1.0)
        # The gaze kernels turn head and eyes to the board; here only its direction is noted.
        c[p.ATTEND], c[p.ATTEND + 1], c[p.ATTEND + 2] = 1.0, numbers[r, 2], numbers[r, 3]


@compiled
def _gesture(a: Vector, b: Vector, t_s: float, person: int, side: int, size: float) -> float:
    """Move one speaking hand through its gestures; return the beat that goes with the voice."""
    every = 1.7
    k = int(np.floor(t_s / every))
    if t_s < (k + 0.45 * chance(person, 341, k)) * every:
        k -= 1
    start = (k + 0.45 * chance(person, 341, k)) * every
    share = ease((t_s - start) / 0.62)
    reach = b[p.B_UPPER_ARM] + b[p.B_FOREARM]
    at = np.empty((2, 6))
    for j in range(2):
        n = k - 1 + j
        # One hand leads in some gestures, both take part in others, and now and then both rest.
        active = chance(person, 342, n)
        takes_part = active > 0.25 and (active > 0.6 or int(active * 97.0) % 2 == side)
        u, v, w = chance(person, 343 + side, n), chance(person, 345, n), chance(person, 347, n)
        part = size if takes_part else 0.0
        at[j, 0] = -0.16 * reach - part * 0.22 * reach * (u - 0.25)
        at[j, 1] = -0.44 * reach + part * 0.34 * reach * v
        at[j, 2] = -0.42 * reach - part * 0.20 * reach * w
        palm_up = part * (2.0 * chance(person, 348 + side, n) - 0.9)
        at[j, 3], at[j, 4], at[j, 5] = 0.9 - 0.4 * part, 0.15 + 0.35 * palm_up, part
    x, y, z, inward, upward, part = (1.0 - share) * at[0] + share * at[1]
    beat = 0.0
    if part > 0.05:
        # Beats of the voice: short strokes down.
        beat = part * max(0.0, drift(t_s, 1.1, person, 350)) ** 2
    place = (x, b[p.B_SHOULDER_Y] + y - 0.035 * beat, z - 0.02 * beat)
    hold(
        a,
        p.CHEST,
        1.0,
        place,
        (0.45, 0.22 + 0.25 * part - 0.2 * beat, -0.85),
        (inward, upward - 0.25, 0.25),
    )
    pole(a, -0.75, -1.0, 0.45)
    loose = 0.30 - 0.17 * part
    curl(a, loose - 0.06, loose, loose + 0.05, loose + 0.10, 0.25 - 0.1 * part)
    return beat


@compiled
def talk_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who talk with gestures.

    `numbers` (n, …): how lively, size of gestures, loudness, seat in metres (0 stands).
    """
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        lively, size = numbers[r, 0], numbers[r, 1]
        _at_ease(c, t, b, numbers[r, 3], person, lively, BOTH)
        speak(c, t, person, numbers[r, 2])
        beat = 0.0
        for side in range(2):
            beat = max(beat, _gesture(arm_of(c, side), b, t, person, side, size))
        # The head nods with the beat of the gesture and as the jaw opens.
        c[p.HEAD_PITCH] -= np.radians(3.5) * beat + np.radians(2.5) * c[p.JAW]
        nod, own = bump(t, 3.1, 0.7, person, 351)
        c[p.HEAD_YAW] += np.radians(7.0) * (own - 0.5) * nod
        c[p.HEAD_ROLL] += np.radians(4.0) * (own - 0.5) * nod
        c[p.TRUNK_LEAN] += np.radians(1.4) * beat


@compiled
def crouch_rows(
    rows: npt.NDArray[np.int64],
    t_s: Vector,
    persons: npt.NDArray[np.int64],
    numbers: Vector,
    builds: Vector,
    controls: Vector,
) -> None:
    """Write the posture of those who crouch. `numbers` (n, …): how lively, depth 0..1."""
    for i in range(rows.shape[0]):
        r = rows[i]
        c, b, person, t = controls[r], builds[r], persons[r], t_s[r]
        c[:] = 0.0
        lively, depth = numbers[r, 0], numbers[r, 1]
        stand(c, t, b, person, lively * (1.0 - 0.75 * depth))
        hang_arms(c, person)
        leg = b[p.B_LEG]
        c[p.HIPS + 1] -= 0.60 * leg * depth
        c[p.HIPS + 2] += 0.135 * leg * depth
        c[p.HIPS_LEAN] += np.radians(14.0) * depth
        c[p.TRUNK_LEAN] += np.radians(22.0) * depth
        c[p.HEAD_PITCH] += np.radians(28.0) * depth
        rise = np.radians(26.0) * ease((depth - 0.15) / 0.75)
        for side in range(2):
            sign = -1.0 if side == 0 else 1.0
            foot = c[p.LEG + side * p.LEG_SIZE : p.LEG + (side + 1) * p.LEG_SIZE]
            foot[p.ANKLE] += sign * 0.02 * depth
            foot[p.FOOT_YAW] -= sign * np.radians(5.0) * depth
            foot[p.KNEE_OUT] += np.radians(5.0) * depth
            foot[p.FOOT_PITCH], foot[p.TOE_BEND] = rise, rise
            # The ball of the foot stays where it is.
            over, ahead = b[p.B_ANKLE] - b[p.B_BALL_Y], b[p.B_FOOT]
            foot[p.ANKLE + 1] = b[p.B_BALL_Y] + over * np.cos(rise) + ahead * np.sin(rise)
            forward = ahead * (1.0 - np.cos(rise)) + over * np.sin(rise)
            foot[p.ANKLE] -= forward * np.sin(foot[p.FOOT_YAW])
            foot[p.ANKLE + 2] -= forward * np.cos(foot[p.FOOT_YAW])
            a = arm_of(c, side)
            weight = ease(2.0 * depth)
            place = (0.070, -(0.84 + 0.24 * depth) * b[p.B_THIGH], -b[p.B_THIGH_RADIUS] - 0.035)
            hold(a, p.THIGH, weight, place, (0.70, -0.70, 0.60), (0.15, -0.1, 1.0))
            pole(a, -0.55, -0.9, 0.45)
        stir(c, t, person, 0.6 * lively)
        breathe(c, t, person, 1.2)
