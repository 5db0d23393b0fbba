"""Walk a way step by step: speed, turned shoulders, swinging arms, caution that is learned."""

from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.experiments.crowd.participant.route import STEP_M
from visavis.experiments.crowd.participant.traits import (
    ALARM_FORGOTTEN as T_ALARM_FORGOTTEN,
)
from visavis.experiments.crowd.participant.traits import (
    ALARM_MARGIN as T_ALARM_MARGIN,
)
from visavis.experiments.crowd.participant.traits import (
    ALARM_PER_S as T_ALARM_PER_S,
)
from visavis.experiments.crowd.participant.traits import (
    ALARM_SLOWING as T_ALARM_SLOWING,
)
from visavis.experiments.crowd.participant.traits import (
    CAREFUL_MARGIN as T_CAREFUL_MARGIN,
)
from visavis.experiments.crowd.participant.traits import (
    CAUTION_FORGOTTEN as T_CAUTION_FORGOTTEN,
)
from visavis.experiments.crowd.participant.traits import (
    CAUTION_PER_S as T_CAUTION_PER_S,
)
from visavis.experiments.crowd.participant.traits import (
    CAUTION_TUCK as T_CAUTION_TUCK,
)
from visavis.experiments.crowd.participant.traits import (
    CAUTION_WANDER as T_CAUTION_WANDER,
)
from visavis.experiments.crowd.participant.traits import (
    CLEAR as T_CLEAR,
)
from visavis.experiments.crowd.participant.traits import (
    DEPTH as T_DEPTH,
)
from visavis.experiments.crowd.participant.traits import (
    FREE_SPEED as T_FREE_SPEED,
)
from visavis.experiments.crowd.participant.traits import (
    MARGIN as T_MARGIN,
)
from visavis.experiments.crowd.participant.traits import (
    NARROW_SLOWING as T_NARROW_SLOWING,
)
from visavis.experiments.crowd.participant.traits import (
    STRIDE as T_STRIDE,
)
from visavis.experiments.crowd.participant.traits import (
    SWING as T_SWING,
)
from visavis.experiments.crowd.participant.traits import (
    TUCK as T_TUCK,
)
from visavis.experiments.crowd.participant.traits import (
    TURN_LIMIT as T_TURN_LIMIT,
)
from visavis.experiments.crowd.participant.traits import (
    TURN_S as T_TURN_S,
)
from visavis.experiments.crowd.participant.traits import (
    TURN_SLOWING as T_TURN_SLOWING,
)
from visavis.experiments.crowd.participant.traits import (
    WANDER as T_WANDER,
)
from visavis.experiments.crowd.participant.traits import (
    WANDER_S as T_WANDER_S,
)
from visavis.experiments.crowd.participant.traits import (
    WIDTH as T_WIDTH,
)
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.body import REFERENCE_STATURE_M, bones
from visavis.stimuli.contact.idle import hang_joint, set_turn
from visavis.stimuli.motion.slerp_kernels import forward_rows

STEP_S: Final = 0.01
STEP_NS: Final = 10_000_000

(
    X,
    Z,
    HEADING,
    TURN,
    SPEED,
    PHASE,
    SWING,
    TUCK,
    PROGRESS,
    ASTRAY,
    CAUTION,
    ALARM,
    LOOK,
    ASIDE,
    N_STATE,
) = range(15)

_J: Final = {name: i for i, name in enumerate(BODY_JOINTS)}
_SPINE, _CHEST, _NECK, _HEAD = _J["spine"], _J["upper_chest"], _J["neck"], _J["head"]
_LEFT_ARM, _RIGHT_ARM = _J["left_upper_arm"], _J["right_upper_arm"]
_LEFT_LEG, _RIGHT_LEG = _J["left_upper_leg"], _J["right_upper_leg"]
N_JOINTS: Final = len(BODY_JOINTS)
_HIP_HEIGHT_M = bones().hip_height_m
_REFERENCE_M = REFERENCE_STATURE_M
_STEP_M = STEP_M
_STEP_S = STEP_S


@compiled
def needed_turn(free_m: float, width_m: float, depth_m: float, limit: float) -> float:
    """Return the least turn (radians) at which a body that wide and deep fits into a gap."""
    if free_m >= width_m:
        return 0.0
    low, high = 0.0, limit
    if width_m * np.cos(high) + depth_m * np.sin(high) > free_m:
        return limit
    # Width of a turned box: w cos(a) + d sin(a). Bisection to a millionth of the limit.
    for _ in range(20):
        middle = (low + high) / 2
        if width_m * np.cos(middle) + depth_m * np.sin(middle) > free_m:
            low = middle
        else:
            high = middle
    return high


@compiled
def advance(
    states: Vector,
    at: int,
    until: int,
    traits: Vector,
    point: Vector,
    heading: Vector,
    free: Vector,
    side: Vector,
    noise: Vector,
    vibration_01: float,
    go: bool,
) -> int:
    """Walk from row `at` of `states` (n, 14) to row `until`; return the row reached.

    Way as in `Way`; `side` (n,) ±1 to which side the shoulders turn there; `noise` (n, 2)
    standard normal numbers per row. `vibration_01` is the strongest vibration now, 0..1; without
    `go` the body stands.
    """
    last = point.shape[0] - 1
    until = min(until, states.shape[0] - 1)
    for i in range(at, until):
        s, n = states[i], states[i + 1]
        # Learning: both approach 1 while vibration is felt and decay exponentially.
        caution, alarm = s[CAUTION], s[ALARM]
        caution += _STEP_S * traits[T_CAUTION_PER_S] * vibration_01 * (1.0 - caution)
        caution *= 1.0 - _STEP_S / traits[T_CAUTION_FORGOTTEN]
        alarm += _STEP_S * traits[T_ALARM_PER_S] * vibration_01 * (1.0 - alarm)
        alarm *= 1.0 - _STEP_S / traits[T_ALARM_FORGOTTEN]
        # The narrowest of the next 30 cm decides how far the shoulders turn.
        here = s[PROGRESS] / _STEP_M
        k = min(int(here), last)
        narrow = free[k]
        for ahead in range(0, 16, 3):
            narrow = min(narrow, free[min(k + ahead, last)])
        margin = traits[T_MARGIN] + (traits[T_CAREFUL_MARGIN] - traits[T_MARGIN]) * caution
        margin += traits[T_ALARM_MARGIN] * alarm
        target_turn = (
            needed_turn(narrow - 2 * margin, traits[T_WIDTH], traits[T_DEPTH], traits[T_TURN_LIMIT])
            * side[k]
        )
        narrowness = min(max((0.9 - narrow) / 0.6, 0.0), 1.0)
        # Slower when turned, in narrow places, when alarmed, and just before the end.
        target = 0.0
        if go:
            target = traits[T_FREE_SPEED]
            target *= 1.0 - traits[T_TURN_SLOWING] * abs(np.sin(s[TURN]))
            target *= 1.0 - traits[T_NARROW_SLOWING] * narrowness
            target *= 1.0 - traits[T_ALARM_SLOWING] * alarm
            left_m = (last - here) * _STEP_M
            target = min(target, max(0.9 * left_m, 0.0) + 0.02)
        else:
            target_turn = 0.0
        # First-order lags (s): speed 0.35, heading 0.25, arms 0.4 to 0.5, sideways 0.4.
        speed = s[SPEED] + (target - s[SPEED]) * _STEP_S / 0.35
        progress = min(s[PROGRESS] + speed * _STEP_S, last * _STEP_M)
        tuck = traits[T_TUCK] * narrowness
        tuck += (1.0 - tuck) * traits[T_CAUTION_TUCK] * caution
        wander = traits[T_WANDER] * (1.0 - traits[T_CAUTION_WANDER] * caution)
        # An Ornstein-Uhlenbeck process leads off the way and back, with SD `wander`.
        pull = _STEP_S / traits[T_WANDER_S]
        astray = s[ASTRAY] * (1.0 - pull) + wander * np.sqrt(2.0 * pull) * noise[i, 0]
        # Nobody sways into a body: only the room beside the turned trunk is there for it.
        across = traits[T_WIDTH] * abs(np.cos(s[TURN])) + traits[T_DEPTH] * abs(np.sin(s[TURN]))
        room = max((narrow - across) / 2 - traits[T_CLEAR], 0.0)
        strays = min(max(astray, -room), room)
        aside = s[ASIDE] + (strays * min(speed / 0.2, 1.0) - s[ASIDE]) * _STEP_S / 0.4
        here = progress / _STEP_M
        k = min(int(here), last)
        following = min(k + 1, last)
        share = here - k
        way = heading[k]
        x = point[k, 0] + share * (point[following, 0] - point[k, 0])
        z = point[k, 1] + share * (point[following, 1] - point[k, 1])
        n[X] = x + aside * np.cos(way)
        n[Z] = z - aside * np.sin(way)
        difference = (way - s[HEADING] + np.pi) % (2 * np.pi) - np.pi
        n[HEADING] = s[HEADING] + difference * _STEP_S / 0.25
        n[TURN] = s[TURN] + (target_turn - s[TURN]) * _STEP_S / traits[T_TURN_S]
        n[SPEED] = speed
        n[PHASE] = s[PHASE] + 2 * np.pi * speed * _STEP_S / traits[T_STRIDE]
        amplitude = traits[T_SWING] * (1.0 - 0.85 * tuck) * min(speed / 0.5, 1.3)
        n[SWING] = s[SWING] + (amplitude - s[SWING]) * _STEP_S / 0.4
        n[TUCK] = s[TUCK] + (tuck - s[TUCK]) * _STEP_S / 0.5
        n[PROGRESS] = progress
        n[ASTRAY], n[ASIDE] = astray, aside
        n[CAUTION], n[ALARM] = caution, alarm
        # another one turns the head: 0.8 s, SD 0.10 rad
        n[LOOK] = s[LOOK] * (1.0 - _STEP_S / 0.8) + 0.10 * np.sqrt(2 * _STEP_S / 0.8) * noise[i, 1]
    return max(until, at)


@compiled
def walker_pose(
    state: Vector,
    stature_m: float,
    spread: float,
    parents: npt.NDArray[np.int64],
    offsets_m: Vector,
    root: Vector,
    local: Vector,
    position: Vector,
    world: Vector,
) -> None:
    """Write joints in world, (1, 22, 3) and (1, 22, 4), of a walker in a state (14,)."""
    scale = stature_m / _REFERENCE_M
    x, z, heading, turn, phase, swing, tuck = (
        state[X],
        state[Z],
        state[HEADING],
        state[TURN],
        state[PHASE],
        state[SWING],
        state[TUCK],
    )
    stepping = min(state[SPEED] / 0.5, 1.2)
    turns = local[0]
    turns[:] = 0.0
    turns[:, 0] = 1.0
    # nobody stands perfectly still: sway of millimetres goes with the head's small turns
    sway = 0.012 * stepping * np.sin(phase) + 0.004 * state[LOOK]
    yaw = heading + 0.8 * turn
    root[0, 0] = x + sway * np.cos(yaw)
    root[0, 1] = _HIP_HEIGHT_M * scale - 0.012 * stepping * (1 - np.cos(2 * phase)) / 2
    root[0, 2] = z - sway * np.sin(yaw)
    set_turn(turns, 0, 0.0, yaw + 0.05 * stepping * np.sin(phase), 0.0)
    set_turn(turns, _SPINE, -0.03, 0.1 * turn - 0.04 * stepping * np.sin(phase), 0.0)
    set_turn(turns, _CHEST, -0.02, 0.1 * turn - 0.06 * stepping * np.sin(phase), 0.0)
    set_turn(turns, _NECK, 0.0, -0.4 * turn, 0.0)
    set_turn(turns, _HEAD, -0.10, -0.5 * turn + state[LOOK], 0.0)
    stride = 0.24 * stepping * np.sin(phase)
    knee = 0.35 * stepping
    set_turn(turns, _LEFT_LEG, stride, 0.0, -0.02)
    set_turn(turns, _RIGHT_LEG, -stride, 0.0, 0.02)
    set_turn(turns, _LEFT_LEG + 1, -knee * max(np.cos(phase), 0.0), 0.0, 0.0)
    set_turn(turns, _RIGHT_LEG + 1, -knee * max(-np.cos(phase), 0.0), 0.0, 0.0)
    hang = 1.57 - spread * (1.0 - tuck)
    bend = 0.30 + 0.4 * max(tuck, 0.0)
    lift = 0.12 * max(tuck, 0.0)
    hang_joint(turns, _LEFT_ARM, 1.0, hang, lift - swing * np.sin(phase), bend)
    hang_joint(turns, _RIGHT_ARM, -1.0, hang, lift + swing * np.sin(phase), bend)
    forward_rows(parents, offsets_m * scale, root, local, position, world)


@compiled
def walker_poses(
    states: Vector,
    rows: Vector,
    stature_m: float,
    spread: float,
    parents: npt.NDArray[np.int64],
    offsets_m: Vector,
    positions: Vector,
    worlds: Vector,
) -> None:
    """Write joints (k, 22, 3) and (k, 22, 4) at fractional rows (k,) of a walk."""
    root, local = np.empty((1, 3)), np.empty((1, N_JOINTS, 4))
    state = np.empty(states.shape[1])
    for i in range(rows.shape[0]):
        low = int(rows[i])
        high = min(low + 1, states.shape[0] - 1)
        share = rows[i] - low
        for c in range(states.shape[1]):
            state[c] = states[low, c] + share * (states[high, c] - states[low, c])
        walker_pose(
            state,
            stature_m,
            spread,
            parents,
            offsets_m,
            root,
            local,
            positions[i : i + 1],
            worlds[i : i + 1],
        )


@compiled
def walker_head(
    states: Vector,
    row: float,
    stature_m: float,
    spread: float,
    parents: npt.NDArray[np.int64],
    offsets_m: Vector,
    eyes_m: Vector,
    middle: Vector,
    orientation: Vector,
) -> None:
    """Write the middle between the eyes (3,) and the head's turn (4,) at a fractional row."""
    rows = np.empty(1)
    rows[0] = row
    position, world = np.empty((1, N_JOINTS, 3)), np.empty((1, N_JOINTS, 4))
    walker_poses(states, rows, stature_m, spread, parents, offsets_m, position, world)
    w, x, y, z = world[0, _HEAD, 0], world[0, _HEAD, 1], world[0, _HEAD, 2], world[0, _HEAD, 3]
    vx, vy, vz = eyes_m[0], eyes_m[1], eyes_m[2]
    # v + 2w (q × v) + 2 q × (q × v): the eyes' offset turned by the head's quaternion.
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    middle[0] = position[0, _HEAD, 0] + vx + w * tx + y * tz - z * ty
    middle[1] = position[0, _HEAD, 1] + vy + w * ty + z * tx - x * tz
    middle[2] = position[0, _HEAD, 2] + vz + w * tz + x * ty - y * tx
    orientation[0], orientation[1], orientation[2], orientation[3] = w, x, y, z
