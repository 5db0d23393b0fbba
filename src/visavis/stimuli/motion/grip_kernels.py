"""Bend one finger or thumb in many ways and find the one that lies best at a flat case."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.posture_kernels import finger_turns, thumb_turns
from visavis.stimuli.motion.quaternion_kernels import (
    Quat,
    Triple,
    dot,
    minus,
    plus,
    rotate_vector,
    times,
)

THUMB, FINGER = 0, 1
BETWEEN_M = 0.0005
"""Between skin and case: where fingers meet, one follows its neighbour a little."""
OVER_M = 0.004
"""The middle of a finger's end is so far beyond the edge, if the finger is long enough."""
FINGER_TOUCHES = (0.0, 0.1, 1.0)
THUMB_TOUCHES = (0.0, 0.3, 1.0)
"""Weights of a gap between phalanx and case, from the knuckle on. The weights below are relative to
these."""
GOES_IN = 100.0
"""Weight of a phalanx inside the case or the cheek."""
HOOKS = 0.3
"""Weight of a finger's end that does not reach over the edge."""
LIES_M2, FLAT = 1e-4, 0.05
"""Weights of a thumb that does not point along its edge or lie at its middle."""
EASY_M2 = 1e-4
EASY_CURL, EASY_KNUCKLE = 0.42, 0.15
"""Weight of a bend unlike that of a relaxed hand; knuckles count less."""
THUMB_EASY_M2 = 4e-6


class Digit(NamedTuple):
    """Skin of a finger or thumb: points (k, 3) at rest from the wrist, their weights (k, 4) of
    hand and phalanges, to which of those each belongs (k,); the joints (3, 3) from the wrist.
    """

    points_m: Vector
    weights: Vector
    phalanx: npt.NDArray[np.int64]
    joints_m: Vector


class Case(NamedTuple):
    """A flat box in a hand at rest, in metres from its wrist: `middle_m` (3,), `axes` (3, 3) as
    rows (its length, across it towards the finger tips, out of the palm), half its size (3,).
    """

    middle_m: Vector
    axes: Vector
    half_m: Vector


class Search(NamedTuple):
    """Bends between `least` and `most` (3,) to try: first `counts` (3,) of each, evenly, then
    `rounds` times half as far about the best.
    """

    least: Vector
    most: Vector
    counts: npt.NDArray[np.int64]
    rounds: int


@compiled
def _seen_by_case(
    moves: Vector, row: int, q: Quat, at: Triple, joint: Triple, middle: Triple, axes: Vector
) -> None:
    """Write the move (3, 4) that takes points at rest to the case's axes with a bone that is turned
    by `q` and whose joint is at `at`.
    """
    x, y, z = (
        rotate_vector(q, (1.0, 0.0, 0.0)),
        rotate_vector(q, (0.0, 1.0, 0.0)),
        rotate_vector(q, (0.0, 0.0, 1.0)),
    )
    # A point p at rest goes to q (p − joint) + at; what of that is constant is the shift.
    shift = minus(minus(at, rotate_vector(q, joint)), middle)
    for i in range(3):
        axis = (axes[i, 0], axes[i, 1], axes[i, 2])
        moves[row, i, 0], moves[row, i, 1] = dot(axis, x), dot(axis, y)
        moves[row, i, 2], moves[row, i, 3] = dot(axis, z), dot(axis, shift)


@compiled
def _cost(
    digit: Digit, turns: tuple[Quat, Quat, Quat], case: Case, room_m: Vector, which: int
) -> float:
    """Return how badly a digit that is turned so lies at the case, in m²."""
    points, weights, phalanx, joints = digit
    middle_m, axes, half = case
    middle = (middle_m[0], middle_m[1], middle_m[2])
    a = (joints[0, 0], joints[0, 1], joints[0, 2])
    b = (joints[1, 0], joints[1, 1], joints[1, 2])
    c = (joints[2, 0], joints[2, 1], joints[2, 2])
    # Chain the three joints, then write every bone's movement in the axes of the case.
    first = turns[0]
    second = times(first, turns[1])
    at_b = plus(a, rotate_vector(first, minus(b, a)))
    at_c = plus(at_b, rotate_vector(second, minus(c, b)))
    moves = np.empty((4, 3, 4))
    _seen_by_case(moves, 0, (1.0, 0.0, 0.0, 0.0), a, a, middle, axes)
    _seen_by_case(moves, 1, first, a, a, middle, axes)
    _seen_by_case(moves, 2, second, at_b, b, middle, axes)
    _seen_by_case(moves, 3, times(second, turns[2]), at_c, c, middle, axes)
    nearest = np.full(3, 1.0)
    sums, counts = np.zeros((3, 3)), np.zeros(3)
    point = np.empty(3)
    beyond = 0.0
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        point[:] = 0.0
        for bone in range(4):
            w = weights[k, bone]
            if w > 0.0:
                for i in range(3):
                    m = moves[bone, i]
                    point[i] += w * (m[0] * x + m[1] * y + m[2] * z + m[3])
        # Signed distance to a box: negative inside, where only the least deep axis counts.
        u, v, w = abs(point[0]) - half[0], abs(point[1]) - half[1], abs(point[2]) - half[2]
        gap = min(max(u, v, w), 0.0)
        u, v, w = max(u, 0.0), max(v, 0.0), max(w, 0.0)
        gap += np.sqrt(u * u + v * v + w * w)
        of = phalanx[k]
        nearest[of] = min(nearest[of], gap)
        counts[of] += 1.0
        for i in range(3):
            sums[of, i] += point[i]
        # How far a finger may stand out before the case there: the face's skin leaves little room.
        share = min(max(0.5 + 0.5 * point[0] / half[0], 0.0), 1.0) * (room_m.shape[0] - 1)
        below = min(int(share), room_m.shape[0] - 2)
        deep = room_m[below] + (share - below) * (room_m[below + 1] - room_m[below])
        beyond = max(beyond, point[2] - half[2] - deep)
    # All terms are squared metres: going in costs more than staying off.
    cost = GOES_IN * beyond * beyond
    for of in range(3):
        matters = FINGER_TOUCHES[of] if which == FINGER else THUMB_TOUCHES[of]
        off = nearest[of] - BETWEEN_M
        cost += matters * max(off, 0.0) ** 2 + GOES_IN * min(off, 0.0) ** 2
        for i in range(3):
            sums[of, i] /= max(counts[of], 1.0)
    if which == FINGER:
        # Fingers hook over the edge; the thumb lies flat along the side.
        cost += HOOKS * max(half[1] + OVER_M - sums[2, 1], 0.0) ** 2
    else:
        u, v, w = sums[2, 0] - sums[1, 0], sums[2, 1] - sums[1, 1], sums[2, 2] - sums[1, 2]
        length = np.sqrt(u * u + v * v + w * w)
        cost += LIES_M2 * (1.0 - u / max(length, 1e-9)) + FLAT * sums[2, 2] ** 2
    return float(cost)


@compiled
def best_bend(
    digit: Digit, case: Case, room_m: Vector, which: int, spread_rad: float, search: Search
) -> Vector:
    """Return the bends (3,) that lie best: of a finger its curl, its knuckle and nothing, of the
    thumb how far it is in, opposed and bent.

    `room_m` is how far the digit may reach beyond the case's face, evenly spaced along it.
    """
    least, most, counts, rounds = search
    # A grid that shrinks: the cost has flat stretches on which a gradient would stop.
    step = (most - least) / np.maximum(counts - 1, 1)
    start, n_steps = least.copy(), counts.copy()
    best, best_turns = 1e9, least.copy()
    for _ in range(rounds + 1):
        for i in range(n_steps[0]):
            for j in range(n_steps[1]):
                for k in range(n_steps[2]):
                    u = min(max(start[0] + i * step[0], least[0]), most[0])
                    v = min(max(start[1] + j * step[1], least[1]), most[1])
                    w = min(max(start[2] + k * step[2], least[2]), most[2])
                    if which == FINGER:
                        # The knuckle is searched relative to −1.25 times the curl.
                        turns = finger_turns(u, v - 1.25 * u, spread_rad)
                        easy = EASY_M2 * ((u - EASY_CURL) ** 2 + 0.3 * (v - EASY_KNUCKLE) ** 2)
                    else:
                        turns = thumb_turns(w, v, u)
                        easy = THUMB_EASY_M2 * (u * u + v * v + w * w)
                    cost = easy + _cost(digit, turns, case, room_m, which)
                    if cost < best:
                        best = cost
                        best_turns[0], best_turns[1], best_turns[2] = u, v, w
        # From the second round on three of each: the best, and half a step to either side.
        step = step / 2.0
        for k in range(3):
            n_steps[k] = 3 if counts[k] > 1 else 1
            start[k] = best_turns[k] - step[k] if counts[k] > 1 else best_turns[k]
    return best_turns
