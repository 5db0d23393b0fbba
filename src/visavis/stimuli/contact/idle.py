"""How idle people stand: poses as a pure function of who they are and of time.

Everybody shifts weight, breathes and looks about; people who wait let their arms hang, people on
the phone hold it to the ear. Contact uses the same poses as drawing: both come from the kernels of
`visavis.stimuli.motion`, person by person here, everybody at once there.
"""

from typing import Final, Literal

import numpy as np

from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.figures import Figures, crowd_figures
from visavis.stimuli.gaze.gaze_shift_kernels import Schedule, turn_rows
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.gesture_kernels import phone_but_fingers
from visavis.stimuli.motion.kinds import Idle, Kind, Phone
from visavis.stimuli.motion.placing_kernels import placed_rows
from visavis.stimuli.motion.posture_kernels import look_from, pose_but_fingers
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


@compiled
def idle_turns(person: Vector, t_s: float, figures: Figures, root: Vector, local: Vector) -> None:
    """Write roots (1, 3) and joint turns (1, 22, 4) of `BODY_JOINTS` of a person at a time: the
    very posture that is drawn, feet locked to the floor.
    """
    who = int(person[_FIGURE])
    controls = np.empty((1, p.SIZE))
    rows, seeds = np.zeros(1, np.int64), np.full(1, int(person[_SEED]))
    lengths, offsets = figures.lengths_m[who], figures.skeleton_m[who : who + 1]
    seed, lively = int(person[_SEED]), person[_LIVELY]
    if person[4] > 0.5:
        phone_but_fingers(controls[0], t_s, lengths, seed, lively, int(person[_HAND]))
    else:
        idle_but_fingers(controls[0], t_s, lengths, seed, lively, int(person[_ARMS]))
    place, heading = np.zeros((1, 3)), np.full(1, person[2])
    place[0, 0], place[0, 2] = person[0], person[1]
    placed_rows(controls, place, heading)
    eyes, head, chest = np.empty((1, 3)), np.empty((1, 4)), np.empty((1, 4))
    # Where people look follows from where their eyes are, so the trunk is posed first.
    look_from(controls, offsets, rows, eyes, head, chest)
    gaze_turn = np.zeros((1, 3))
    no_looks = Schedule(np.zeros(2, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros((1, 3)))
    turn_rows(
        t_s,
        no_looks,
        eyes,
        head,
        controls[:, p.FRONT : p.ATTEND + 3].copy(),
        seeds,
        np.full(3, np.nan),
        gaze_turn,
    )
    controls[0, p.TRUNK_YAW] += gaze_turn[0, 0]
    controls[0, p.HEAD_YAW] += gaze_turn[0, 1]
    controls[0, p.HEAD_PITCH] += gaze_turn[0, 2]
    # Fingers are left out: no capsule hangs on them.
    turns = np.empty((1, p.JOINTS, 4))
    pose_but_fingers(controls[0], offsets[0], turns[0])
    for k in range(3):
        root[0, k] = controls[0, p.HIPS + k]
    for k in range(N_JOINTS):
        for i in range(4):
            local[0, k, i] = turns[0, _BODY[k], i]


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
def place_person(
    person: Vector,
    t_s: float,
    figures: Figures,
    root: Vector,
    local: Vector,
    position: Vector,
    world: Vector,
) -> None:
    """Write joints in world, (1, 22, 3) and (1, 22, 4), of a person at a time."""
    who = int(person[_FIGURE])
    idle_turns(person, t_s, figures, root, local)
    forward_rows(figures.parents, figures.offsets_m[who], root, local, position, world)


def crowd_poses(people: Vector, t_s: float) -> tuple[Vector, Vector]:
    """Return joint positions (n, 22, 3) and orientations (n, 22, 4) of everybody at a time."""
    n = len(people)
    figures = crowd_figures()
    position, world = np.empty((n, N_JOINTS, 3)), np.empty((n, N_JOINTS, 4))
    root, local = np.empty((1, 3)), np.empty((1, N_JOINTS, 4))
    for i in range(n):
        place_person(people[i], t_s, figures, root, local, position[i : i + 1], world[i : i + 1])
    return position, world
