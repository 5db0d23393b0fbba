"""Shifts of gaze shared by eyes, head and trunk, compiled.

The eyes go first, by a saccade of the main sequence; the head follows after a lag and more slowly,
and while it does, the eyes turn back in it and stay on the target. Far targets bring the trunk
along. Every shift starts from the state that earlier ones have left, so that schedules may be
dense.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.gaze.behaviour import SACCADE_BASE_MS, SACCADE_MS_PER_DEG
from visavis.stimuli.gaze.blinks import CLOSED_01, CLOSING_01
from visavis.stimuli.motion.quaternion_kernels import (
    Quat,
    Triple,
    dot,
    inverse,
    minus,
    plus,
    quat_of,
    rotate_vector,
    scale_vector,
    unit_of,
)
from visavis.stimuli.motion.rhythm_kernels import chance, ease

AROUND, POINT, PERSON, OBSERVER, ASIDE = 0, 1, 2, 3, 4
"""Kinds of targets: surroundings, a point, a person, the observer, a direction (yaw, pitch in
radians from the front of the body)."""
RECENT = 5
"""Number of earlier shifts that a body may still be completing."""
MAX_TURN_S = 2.0
"""Head and trunk have reached any target after this long, whoever turns; the eyes do sooner."""
AROUND_MEAN_S = 2.6
BLINK_MEAN_S = 3.75
EVOKES_BLINK_RAD = np.radians(33.0)
"""Shifts larger than this mostly come with a blink (Evinger et al. 1994, Exp Brain Res 100:337)."""
AHEAD: Triple = (0.0, 0.0, -1.0)


class Schedule(NamedTuple):
    """The looks of n people in order of time: those of person r are rows `first[r]:first[r + 1]`.

    A row is the kind of its target, when it starts, and a vector (3,): the place of a point, the
    number of a person, or yaw and pitch aside.
    """

    first: npt.NDArray[np.int64]
    kinds: npt.NDArray[np.int64]
    start_s: Vector
    vectors: Vector


@compiled
def _softly_above(x: float, width: float) -> float:
    """Return max(x, 0) with its corner rounded over `width`."""
    return float(0.5 * (x + np.sqrt(x * x + width * width)) - 0.5 * width)


@compiled
def _along(yaw: float, pitch: float) -> Triple:
    return -np.sin(yaw) * np.cos(pitch), np.sin(pitch), -np.cos(yaw) * np.cos(pitch)


@compiled
def _around(person: int, slot: int, front: float, attend: Vector) -> Triple:
    """Return the gaze direction of a person without a target: mostly ahead, now and then to a side.

    A person busy with something (`attend`: 1, yaw, pitch) looks there most of the time.
    """
    u, v = chance(person, 201, slot), chance(person, 202, slot)
    wide = chance(person, 203, slot)
    yaw = np.radians(84.0 if wide < 0.22 else 22.0) * (u - 0.5)
    pitch = np.radians(-4.0 + (10.0 if wide < 0.22 else 12.0) * (v - 0.6))
    # The weight is between 0 and 1 only while one activity passes into another.
    busy = attend[0] if wide > 0.15 else 0.0
    if busy > 0.0:
        spread = np.radians(5.0)
        yaw = (1.0 - busy) * yaw + attend[1] + busy * spread * (u - 0.5)
        pitch = (1.0 - busy) * pitch + attend[2] + busy * spread * (v - 0.5)
    return _along(front + yaw, pitch)


@compiled
def around_start_s(person: int, slot: int) -> float:
    """Return when the look number `slot` of somebody without a target begins."""
    return float((slot + 0.75 * chance(person, 204, slot)) * AROUND_MEAN_S)


@compiled
def _target(
    kind: int, vector: Vector, front: float, eyes: Vector, r: int, observer: Vector
) -> tuple[Triple, float]:
    """Return the direction from the eyes to a target and its distance, infinite if it has none."""
    if kind == ASIDE:
        return _along(front + vector[0], vector[1]), np.inf
    # People are looked at in the eyes, wherever these are by now.
    goal = vector[0], vector[1], vector[2]
    if kind == PERSON:
        other = int(vector[0])
        goal = eyes[other, 0], eyes[other, 1], eyes[other, 2]
    elif kind == OBSERVER:
        goal = observer[0], observer[1], observer[2]
    to = minus(goal, (eyes[r, 0], eyes[r, 1], eyes[r, 2]))
    return unit_of(to, AHEAD), np.sqrt(dot(to, to))


@compiled
def _away_01(size: float) -> float:
    """Return 0 for a target in front, rising without a kink to 1 where it lies 6° aside.

    The rounded corners leave a little turning even for a shift of nothing. Times a sign that
    changes with the side on which the target lies, that would be a twitch.
    """
    x = min(1.0, size / 0.105)
    return float(x * x * (3.0 - 2.0 * x))


@compiled
def shares_rad(yaw: float, pitch: float, person: int) -> Triple:
    """Return how far trunk (yaw) and head (yaw, pitch) turn for a target.

    Small shifts are left to the eyes; how much of a larger one the head takes is a habit of the
    person (Stahl 1999, Exp Brain Res 126:41). What remains for the eyes is 22° sideways and 16°
    up or down at most, until the neck ends.
    """
    size, side = abs(yaw), 1.0 if yaw >= 0.0 else -1.0
    # Nobody turns to what is right behind: it would be on the other side a moment later.
    x = min(1.0, max(0.0, (size - 2.18) / 0.9))
    size *= 1.0 - x * x * (3.0 - 2.0 * x)
    trunk = 0.55 * _softly_above(size - np.radians(52.0), 0.25)
    trunk -= _softly_above(trunk - np.radians(40.0), 0.15)
    rest = size - trunk
    gain = 0.45 + 0.45 * chance(person, 211, 0)
    spare = np.radians(5.0 + 9.0 * chance(person, 212, 0))
    usual = gain * _softly_above(rest - spare, 0.10)
    head = usual + _softly_above(rest - np.radians(20.0) - usual, 0.05)
    head -= _softly_above(head - np.radians(66.0), 0.10)
    up, sign = abs(pitch), 1.0 if pitch >= 0.0 else -1.0
    nod = 0.5 * _softly_above(up - np.radians(5.0), 0.08)
    nod += _softly_above(up - np.radians(15.0) - nod, 0.05)
    nod -= _softly_above(nod - np.radians(38.0), 0.10)
    side *= _away_01(size)
    return side * trunk, side * head, sign * _away_01(up) * nod


@compiled
def _slot_at(t_s: float, person: int) -> int:
    slot = int(np.floor(t_s / AROUND_MEAN_S))
    return slot if around_start_s(person, slot) <= t_s else slot - 1


@compiled
def glance_around(
    since_s: float,
    until_s: float,
    person: int,
    front: float,
    attend: Vector,
    looks: Vector,
    count: int,
) -> int:
    """Write, after the first `count`, the looks of somebody who looks around; return how many there
    are then. Of those between two times the last `RECENT` still matter, and the one before them.
    """
    slot, back = _slot_at(until_s, person), 0
    while back < RECENT and around_start_s(person, slot - back) > since_s:
        back += 1
    for k in range(back, -1, -1):
        to = _around(person, slot - k, front, attend)
        looks[count, 0] = max(since_s, around_start_s(person, slot - k))
        looks[count, 1], looks[count, 2], looks[count, 3] = to[0], to[1], to[2]
        looks[count, 4] = np.inf
        count += 1
    return count


@compiled
def recent_looks(
    t_s: float,
    r: int,
    schedule: Schedule,
    eyes_m: Vector,
    front: Vector,
    person: int,
    observer: Vector,
    looks: Vector,
) -> int:
    """Write the looks that still matter, in order, and return how many.

    A row of `looks` is start, direction (3,) from the eyes in world, distance.
    """
    first, kinds, start_s, vectors = schedule
    low, last = first[r], first[r + 1] - 1
    ahead, attend = front[0], front[1:]
    while last > low and start_s[last] > t_s:
        last -= 1
    count = 0
    for row in range(max(low, last - RECENT), max(low, last) + 1):
        kind, since, until = AROUND, -np.inf, t_s
        # Without a schedule somebody looks around all the time.
        if low < first[r + 1]:
            kind, since = kinds[row], start_s[row]
            if row < last:
                until = start_s[row + 1]
        if kind == AROUND:
            count = glance_around(since, until, person, ahead, attend, looks, count)
        else:
            to, far = _target(kind, vectors[row], ahead, eyes_m, r, observer)
            looks[count, 0], looks[count, 4] = since, far
            looks[count, 1], looks[count, 2], looks[count, 3] = to[0], to[1], to[2]
            count += 1
    return count


@compiled
def turn_to(t_s: float, looks: Vector, head_wxyz: Quat, person: int) -> Triple:
    """Return what trunk and head add after looks (n, 5): yaw of the trunk, yaw and pitch of the
    head.
    """
    to_head = inverse(head_wxyz)
    # Seconds by which the head follows the eyes, and how slowly this person turns.
    lag = 0.03 + 0.05 * chance(person, 213, 0)
    slow = 0.85 + 0.4 * chance(person, 214, 0)
    trunk, head, nod = 0.0, 0.0, 0.0
    # Nothing is left of what came before a turn that has ended.
    first = looks.shape[0] - 1
    while first > 0 and t_s - looks[first, 0] < MAX_TURN_S:
        first -= 1
    for i in range(first, looks.shape[0]):
        target = rotate_vector(to_head, (looks[i, 1], looks[i, 2], looks[i, 3]))
        pitch = np.arcsin(min(1.0, max(-1.0, target[1])))
        goal = shares_rad(np.arctan2(-target[0], -target[2]), pitch, person)
        if i == first:
            trunk, head, nod = goal
            continue
        since = t_s - looks[i, 0]
        # Turns are played one after another from where each left off, so that none ever jumps.
        size = np.hypot(goal[1] - head, goal[2] - nod)
        s = ease((since - lag) / (slow * (0.26 + 0.40 * size)))
        head, nod = head + s * (goal[1] - head), nod + s * (goal[2] - nod)
        size = abs(goal[0] - trunk)
        s = ease((since - 2.2 * lag) / (slow * (0.45 + 0.55 * size)))
        trunk += s * (goal[0] - trunk)
    return trunk, head, nod


@compiled
def turn_rows(
    t_s: float,
    schedule: Schedule,
    eyes_m: Vector,
    head_wxyz: Vector,
    fronts: Vector,
    seeds: npt.NDArray[np.int64],
    observer: Vector,
    out: Vector,
) -> None:
    """Write what trunk and head add (n, 3): yaw of the trunk, yaw and pitch of the head."""
    looks = np.empty(((RECENT + 1) ** 2, 5))
    for r in range(eyes_m.shape[0]):
        person, head = seeds[r], quat_of(head_wxyz[r])
        count = recent_looks(t_s, r, schedule, eyes_m, fronts[r], person, observer, looks)
        out[r, 0], out[r, 1], out[r, 2] = turn_to(t_s, looks[:count], head, person)


@compiled
def _slerp(a: Triple, b: Triple, angle: float, share: float) -> Triple:
    # No arc is given between equal or opposite directions; the sine below would be 0.
    if angle < 1e-7 or np.pi - angle < 1e-7:
        return b if share > 0.5 else a
    s = np.sin(angle)
    return plus(
        scale_vector(a, np.sin((1.0 - share) * angle) / s),
        scale_vector(b, np.sin(share * angle) / s),
    )


@compiled
def _lids(t_s: float, start_s: float, lasting_s: float) -> float:
    """Return how open the lids are during a blink."""
    tau = (t_s - start_s) / lasting_s
    if tau <= 0.0 or tau >= 1.0:
        return 1.0
    part = 0.0
    if tau < CLOSING_01:
        part = 1.0 - tau / CLOSING_01
    elif tau > CLOSING_01 + CLOSED_01:
        part = (tau - CLOSING_01 - CLOSED_01) / (1.0 - CLOSING_01 - CLOSED_01)
    return part * part * (3.0 - 2.0 * part)


@compiled
def openness_01(t_s: float, person: int) -> float:
    """Return how open somebody's lids are who blinks about 16 times a minute."""
    # One blink a slot, at a random time in it: any instant is known without its past. A blink that
    # began late in the slot before may still go on.
    slot = int(np.floor(t_s / BLINK_MEAN_S))
    least = 1.0
    for k in range(slot - 1, slot + 1):
        start = (k + 0.85 * chance(person, 221, k)) * BLINK_MEAN_S
        lasting = 0.17 + 0.14 * chance(person, 222, k)
        least = min(least, _lids(t_s, start, lasting))
    return least


@compiled
def gaze_rows(
    t_s: float,
    schedule: Schedule,
    eyes_m: Vector,
    fronts: Vector,
    seeds: npt.NDArray[np.int64],
    observer: Vector,
    direction: Vector,
    distance_m: Vector,
    openness: Vector,
) -> None:
    """Write where the eyes point (n, 3), at what distance (n,), and how open they are (n,)."""
    looks = np.empty(((RECENT + 1) ** 2, 5))
    for r in range(eyes_m.shape[0]):
        person = seeds[r]
        count = recent_looks(t_s, r, schedule, eyes_m, fronts[r], person, observer, looks)
        now, nearness = (looks[0, 1], looks[0, 2], looks[0, 3]), 1.0 / max(0.1, looks[0, 4])
        lids = openness_01(t_s, person)
        for i in range(1, count):
            to = looks[i, 1], looks[i, 2], looks[i, 3]
            difference, together = minus(to, now), plus(to, now)
            angle = 2.0 * np.arctan2(
                np.sqrt(dot(difference, difference)), np.sqrt(dot(together, together))
            )
            # Main sequence: a saccade lasts longer the farther it goes.
            lasting = 1e-3 * (SACCADE_BASE_MS + SACCADE_MS_PER_DEG * np.degrees(angle))
            since = t_s - looks[i, 0]
            s = ease(since / lasting)
            if angle > EVOKES_BLINK_RAD and chance(person, 223, int(1000.0 * looks[i, 0])) < 0.6:
                lids = min(lids, _lids(since, 0.0, 0.24))
            now = unit_of(_slerp(now, to, angle, s), to)
            # Vergence moves in dioptres (1/m), in which the eyes' own effort is even.
            nearness += s * (1.0 / max(0.1, looks[i, 4]) - nearness)
        direction[r, 0], direction[r, 1], direction[r, 2] = now[0], now[1], now[2]
        distance_m[r] = 1.0 / nearness if nearness > 1e-6 else np.inf
        openness[r] = lids
