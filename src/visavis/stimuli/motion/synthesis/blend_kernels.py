"""Compiled blending of example motions at a phase; `example_blend` states the formulas."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.quaternion_kernels import (
    Quat,
    Triple,
    about,
    between,
    cross,
    dot,
    inverse,
    minus,
    plus,
    quat_of,
    rotate_vector,
    scale_vector,
    times,
    triple_of,
    unit_of,
)
from visavis.stimuli.motion.slerp_kernels import slerp_one

Index = npt.NDArray[np.int64]

SQUARINGS = 12
"""The moment of the rotations is squared so often to leave its greatest eigenvector alone."""
STRAIGHT = 0.99999
"""A leg is stretched to so much of its length at most."""
PARALLEL = 1e-6
"""Sine of the angle at a knee below which thigh and shin count as one line."""
PASSING_M = 0.005
"""While the heel rises so far above the ball's sole, the foot passes from heel to ball."""


@compiled
def add_rotation(q: Quat, weight: float, moment: Vector) -> None:
    """Add weight · q qᵀ to the moment (4, 4)."""
    for i in range(4):
        for j in range(4):
            moment[i, j] += weight * q[i] * q[j]


@compiled
def mean_rotation(moment: Vector, near: Quat) -> Quat:
    """Return the greatest eigenvector of a moment (4, 4), in the hemisphere of `near`."""
    m = moment.copy()
    square = np.empty((4, 4))
    for _ in range(SQUARINGS):
        trace = m[0, 0] + m[1, 1] + m[2, 2] + m[3, 3]
        for i in range(4):
            for j in range(i, 4):
                total = 0.0
                for k in range(4):
                    total += m[i, k] * m[k, j]
                square[i, j] = total / (trace * trace)
                square[j, i] = square[i, j]
        m[:] = square
    column = 0
    for i in range(1, 4):
        if m[i, i] > m[column, column]:
            column = i
    w, x, y, z = m[0, column], m[1, column], m[2, column], m[3, column]
    n = np.sqrt(w * w + x * x + y * y + z * z)
    if w * near[0] + x * near[1] + y * near[2] + z * near[3] < 0.0:
        n = -n
    return w / n, x / n, y / n, z / n


@compiled
def _between_frames(rows: Vector, here: int, after: int, share: float) -> Quat:
    a, b = quat_of(rows[here]), quat_of(rows[after])
    sign = 1.0 if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] >= 0.0 else -1.0
    return slerp_one(
        a[0], a[1], a[2], a[3], sign * b[0], sign * b[1], sign * b[2], sign * b[3], share
    )


@compiled
def _put(rows: Vector, row: int, q: Quat) -> None:
    rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3] = q[0], q[1], q[2], q[3]


@compiled
def _place_all(
    parents: Index, offsets: Vector, root: Vector, turns: Vector, place: Vector, world: Vector
) -> None:
    place[0], world[0] = root, turns[0]
    for j in range(1, len(parents)):
        above = quat_of(world[parents[j]])
        at = plus(triple_of(place[parents[j]]), rotate_vector(above, triple_of(offsets[j])))
        place[j, 0], place[j, 1], place[j, 2] = at
        _put(world, j, times(above, quat_of(turns[j])))


@compiled
def heel_to_ball(foot_turn: Quat, heel: Triple, ball: Triple, goal_m: Vector) -> Triple:
    """Return from where the heel's goal wants the ankle to where the ball's goal does."""
    apart = minus(triple_of(goal_m[1]), triple_of(goal_m[0]))
    return minus(apart, rotate_vector(foot_turn, minus(ball, heel)))


@compiled
def _lead_leg(
    foot: int,
    toes: int,
    parents: Index,
    offsets: Vector,
    heel: Triple,
    goal_m: Vector,
    goal_turns: Vector,
    gap: Triple,
    place: Vector,
    world: Vector,
    turns: Vector,
) -> None:
    """Bring heel and ball of one foot to `goal_m` (2, 3), turned as `goal_turns` (2, 4)."""
    shin, thigh = parents[foot], parents[parents[foot]]
    hips = parents[thigh]
    # The foot stands on what is lower, heel or ball: that one stays where it came down flat.
    foot_turn, ball = quat_of(goal_turns[0]), triple_of(offsets[toes])
    heel_up = goal_m[0, 1] - (goal_m[1, 1] - (ball[1] - heel[1]))
    on_ball = min(1.0, max(0.0, heel_up / PASSING_M))
    by_heel = minus(triple_of(goal_m[0]), rotate_vector(foot_turn, heel))
    ahead = minus(heel_to_ball(foot_turn, heel, ball, goal_m), gap)
    ankle = plus(by_heel, scale_vector(ahead, on_ball))
    hip_at, knee_at = triple_of(place[thigh]), triple_of(place[shin])
    ankle_at = triple_of(place[foot])
    up, down = minus(hip_at, knee_at), minus(ankle_at, knee_at)
    l1, l2 = np.sqrt(dot(up, up)), np.sqrt(dot(down, down))
    to = minus(ankle, hip_at)
    reach = min(STRAIGHT * (l1 + l2), max(abs(l1 - l2) / STRAIGHT, np.sqrt(dot(to, to))))
    # The knee bends in its own plane until the ankle is as far from the hip as its goal.
    thigh_turn = quat_of(world[thigh])
    square = scale_vector(cross(up, down), 1.0 / (l1 * l2))
    hinge = unit_of(square, (1.0, 0.0, 0.0))
    if dot(square, square) < PARALLEL * PARALLEL:
        hinge = rotate_vector(thigh_turn, (1.0, 0.0, 0.0))
    before = np.arccos(min(1.0, max(-1.0, dot(up, down) / (l1 * l2))))
    after = np.arccos(min(1.0, max(-1.0, (l1 * l1 + l2 * l2 - reach * reach) / (2.0 * l1 * l2))))
    bend = about(hinge, after - before)
    knee_offset = minus(plus(knee_at, rotate_vector(bend, down)), hip_at)
    # Then the whole leg turns about the hip by the smallest angle that leads there.
    swing = between(unit_of(knee_offset, (0.0, -1.0, 0.0)), unit_of(to, (0.0, -1.0, 0.0)))
    thigh_turn = times(swing, thigh_turn)
    shin_turn = times(swing, times(bend, quat_of(world[shin])))
    _put(turns, thigh, times(inverse(quat_of(world[hips])), thigh_turn))
    _put(turns, shin, times(inverse(thigh_turn), shin_turn))
    _put(turns, foot, times(inverse(shin_turn), foot_turn))
    _put(turns, toes, times(inverse(foot_turn), quat_of(goal_turns[1])))


@compiled
def _flat_gap(
    side: int,
    phase: float,
    weights: Vector,
    key_s: Vector,
    first: Index,
    frame_s: float,
    foot_m: Vector,
    foot_turns: Vector,
    heel: Triple,
    ball: Triple,
) -> Triple:
    """Return `heel_to_ball` of a foot at the phase where it stands flat."""
    moment, goal_m = np.zeros((4, 4)), np.zeros((2, 3))
    near, most = (1.0, 0.0, 0.0, 0.0), 0.0
    k = min(key_s.shape[1] - 2, int(phase))
    for i in range(len(key_s)):
        w = weights[i]
        if w <= 0.0:
            continue
        at = ((1.0 - (phase - k)) * key_s[i, k] + (phase - k) * key_s[i, k + 1]) / frame_s
        here, after, share = _frames_at(at, first[i], first[i + 1])
        q = _between_frames(foot_turns[:, 2 * side], here, after, share)
        add_rotation(q, w, moment)
        if w > most:
            near, most = q, w
        if after > here:
            for f in range(2):
                for c in range(3):
                    a, b = foot_m[here, 2 * side + f, c], foot_m[after, 2 * side + f, c]
                    goal_m[f, c] += w * ((1.0 - share) * a + share * b)
        else:
            goal_m += w * foot_m[here, 2 * side : 2 * side + 2]
    return heel_to_ball(mean_rotation(moment, near), heel, ball, goal_m)


@compiled
def _frames_at(at: float, begin: int, end: int) -> tuple[int, int, float]:
    """Return the frames before and after a place in frames, and the share of the way between."""
    frame = min(end - begin - 1, int(at))
    here = begin + frame
    return here, here + 1 if here + 1 < end else begin, at - frame


class ExampleRows(NamedTuple):
    """The frames of n examples, stacked.

    `key_s` (n, K + 1) are key times; `first` (n + 1,) the rows at which examples begin in `turns`
    (S, J, 4), `root_m` (S, 3), `foot_m` (S, 4, 3) and `foot_turns` (S, 4, 4); `travel_m` (n, 3) how
    far a cycle goes; `tree` holds parents, offsets, the joints of ankles and balls (left ankle,
    left ball, right …), the heel (3,), and the phases at which left and right foot stand flat (2,).
    """

    key_s: Vector
    first: Index
    frame_s: float
    travel_m: Vector
    turns: Vector
    root_m: Vector
    foot_m: Vector
    foot_turns: Vector
    tree: tuple[Index, Vector, Index, Vector, Vector]


@compiled
def blend_rows(
    phases: Vector,
    weights: Vector,
    examples: ExampleRows,
    root_out: Vector,
    turns_out: Vector,
) -> None:
    """Write roots (m, 3) and turns (m, J, 4) of blends at phases (m,) from 0 to K.

    `weights` (m, n) are those of the examples.
    """
    key_s, first, frame_s, travel_m, turns, root_m, foot_m, foot_turns, tree = examples
    parents, offsets, feet, heel_m, flat_phases = tree
    heel = triple_of(heel_m)
    joints, n, last_key = turns.shape[1], len(key_s), key_s.shape[1] - 1
    moments = np.empty((joints + 4, 4, 4))
    heaviest = np.empty((joints + 4, 4))
    goal_m, goal_turns = np.empty((4, 3)), np.empty((4, 4))
    place, world = np.empty((joints, 3)), np.empty((joints, 4))
    for r in range(len(phases)):
        moments[:] = 0.0
        goal_m[:] = 0.0
        root, out = root_out[r], turns_out[r]
        root[:] = 0.0
        most = 0.0
        k = min(last_key - 1, int(phases[r]))
        h = phases[r] - k
        for i in range(n):
            w = weights[r, i]
            if w <= 0.0:
                continue
            at = ((1.0 - h) * key_s[i, k] + h * key_s[i, k + 1]) / frame_s
            here, after, share = _frames_at(at, first[i], first[i + 1])
            for c in range(3):
                way = travel_m[i, c] if after < here else 0.0
                root[c] += w * ((1.0 - share) * root_m[here, c] + share * (root_m[after, c] + way))
                for f in range(4):
                    goal_m[f, c] += w * (
                        (1.0 - share) * foot_m[here, f, c] + share * (foot_m[after, f, c] + way)
                    )
            is_heaviest = w > most
            most = max(most, w)
            for j in range(joints + 4):
                if j < joints:
                    q = _between_frames(turns[:, j], here, after, share)
                else:
                    q = _between_frames(foot_turns[:, j - joints], here, after, share)
                add_rotation(q, w, moments[j])
                if is_heaviest:
                    _put(heaviest, j, q)
        for j in range(joints):
            _put(out, j, mean_rotation(moments[j], quat_of(heaviest[j])))
        for f in range(4):
            q = mean_rotation(moments[joints + f], quat_of(heaviest[joints + f]))
            _put(goal_turns, f, q)
        _place_all(parents, offsets, root, out, place, world)
        for side in range(2):
            s = slice(2 * side, 2 * side + 2)
            ball = triple_of(offsets[feet[2 * side + 1]])
            gap = _flat_gap(
                side,
                flat_phases[side],
                weights[r],
                key_s,
                first,
                frame_s,
                foot_m,
                foot_turns,
                heel,
                ball,
            )
            _lead_leg(
                feet[2 * side],
                feet[2 * side + 1],
                parents,
                offsets,
                heel,
                goal_m[s],
                goal_turns[s],
                gap,
                place,
                world,
                out,
            )
