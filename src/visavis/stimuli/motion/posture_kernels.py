"""Turn rows of posture numbers into joint turns: trunk by angles, limbs by angles and two-bone
inverse kinematics. Works for any lengths of bones.
"""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.quaternion_kernels import (
    Quat,
    Triple,
    about,
    about_x,
    about_y,
    about_z,
    bend_for,
    cross,
    dot,
    frame_to_frame,
    inverse,
    limb_turn,
    minus,
    mirror_quat,
    mix_quats,
    of_axes,
    plus,
    quat_of,
    rotate_vector,
    scale_vector,
    square_to,
    times,
    twist_about,
    unit_of,
)
from visavis.stimuli.motion.rhythm_kernels import ease

MAX_KNEE = np.radians(150.0)
MAX_ELBOW = np.radians(146.0)
EASY_REACH = 0.93
"""Share of the arm's length that a hand at rest is away; straighter elbows cannot give way."""
MAX_FOREARM_TWIST = np.radians(80.0)
FAR_TWIST = np.radians(120.0)
"""From here on a forearm's twist falls back to none, half a turn away."""
MIN_WRIST = (np.radians(-36.0), np.radians(-70.0))
MAX_WRIST = (np.radians(42.0), np.radians(80.0))
"""Limits of a left wrist: towards thumb and little finger, back and palm."""
MIN_SHARE = 1e-9
"""A hold of less weight is none."""
FOREARM_SHARE = 0.5
"""Share of the forearm's twist at the elbow end; the rest is at the wrist."""
SPINE_SHARE = (0.30, 0.35, 0.35)
NECK_SHARE = 0.45
LEFT_X: Triple = (-1.0, 0.0, 0.0)
DOWN: Triple = (0.0, -1.0, 0.0)
BACK: Triple = (0.0, 0.0, 1.0)
KNEE_HINGE: Triple = (-1.0, 0.0, 0.0)
ELBOW_HINGE: Triple = (0.0, -1.0, 0.0)
THUMB_AXIS: Triple = (-0.4576969149723523, 0.8449789199489581, 0.2766300035547185)
"""Bends the left thumb towards the little finger; square to the thumb at rest."""


@compiled
def _put(turns: Vector, joint: int, q: Quat) -> None:
    """Write a turn, of its two signs the one with w >= 0."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    for k in range(4):
        turns[joint, k] = sign * q[k]


@compiled
def _set(rows: Vector, row: int, v: Triple) -> None:
    rows[row, 0], rows[row, 1], rows[row, 2] = v[0], v[1], v[2]


@compiled
def _vector(row: Vector, start: int) -> Triple:
    return row[start], row[start + 1], row[start + 2]


@compiled
def _outward(offsets: Vector, joint: int, side: int) -> Triple:
    """Return a bone, reflected to the left for side 1."""
    sign = 1.0 if side == 0 else -1.0
    return sign * offsets[joint, 0], offsets[joint, 1], offsets[joint, 2]


@compiled
def _head_turn(c: Vector, share: float) -> Quat:
    return times(
        times(about_y(share * c[p.HEAD_YAW]), about_x(share * c[p.HEAD_PITCH])),
        about_z(-share * c[p.HEAD_ROLL]),
    )


@compiled
def _trunk(c: Vector, offsets: Vector, turns: Vector, world: Vector, place: Vector) -> None:
    """Pose hips, spine, neck and head; write their turns, world turns and places (JOINTS rows)."""
    hips = times(times(about_y(c[p.HIPS_YAW]), about_x(-c[p.HIPS_LEAN])), about_z(-c[p.HIPS_ROLL]))
    _put(turns, p.J_HIPS, hips)
    _put(world, p.J_HIPS, hips)
    place[p.J_HIPS, 0], place[p.J_HIPS, 1], place[p.J_HIPS, 2] = (
        c[p.HIPS],
        c[p.HIPS + 1],
        c[p.HIPS + 2],
    )
    # Spine, chest and upper chest share the trunk's turn; neck and head share the head's.
    above, at = hips, _vector(c, p.HIPS)
    for i in range(5):
        joint = p.J_SPINE + i
        if i < 3:
            share = SPINE_SHARE[i]
            local = times(
                times(about_y(share * c[p.TRUNK_YAW]), about_x(-share * c[p.TRUNK_LEAN])),
                about_z(-share * c[p.TRUNK_ROLL]),
            )
        else:
            local = _head_turn(c, NECK_SHARE if i == 3 else 1.0 - NECK_SHARE)
        at = plus(at, rotate_vector(above, _vector(offsets[joint], 0)))
        above = times(above, local)
        _put(turns, joint, local)
        _put(world, joint, above)
        _set(place, joint, at)


@compiled
def _eyes_middle(offsets: Vector, world: Vector, place: Vector) -> Triple:
    """Return the point between the eyes."""
    between_eyes = scale_vector(
        plus(_vector(offsets[p.J_LEFT_EYE], 0), _vector(offsets[p.J_RIGHT_EYE], 0)), 0.5
    )
    return plus(_vector(place[p.J_HEAD], 0), rotate_vector(quat_of(world[p.J_HEAD]), between_eyes))


@compiled
def _leg(
    side: int, c: Vector, offsets: Vector, world: Vector, place: Vector, turns: Vector
) -> Quat:
    """Put the ankle where it belongs; return the thigh's turn in the (reflected) person frame."""
    start, first = p.LEG + side * p.LEG_SIZE, p.J_SIDE + side * p.SIDE_SIZE
    sign = 1.0 if side == 0 else -1.0
    hips, at = quat_of(world[p.J_HIPS]), _vector(place[p.J_HIPS], 0)
    if side == 1:
        hips, at = mirror_quat(hips), (-at[0], at[1], at[2])
    hip_at = plus(at, rotate_vector(hips, _outward(offsets, first + p.S_UPPER_LEG, side)))
    thigh = _outward(offsets, first + p.S_LOWER_LEG, side)
    shin = _outward(offsets, first + p.S_FOOT, side)
    ankle = (sign * c[start + p.ANKLE], c[start + p.ANKLE + 1], c[start + p.ANKLE + 2])
    to = minus(ankle, hip_at)
    foot_yaw, out = sign * c[start + p.FOOT_YAW], c[start + p.KNEE_OUT]
    # The knee looks where the foot points, a little towards where the hips do.
    look = 0.7 * foot_yaw + 0.3 * sign * c[p.HIPS_YAW] + out
    pole = (-np.sin(look), 0.25, -np.cos(look))
    bend = bend_for(thigh, shin, KNEE_HINGE, np.sqrt(dot(to, to)), MAX_KNEE)
    upper = limb_turn(thigh, shin, KNEE_HINGE, bend, to, pole)
    knee = about(KNEE_HINGE, bend)
    lower = times(upper, knee)
    foot = times(
        times(about_y(foot_yaw), about_x(-c[start + p.FOOT_PITCH])),
        about_z(sign * -c[start + p.FOOT_ROLL]),
    )
    local = times(inverse(hips), upper)
    ankle_turn = times(inverse(lower), foot)
    toes = about_x(c[start + p.TOE_BEND])
    if side == 1:
        local, knee, ankle_turn = mirror_quat(local), mirror_quat(knee), mirror_quat(ankle_turn)
    _put(turns, first + p.S_UPPER_LEG, local)
    _put(turns, first + p.S_LOWER_LEG, knee)
    _put(turns, first + p.S_FOOT, ankle_turn)
    _put(turns, first + p.S_TOES, toes)
    _set(place, first + p.S_UPPER_LEG, hip_at)
    return upper


@compiled
def spread_of(spread: float, finger: int) -> float:
    """Return by how much a finger turns towards the little finger."""
    return spread * (finger - 1.2) * 0.5


@compiled
def finger_turns(curl: float, knuckle: float, spread: float) -> tuple[Quat, Quat, Quat]:
    """Return the turns of a left finger's joints: its curl, how much farther the knuckle bends,
    and how far it is turned towards the little finger, in radians.
    """
    base = times(about_y(spread), about_z(1.25 * curl + knuckle))
    return base, about_z(1.55 * curl), about_z(0.95 * curl)


@compiled
def thumb_turns(bend: float, oppose: float, inward: float) -> tuple[Quat, Quat, Quat]:
    """Return the turns of a left thumb's joints, see `posture.THUMB` and what follows it."""
    base = times(about_x(-oppose), about(THUMB_AXIS, 0.35 * bend))
    base = times(about_y(inward), base)
    return base, about(THUMB_AXIS, 0.7 * bend), about(THUMB_AXIS, 0.9 * bend)


@compiled
def _put_digit(turns: Vector, row: int, side: int, bends: tuple[Quat, Quat, Quat]) -> None:
    base, middle, end = bends
    if side == 1:
        base, middle, end = mirror_quat(base), mirror_quat(middle), mirror_quat(end)
    _put(turns, row, base)
    _put(turns, row + 1, middle)
    _put(turns, row + 2, end)


@compiled
def _fingers(a: Vector, first: int, side: int, turns: Vector) -> None:
    for finger in range(4):
        spread = spread_of(a[p.SPREAD], finger)
        bends = finger_turns(a[p.CURL + finger], a[p.KNUCKLE + finger], spread)
        _put_digit(turns, first + p.S_FINGERS + 3 * finger, side, bends)
    bends = thumb_turns(a[p.THUMB], a[p.OPPOSE], a[p.THUMB_IN])
    _put_digit(turns, first + p.S_THUMB, side, bends)


@compiled
def _softly_within(x: float, least: float, most: float) -> float:
    """Return x, compressed smoothly towards the end of its range."""
    end = most if x >= 0.0 else -least
    share = abs(x) / end
    if share <= 0.8:
        return x
    within = float(end * (0.8 + 0.2 * np.tanh((share - 0.8) / 0.2)))
    return within if x >= 0.0 else -within


@compiled
def _possible_wrist(q: Quat) -> Quat:
    """Limit a wrist's bend to what wrists can do."""
    # Swing and twist: sideways and up-and-down bending have their own limits, the twist stays.
    twist = about_x(twist_about(q, (1.0, 0.0, 0.0)))
    w, x, y, z = times(q, inverse(twist))
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    if sine < 1e-9:
        return q
    size = 2.0 * np.arctan2(sine, w) / sine
    aside = _softly_within(size * y, MIN_WRIST[0], MAX_WRIST[0])
    bend_rad = _softly_within(size * z, MIN_WRIST[1], MAX_WRIST[1])
    angle = np.sqrt(aside * aside + bend_rad * bend_rad)
    if angle < 1e-9:
        return twist
    return times(about((0.0, aside / angle, bend_rad / angle), angle), twist)


@compiled
def _possible_twist(full: float) -> float:
    """Limit a forearm's twist (-pi to pi) to what forearms can do, without a seam at half a turn:
    who would have to turn the palm all round goes back through the middle.
    """
    beyond = (abs(full) - FAR_TWIST) / (np.pi - FAR_TWIST)
    most = MAX_FOREARM_TWIST * (1.0 - ease(beyond))
    return float(min(most, max(-most, full)))


@compiled
def _slid_back(to: Triple, way: Triple, upper: Triple, lower: Triple) -> float:
    """Return how far a hand slides along `way` until the elbow is bent, at most to the nearest."""
    most = EASY_REACH * (np.sqrt(dot(upper, upper)) + np.sqrt(dot(lower, lower)))
    over, ahead = dot(to, to) - most * most, -dot(to, way)
    if over <= 0.0 or ahead <= 0.0:
        return 0.0
    return float(ahead - np.sqrt(max(0.0, ahead * ahead - over)))


@compiled
def _swivel_elbow(
    pole: Triple, to: Triple, outward: Triple, outward_m: float, upper: Triple, lower: Triple
) -> Triple:
    """Return the pole, swivelled about the way to the wrist as little as brings the elbow so far
    along `outward` from the shoulder, or as far as it gets.
    """
    there = unit_of(to, DOWN)
    first, reach = np.sqrt(dot(upper, upper)), np.sqrt(dot(to, to))
    # The elbow moves on a circle about the way from shoulder to wrist: its centre at `at`, its
    # radius by Pythagoras.
    at = (first * first + reach * reach - dot(lower, lower)) / (2.0 * max(reach, 1e-9))
    radius = np.sqrt(max(first * first - at * at, 1e-12))
    square = minus(outward, scale_vector(there, dot(outward, there)))
    most = np.sqrt(dot(square, square))
    if most < 1e-6:
        return pole
    aside = scale_vector(square, 1.0 / most)
    back = cross(there, aside)
    now = square_to(pole, there, back)
    cosine = min(1.0, (outward_m - at * dot(outward, there)) / (radius * most))
    if dot(now, aside) >= cosine:
        return now
    rest = np.sqrt(1.0 - cosine * cosine)
    return plus(
        scale_vector(aside, cosine), scale_vector(back, rest if dot(now, back) >= 0.0 else -rest)
    )


@compiled
def _axes_of(hold: int, side: int, chest: Quat, thigh_turn: Quat, world: Vector) -> Quat:
    """Return how the thing of a hold is turned, reflected to the left for side 1."""
    if hold == p.CHEST:
        return chest
    if hold == p.THIGH:
        return thigh_turn
    axes = quat_of(world[p.J_HEAD if hold == p.HEAD else p.J_HIPS])
    return mirror_quat(axes) if side == 1 else axes


@compiled
def _origin_of(hold: int, side: int, chest_at: Triple, place: Vector) -> Triple:
    """Return where the thing of a hold is, reflected to the left for side 1."""
    if hold == p.CHEST:
        return chest_at
    if hold == p.THIGH:
        return _vector(place[p.J_SIDE + side * p.SIDE_SIZE + p.S_UPPER_LEG], 0)
    at = _vector(place[p.J_HEAD if hold == p.HEAD else p.J_HIPS], 0)
    return (-at[0], at[1], at[2]) if side == 1 else at


@compiled
def _wrist_of(upper: Quat, hinge: Quat, along: Triple, twist: float, hand: Quat) -> Quat:
    """Return the wrist's turn that, after a forearm's twist, turns a hand as given (world)."""
    forearm = times(hinge, about(along, FOREARM_SHARE * twist))
    return _possible_wrist(times(inverse(times(upper, forearm)), hand))


@compiled
def _arm(
    side: int,
    a: Vector,
    offsets: Vector,
    world: Vector,
    place: Vector,
    thigh_turn: Quat,
    turns: Vector,
) -> None:
    """Pose one arm, in a frame reflected to the left for side 1."""
    first = p.J_SIDE + side * p.SIDE_SIZE
    chest, chest_at = quat_of(world[p.J_UPPER_CHEST]), _vector(place[p.J_UPPER_CHEST], 0)
    if side == 1:
        chest, chest_at = mirror_quat(chest), (-chest_at[0], chest_at[1], chest_at[2])
    # Collar bone first: it carries the shoulder joint.
    clavicle = times(about_z(-a[p.SHOULDER_UP]), about_y(-a[p.SHOULDER_FORWARD]))
    girdle = times(chest, clavicle)
    at = plus(chest_at, rotate_vector(chest, _outward(offsets, first + p.S_SHOULDER, side)))
    at = plus(at, rotate_vector(girdle, _outward(offsets, first + p.S_UPPER_ARM, side)))
    upper_bone = _outward(offsets, first + p.S_LOWER_ARM, side)
    lower_bone = _outward(offsets, first + p.S_HAND, side)
    along = unit_of(lower_bone, LEFT_X)
    # The arm by its joint angles, as it would hang without anything held.
    bend = a[p.ELBOW]
    local = times(
        times(about_x(a[p.ARM_FLEX]), about_z(0.5 * np.pi - a[p.ARM_OUT])),
        about_x(-a[p.ARM_INWARD]),
    )
    upper = times(girdle, local)
    hinge = about(ELBOW_HINGE, bend)
    hand = times(
        times(times(times(upper, hinge), about(along, a[p.PRONATION])), about_y(-a[p.DEVIATION])),
        about_z(a[p.WRIST]),
    )
    free_turn = times(inverse(times(upper, hinge)), hand)
    hold_share = 0.0
    for hold in range(2 * p.HOLDS):
        hold_share += a[p.HOLD + hold * p.HOLD_SIZE]
    if hold_share > 1e-6:
        # Blend wrist place and elbow side by the holds' weights, then solve the limb once: blending
        # joint angles instead would move the hand off the held thing. The hand is blended by how
        # it is turned against the forearm: directions of fingers and palm nearly cancel out between
        # opposite holds, and the hand would turn over within a millisecond.
        free = max(0.0, 1.0 - hold_share)
        elbow_at = plus(at, rotate_vector(upper, upper_bone))
        free_hand = plus(elbow_at, rotate_vector(times(upper, hinge), lower_bone))
        goal = scale_vector(free_hand, free)
        to_free = unit_of(minus(free_hand, at), DOWN)
        pole = scale_vector(square_to(minus(elbow_at, at), to_free, BACK), free)
        pole = plus(pole, scale_vector(rotate_vector(chest, _vector(a, p.POLE)), hold_share))
        for hold in range(2 * p.HOLDS):
            h = a[p.HOLD + hold * p.HOLD_SIZE : p.HOLD + (hold + 1) * p.HOLD_SIZE]
            if h[0] <= MIN_SHARE:
                continue
            axes = _axes_of(hold % p.HOLDS, side, chest, thigh_turn, world)
            origin = _origin_of(hold % p.HOLDS, side, chest_at, place)
            goal = plus(goal, plus(scale_vector(origin, h[0]), rotate_vector(axes, _vector(h, 1))))
        to = minus(goal, at)
        if a[p.ELBOW_BESIDE] > 0.0:
            to_hip = rotate_vector(thigh_turn, (0.0, 1.0, 0.0))
            lies = a[p.HOLD + p.THIGH * p.HOLD_SIZE]
            to = plus(
                to, scale_vector(to_hip, lies * _slid_back(to, to_hip, upper_bone, lower_bone))
            )
            outward = rotate_vector(chest, LEFT_X)
            outward_m = hold_share * a[p.ELBOW_BESIDE] - dot(minus(at, chest_at), outward)
            pole = _swivel_elbow(pole, to, outward, outward_m, upper_bone, lower_bone)
        bend = bend_for(upper_bone, lower_bone, ELBOW_HINGE, np.sqrt(dot(to, to)), MAX_ELBOW)
        upper = limb_turn(upper_bone, lower_bone, ELBOW_HINGE, bend, to, pole)
        hinge = about(ELBOW_HINGE, bend)
        local = times(inverse(girdle), upper)
        whole, share, twist = times(upper, hinge), 0.0, 0.0
        wrist = (1.0, 0.0, 0.0, 0.0)
        if free > MIN_SHARE:
            share, twist = free, free * a[p.PRONATION]
            wrist = _wrist_of(upper, hinge, along, a[p.PRONATION], times(whole, free_turn))
        for hold in range(2 * p.HOLDS):
            h = a[p.HOLD + hold * p.HOLD_SIZE : p.HOLD + (hold + 1) * p.HOLD_SIZE]
            if h[0] <= MIN_SHARE:
                continue
            axes = _axes_of(hold % p.HOLDS, side, chest, thigh_turn, world)
            fingers = unit_of(rotate_vector(axes, _vector(h, 4)), rotate_vector(hand, LEFT_X))
            palm = square_to(rotate_vector(axes, _vector(h, 7)), fingers, rotate_vector(hand, DOWN))
            within = times(inverse(whole), frame_to_frame(LEFT_X, DOWN, fingers, palm))
            # The hand's twist about the forearm, limited to what forearms can do: a palm beyond
            # the largest twist stops before it reaches its direction.
            full_twist = twist_about(within, along)
            own_twist = _possible_twist(full_twist)
            hand_there = times(whole, times(about(along, own_twist - full_twist), within))
            own_wrist = _wrist_of(upper, hinge, along, own_twist, hand_there)
            wrist = mix_quats(wrist, own_wrist, h[0] / (share + h[0])) if share > 0.0 else own_wrist
            share, twist = share + h[0], twist + h[0] * own_twist
        twist /= share
    else:
        twist = a[p.PRONATION]
        wrist = _wrist_of(upper, hinge, along, twist, hand)
    forearm = times(hinge, about(along, FOREARM_SHARE * twist))
    if side == 1:
        clavicle, local = mirror_quat(clavicle), mirror_quat(local)
        forearm, wrist = mirror_quat(forearm), mirror_quat(wrist)
    _put(turns, first + p.S_SHOULDER, clavicle)
    _put(turns, first + p.S_UPPER_ARM, local)
    _put(turns, first + p.S_LOWER_ARM, forearm)
    _put(turns, first + p.S_HAND, wrist)


@compiled
def head_turn(c: Vector, own: Vector, turns: Vector, world: Vector, place: Vector) -> Quat:
    """Return how the head of a posture is turned; the others are work space (JOINTS rows)."""
    _trunk(c, own, turns, world, place)
    return quat_of(world[p.J_HEAD])


@compiled
def look_from(
    controls: Vector,
    offsets: Vector,
    skeleton_of: npt.NDArray[np.int64],
    eyes_m: Vector,
    head_wxyz: Vector,
    chest_wxyz: Vector,
) -> None:
    """Write where the middle of the eyes is (n, 3) and how head and chest are turned (n, 4)."""
    world, turns, place = np.empty((p.JOINTS, 4)), np.empty((p.JOINTS, 4)), np.empty((p.JOINTS, 3))
    for r in range(controls.shape[0]):
        own = offsets[skeleton_of[r]]
        # The trunk alone is enough: arms and legs do not carry the eyes.
        _trunk(controls[r], own, turns, world, place)
        eyes = _eyes_middle(own, world, place)
        _set(eyes_m, r, eyes)
        head_wxyz[r] = world[p.J_HEAD]
        chest_wxyz[r] = world[p.J_UPPER_CHEST]


@compiled
def _hold_head(
    c: Vector,
    own: Vector,
    eyes: Vector,
    facing: Vector,
    turns: Vector,
    world: Vector,
    place: Vector,
) -> None:
    """Turn the head to a facing and move the hips so that the eyes are at a point."""
    back = unit_of((-facing[0], -facing[1], -facing[2]), BACK)
    right = unit_of(cross((0.0, 1.0, 0.0), back), (1.0, 0.0, 0.0))
    head = of_axes(right, cross(back, right), back)
    trunk = quat_of(world[p.J_UPPER_CHEST])
    # The neck takes its usual share of the turn from the trunk to the head.
    neck = mix_quats((1.0, 0.0, 0.0, 0.0), times(inverse(trunk), head), NECK_SHARE)
    neck_world = times(trunk, neck)
    _put(turns, p.J_NECK, neck)
    _put(world, p.J_NECK, neck_world)
    _put(turns, p.J_HEAD, times(inverse(neck_world), head))
    _put(world, p.J_HEAD, head)
    neck_at = _vector(place[p.J_NECK], 0)
    _set(place, p.J_HEAD, plus(neck_at, rotate_vector(neck_world, _vector(own[p.J_HEAD], 0))))
    # Turning first, then moving the whole trunk: legs are posed later from the new hips.
    shift = minus(_vector(eyes, 0), _eyes_middle(own, world, place))
    for joint in range(p.J_HEAD + 1):
        _set(place, joint, plus(_vector(place[joint], 0), shift))
    for k in range(3):
        c[p.HIPS + k] += shift[k]


@compiled
def _limbs(c: Vector, own: Vector, world: Vector, place: Vector, turns: Vector) -> None:
    """Pose legs and arms but for the fingers, on a trunk that is posed."""
    for side in range(2):
        thigh = _leg(side, c, own, world, place, turns)
        arm = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
        _arm(side, arm, own, world, place, thigh, turns)


@compiled
def pose_but_fingers(c: Vector, own: Vector, turns: Vector, world: Vector, place: Vector) -> None:
    """Write the turns (JOINTS, 4) of trunk, head, legs and arms of a posture; no others.

    `world` and `place` are work space (JOINTS rows).
    """
    _trunk(c, own, turns, world, place)
    _limbs(c, own, world, place, turns)


@compiled
def pose_rows(
    controls: Vector,
    offsets: Vector,
    skeleton_of: npt.NDArray[np.int64],
    is_held: npt.NDArray[np.bool_],
    held_eyes_m: Vector,
    held_facing: Vector,
    root_m: Vector,
    turns: Vector,
) -> None:
    """Turn rows of posture (n, SIZE) into roots (n, 3) and joint turns (n, JOINTS, 4).

    `offsets` (skeletons, JOINTS, 3) at rest. Where `is_held`, the middle of the eyes (n, 3) and the
    head's facing (n, 3) are given, and the hips follow.
    """
    world, place = np.empty((p.JOINTS, 4)), np.empty((p.JOINTS, 3))
    for r in range(controls.shape[0]):
        c, own, t = controls[r], offsets[skeleton_of[r]], turns[r]
        # No turn for joints that the posture leaves alone.
        t[:, 0] = 1.0
        t[:, 1:] = 0.0
        _trunk(c, own, t, world, place)
        if is_held[r]:
            _hold_head(c, own, held_eyes_m[r], held_facing[r], t, world, place)
        _limbs(c, own, world, place, t)
        for side in range(2):
            arm = c[p.ARM + side * p.ARM_SIZE : p.ARM + (side + 1) * p.ARM_SIZE]
            _fingers(arm, p.J_SIDE + side * p.SIDE_SIZE, side, t)
        for k in range(3):
            root_m[r, k] = c[p.HIPS + k]
