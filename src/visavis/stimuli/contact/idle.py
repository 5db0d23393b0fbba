"""How idle people stand: poses as a pure function of who they are and of time.

Everybody shifts weight, breathes and looks about; people who wait let their arms hang, people on
the phone hold it to the ear. Contact uses the same poses as drawing: both come from the kernels of
`visavis.stimuli.motion`, person by person here, everybody at once there.
"""

from typing import Final, Literal, NamedTuple

import numpy as np

from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.figures import Figures, crowd_figures
from visavis.stimuli.gaze.gaze_shift_kernels import MAX_TURN_S, RECENT, glance_around, turn_to
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.gesture_kernels import phone_but_fingers
from visavis.stimuli.motion.kinds import Idle, Kind, Phone
from visavis.stimuli.motion.placing_kernels import put_at
from visavis.stimuli.motion.posture_kernels import head_turn, pose_but_fingers
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.slerp_kernels import forward_rows
from visavis.stimuli.motion.standing_kernels import idle_but_fingers
from visavis.stimuli.scenes.station_crowd import Crowd

N_JOINTS: Final = len(BODY_JOINTS)
N_PERSON: Final = 16
_SEED: Final = 5
_LIVELY: Final = 6
_ARMS: Final = 7
_HAND: Final = 8
_TALK: Final = 9
_FIGURE: Final = 15
WAITS: Final = Idle(arms="hanging")
TELEPHONES: Final = Phone()
_BODY: Final = np.array([canonical_skeleton().index(name) for name in BODY_JOINTS])


def people_of(crowd: Crowd) -> Vector:
    """Return one row (n, 16) per person for the kernels below.

    Columns: x, z, yaw, stature, behaviour, seed, how lively, the way of the arms of who waits, the
    hand and the share of talk of who telephones, and last which of `figures.crowd_figures` the
    person is; the others are spare.
    """
    people = np.zeros((len(crowd), N_PERSON))
    people[:, :2] = crowd.position_m
    people[:, 2], people[:, 3] = crowd.yaw_rad, crowd.stature_m
    people[:, 4] = crowd.behaviour
    for row, seed in zip(people, crowd.seed.tolist(), strict=True):
        row[_SEED] = seed
        row[_LIVELY], row[_ARMS] = WAITS.numbers(seed)
        _, row[_HAND], row[_TALK] = TELEPHONES.numbers(seed)
    people[:, _FIGURE] = crowd.character
    return people


def telephone_sides(people: Vector) -> list[Literal["left", "right"] | None]:
    """Return in which hand each of these rows (n, 16) holds a telephone; None for who waits."""
    return [None if row[4] <= 0.5 else "right" if row[_HAND] > 0.5 else "left" for row in people]


def kinds_of(people: Vector) -> list[Kind]:
    """Return what each of these rows (n, 16) does, as data."""
    return [WAITS if row[4] <= 0.5 else TELEPHONES for row in people]


@compiled
def set_turn(local: Vector, joint: int, x: float, y: float, z: float) -> None:
    """Set a joint's turn to a rotation about z, then x, then y (radians, fixed axes)."""
    cx, sx = np.cos(x / 2), np.sin(x / 2)
    cy, sy = np.cos(y / 2), np.sin(y / 2)
    cz, sz = np.cos(z / 2), np.sin(z / 2)
    local[joint, 0] = cy * cx * cz + sy * sx * sz
    local[joint, 1] = cy * sx * cz + sy * cx * sz
    local[joint, 2] = sy * cx * cz - cy * sx * sz
    local[joint, 3] = cy * cx * sz - sy * sx * cz


class Workspace(NamedTuple):
    """Room to pose one person, used again for everybody.

    `controls` (SIZE,) and the canonical skeleton's `turns`, `trunk_world` (55, 4), `trunk_m`
    (55, 3); `looks` (6, 5); of `BODY_JOINTS`, as `forward_rows` takes and writes them, `root_m`
    (1, 3), `local` (1, 22, 4), `position_m` (1, 22, 3) and `world` (1, 22, 4).
    """

    controls: Vector
    turns: Vector
    trunk_world: Vector
    trunk_m: Vector
    looks: Vector
    root_m: Vector
    local: Vector
    position_m: Vector
    world: Vector


@compiled
def workspace() -> Workspace:
    """Return room to pose one person."""
    return Workspace(
        np.empty(p.SIZE),
        np.empty((p.JOINTS, 4)),
        np.empty((p.JOINTS, 4)),
        np.empty((p.JOINTS, 3)),
        np.empty((RECENT + 1, 5)),
        np.empty((1, 3)),
        np.empty((1, N_JOINTS, 4)),
        np.empty((1, N_JOINTS, 3)),
        np.empty((1, N_JOINTS, 4)),
    )


@compiled
def idle_turns(person: Vector, t_s: float, figures: Figures, room: Workspace) -> None:
    """Write root and joint turns of `BODY_JOINTS` of a person at a time: the very posture that is
    drawn, feet locked to the floor.
    """
    who, seed, lively = int(person[_FIGURE]), int(person[_SEED]), person[_LIVELY]
    lengths, offsets = figures.lengths_m[who], figures.skeleton_m[who]
    c, turns = room.controls, room.turns
    if person[4] > 0.5:
        phone_but_fingers(c, t_s, lengths, seed, lively, int(person[_HAND]))
    else:
        idle_but_fingers(c, t_s, lengths, seed, lively, int(person[_ARMS]))
    put_at(c, (person[0], 0.0, person[1]), person[2])
    # Where people look follows from how the head is turned, so the trunk is posed first.
    head = head_turn(c, offsets, turns, room.trunk_world, room.trunk_m)
    attend = c[p.ATTEND : p.ATTEND + 3]
    n_looks = glance_around(t_s - MAX_TURN_S, t_s, seed, c[p.FRONT], attend, room.looks, 0)
    trunk_yaw, head_yaw, head_pitch = turn_to(t_s, room.looks[:n_looks], head, seed)
    c[p.TRUNK_YAW] += trunk_yaw
    c[p.HEAD_YAW] += head_yaw
    c[p.HEAD_PITCH] += head_pitch
    # Fingers are left out: no capsule hangs on them.
    pose_but_fingers(c, offsets, turns, room.trunk_world, room.trunk_m)
    for k in range(3):
        room.root_m[0, k] = c[p.HIPS + k]
    for k in range(N_JOINTS):
        for i in range(4):
            room.local[0, k, i] = turns[_BODY[k], i]


@compiled
def hang_joint(
    local: Vector, arm: int, sign: float, hang: float, forward: float, bend: float
) -> None:
    """Let an arm hang: `hang` down from the T-pose, `forward` from the shoulder, elbow `bend`.

    Radians; `sign` 1 for the left arm, −1 for the right. The forearm joint follows the arm's.
    """
    # z first brings the arm down, x then swings it to the front
    set_turn(local, arm, forward, 0.0, sign * hang)
    set_turn(local, arm + 1, 0.0, -sign * bend, 0.0)


@compiled
def place_person(person: Vector, t_s: float, figures: Figures, room: Workspace) -> None:
    """Write joints in world, `room.position_m` and `room.world`, of a person at a time."""
    idle_turns(person, t_s, figures, room)
    offsets_m = figures.offsets_m[int(person[_FIGURE])]
    forward_rows(figures.parents, offsets_m, room.root_m, room.local, room.position_m, room.world)


def crowd_poses(people: Vector, t_s: float) -> tuple[Vector, Vector]:
    """Return joint positions (n, 22, 3) and orientations (n, 22, 4) of everybody at a time."""
    n = len(people)
    figures = crowd_figures()
    position, world = np.empty((n, N_JOINTS, 3)), np.empty((n, N_JOINTS, 4))
    room = workspace()
    for i in range(n):
        place_person(people[i], t_s, figures, room)
        position[i], world[i] = room.position_m[0], room.world[0]
    return position, world
