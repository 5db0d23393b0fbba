"""How idle people stand: poses as a pure function of who they are and of time.

Everybody shifts weight, breathes and looks about; who waits lets the arms hang, who telephones
holds a hand to the ear. Periods of 2 to 20 s and amplitudes of millimetres to a few degrees are
ours; phases differ by person.
"""

from typing import Final, Literal

import numpy as np

from lab.compiled import compiled
from lab.geometry import Vector
from stimuli.contact.body import BODY_JOINTS
from stimuli.contact.figures import Figures, crowd_figures
from stimuli.motion.slerp_kernels import forward_rows
from stimuli.scenes.station_crowd import Crowd

_J: Final = {name: i for i, name in enumerate(BODY_JOINTS)}
_SPINE, _CHEST, _NECK, _HEAD = _J["spine"], _J["upper_chest"], _J["neck"], _J["head"]
_LEFT_ARM, _RIGHT_ARM = _J["left_upper_arm"], _J["right_upper_arm"]
_LEFT_LEG, _RIGHT_LEG = _J["left_upper_leg"], _J["right_upper_leg"]
N_JOINTS: Final = len(BODY_JOINTS)
N_PERSON: Final = 16
_CHANCE: Final = slice(5, 15)
_FIGURE: Final = 15
_RIGHT_SHARE: Final = 0.8
"""The telephone is in the right hand of eight in ten."""


def people_of(crowd: Crowd) -> Vector:
    """Return one row (n, 16) per person for the kernels below.

    Columns: x, z, yaw, stature, behaviour, ten numbers in 0..1 from the person's seed, and which
    of `figures.crowd_figures` the person is.
    """
    people = np.empty((len(crowd), N_PERSON))
    people[:, :2] = crowd.position_m
    people[:, 2], people[:, 3] = crowd.yaw_rad, crowd.stature_m
    people[:, 4] = crowd.behaviour
    for row, seed in zip(people, crowd.seed.tolist(), strict=True):
        row[_CHANCE] = np.random.default_rng(seed).random(10)
    people[:, _FIGURE] = crowd.character
    return people


def telephone_sides(people: Vector) -> list[Literal["left", "right"] | None]:
    """Return in which hand each of these rows (n, 16) holds a telephone; None for who waits."""
    return [
        None if row[4] <= 0.5 else "right" if row[_CHANCE][9] < _RIGHT_SHARE else "left"
        for row in people
    ]


@compiled
def turned(local: Vector, joint: int, x: float, y: float, z: float) -> None:
    """Set a joint's turn to a rotation about z, then x, then y (radians, fixed axes)."""
    cx, sx = np.cos(x / 2), np.sin(x / 2)
    cy, sy = np.cos(y / 2), np.sin(y / 2)
    cz, sz = np.cos(z / 2), np.sin(z / 2)
    local[joint, 0] = cy * cx * cz + sy * sx * sz
    local[joint, 1] = cy * sx * cz + sy * cx * sz
    local[joint, 2] = sy * cx * cz - cy * sx * sz
    local[joint, 3] = cy * cx * sz - sy * sx * cz


@compiled
def idle_turns(
    person: Vector, t_s: float, hip_height_m: float, root: Vector, local: Vector
) -> None:
    """Write root (3,) and joint turns (22, 4) of `BODY_JOINTS` of a person at a time."""
    local[:] = 0.0
    local[:, 0] = 1.0
    p = person[5:]
    w = 2 * np.pi
    shift = np.sin(w * (t_s / (9 + 6 * p[0]) + p[1]))
    sway = np.sin(w * (t_s / (3.1 + p[2]) + p[3]))
    breath = np.sin(w * (t_s / (3.6 + 0.9 * p[4]) + p[5]))
    look = np.sin(w * (t_s / (11 + 8 * p[6]) + p[7])) + 0.5 * np.sin(
        w * (t_s / (5.3 + 2 * p[8]) + p[0])
    )
    yaw = person[2]
    aside = 0.012 * shift + 0.003 * sway
    ahead = 0.004 * np.sin(w * (t_s / (4.3 + p[5]) + p[8]))
    root[0] = person[0] + np.cos(yaw) * aside - np.sin(yaw) * ahead
    root[1] = hip_height_m
    root[2] = person[1] - np.sin(yaw) * aside - np.cos(yaw) * ahead
    turned(local, 0, 0.0, yaw + 0.03 * sway, 0.02 * shift)
    turned(local, _SPINE, 0.012 * sway, 0.06 * look, -0.03 * shift)
    turned(local, _CHEST, 0.012 * breath, 0.03 * look, -0.01 * shift)
    turned(local, _NECK, -0.01 * breath, 0.06 * look, 0.0)
    turned(local, _HEAD, 0.04 * sway - 0.05, 0.14 * look, 0.0)
    lean = 0.02 * shift
    turned(local, _LEFT_LEG, 0.0, 0.0, -lean - 0.03)
    turned(local, _RIGHT_LEG, 0.0, 0.0, -lean + 0.03)
    hang = 1.54 + 0.02 * breath
    bend = 0.18 + 0.15 * p[9] + 0.04 * sway
    hang_joint(local, _LEFT_ARM, 1.0, hang, 0.06 * sway, bend)
    hang_joint(local, _RIGHT_ARM, -1.0, hang, -0.05 * sway, bend)
    if person[4] > 0.5:
        if p[9] < _RIGHT_SHARE:
            hang_joint(local, _RIGHT_ARM, -1.0, 1.20 + 0.02 * breath, 0.55, 2.45 + 0.03 * sway)
        else:
            hang_joint(local, _LEFT_ARM, 1.0, 1.20 + 0.02 * breath, 0.55, 2.45 + 0.03 * sway)


@compiled
def hang_joint(
    local: Vector, arm: int, sign: float, hang: float, forward: float, bend: float
) -> None:
    """Let an arm hang: `hang` down from the T-pose, `forward` from the shoulder, elbow `bend`.

    Radians; `sign` 1 for the left arm, −1 for the right. The forearm joint follows the arm's.
    """
    # z first brings the arm down, x then swings it to the front
    turned(local, arm, forward, 0.0, sign * hang)
    turned(local, arm + 1, 0.0, -sign * bend, 0.0)


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
    who = int(person[15])
    idle_turns(person, t_s, figures.hip_height_m[who], root[0], local[0])
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


def crowd_turns(people: Vector, t_s: float) -> tuple[Vector, Vector]:
    """Return roots (n, 3) and turns against the parent (n, 22, 4) for skinning characters."""
    hips = crowd_figures().hip_height_m
    root, local = np.empty((len(people), 3)), np.empty((len(people), N_JOINTS, 4))
    for i, person in enumerate(people):
        idle_turns(person, t_s, hips[int(person[_FIGURE])], root[i], local[i])
    return root, local
