"""Place every joint of everyone in one pass, as the matrices that move their skin."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stage.errors import StageError
from visavis.stage.geometry.contact_shapes import SOLE_JOINTS, soles_of
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.picture import PosedPeople

SOLE_TEXELS, FACE_TEXELS = len(SOLE_JOINTS), 2
"""Texels after a person's joints: places of the soles, weights of the face."""
WATCHED_JOINTS = ("hips", "head")
"""Joints whose places drawing needs for distance and culling."""


class _Bones(NamedTuple):
    """What never moves of n people with j joints: `parents` (j,), `offsets` and `rest` (n, j, 3);
    the numbers of the joints that are watched, and those that bear the `soles` (n, s, 4).
    """

    parents: npt.NDArray[np.int64]
    offsets: Vector
    rest: Vector
    watched_joints: npt.NDArray[np.int64]
    sole_joints: npt.NDArray[np.int64]
    soles: Vector


@compiled
def _fill_rows(
    bones: _Bones,
    root: Vector,
    local: Vector,
    morphs: Vector,
    world: Vector,
    place: Vector,
    rows: npt.NDArray[np.float32],
    watched_m: Vector,
) -> None:
    """Chain the turns of n people and write 3 rows of [R | p - R b] per joint, then soles and
    face. `world` (j, 4) and `place` (j, 3) are room to work in.
    """
    parents, offsets, rest, watched_joints, sole_joints, soles = bones
    joints = parents.shape[0]
    for r in range(root.shape[0]):
        for j in range(joints):
            # Parents come before their children, so that one pass chains all turns.
            p = parents[j]
            bw, bx, by, bz = local[r, j, 0], local[r, j, 1], local[r, j, 2], local[r, j, 3]
            if p < 0:
                w, x, y, z = bw, bx, by, bz
                px, py, pz = root[r, 0], root[r, 1], root[r, 2]
            else:
                aw, ax, ay, az = world[p, 0], world[p, 1], world[p, 2], world[p, 3]
                vx, vy, vz = offsets[r, j, 0], offsets[r, j, 1], offsets[r, j, 2]
                # Rotate the bone by the parent's turn, v + w t + q × t with t = 2 q × v, then
                # multiply turns.
                tx, ty = 2 * (ay * vz - az * vy), 2 * (az * vx - ax * vz)
                tz = 2 * (ax * vy - ay * vx)
                px = place[p, 0] + vx + aw * tx + ay * tz - az * ty
                py = place[p, 1] + vy + aw * ty + az * tx - ax * tz
                pz = place[p, 2] + vz + aw * tz + ax * ty - ay * tx
                w = aw * bw - ax * bx - ay * by - az * bz
                x = aw * bx + ax * bw + ay * bz - az * by
                y = aw * by - ax * bz + ay * bw + az * bx
                z = aw * bz + ax * by - ay * bx + az * bw
            world[j, 0], world[j, 1], world[j, 2], world[j, 3] = w, x, y, z
            place[j, 0], place[j, 1], place[j, 2] = px, py, pz
            r00, r01, r02 = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
            r10, r11, r12 = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
            r20, r21, r22 = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
            ox, oy, oz = rest[r, j, 0], rest[r, j, 1], rest[r, j, 2]
            c = 3 * j
            rows[r, c, 0], rows[r, c, 1], rows[r, c, 2] = r00, r01, r02
            # Translation that takes the joint's place at rest to its place now: p − R b.
            rows[r, c, 3] = px - (r00 * ox + r01 * oy + r02 * oz)
            rows[r, c + 1, 0], rows[r, c + 1, 1], rows[r, c + 1, 2] = r10, r11, r12
            rows[r, c + 1, 3] = py - (r10 * ox + r11 * oy + r12 * oz)
            rows[r, c + 2, 0], rows[r, c + 2, 1], rows[r, c + 2, 2] = r20, r21, r22
            rows[r, c + 2, 3] = pz - (r20 * ox + r21 * oy + r22 * oz)
        for s in range(sole_joints.shape[0]):
            # Soles move rigidly with the foot; the contact shadows are laid under them.
            c, at = 3 * sole_joints[s], 3 * joints + s
            for i in range(3):
                rows[r, at, i] = rows[r, c + i, 3] + (
                    rows[r, c + i, 0] * soles[r, s, 0]
                    + rows[r, c + i, 1] * soles[r, s, 1]
                    + rows[r, c + i, 2] * soles[r, s, 2]
                )
            rows[r, at, 3] = soles[r, s, 3]
        for k in range(morphs.shape[1]):
            rows[r, 3 * joints + sole_joints.shape[0] + k // 4, k % 4] = morphs[r, k]
        for k in range(watched_joints.shape[0]):
            for i in range(3):
                watched_m[r, k, i] = place[watched_joints[k], i]


class JointRows:
    """The joints of one cast: lengths gathered once, matrices written anew each frame.

    `rows` (n, 3 j + 6, 4) float32 is what the graphics card reads; `watched_m` (n, 2, 3) is where
    `WATCHED_JOINTS` stand.
    """

    def __init__(self, cast: tuple[Character, ...]) -> None:
        n = len(cast)
        joints = len(cast[0].skeleton.names) if cast else 1
        for person in cast:
            if person.skeleton.names != cast[0].skeleton.names:
                raise StageError(
                    f"{person.name} has other joints than {cast[0].name}",
                    remedy="give every character the joints of the canonical skeleton",
                )
        self.joint_count = joints
        self.rows = np.zeros((n, 3 * joints + SOLE_TEXELS + FACE_TEXELS, 4), np.float32)
        self.watched_m = np.zeros((n, len(WATCHED_JOINTS), 3))

        def indices_of(names: tuple[str, ...]) -> npt.NDArray[np.int64]:
            return np.array([cast[0].skeleton.index(k) if cast else 0 for k in names], np.int64)

        self._bones = _Bones(
            np.asarray(cast[0].skeleton.parents, np.int64) if cast else np.zeros(1, np.int64),
            np.array([c.skeleton.offsets_m for c in cast]).reshape(n, joints, 3),
            np.array([c.skeleton.rest_m for c in cast]).reshape(n, joints, 3),
            indices_of(WATCHED_JOINTS),
            indices_of(SOLE_JOINTS),
            np.array([soles_of(c) for c in cast]).reshape(n, SOLE_TEXELS, 4),
        )
        self._world, self._place = np.empty((joints, 4)), np.empty((joints, 3))

    @property
    def sole_column(self) -> int:
        """The first of a row's texels that say where its soles are."""
        return 3 * self.joint_count

    def pose(self, people: PosedPeople) -> None:
        """Write the matrices of this frame.

        Raises:
            StageError: the arrays do not fit the cast.
        """
        n = len(self.rows)
        shapes = (people.root_m.shape, people.orientation_wxyz.shape, people.morphs_01.shape)
        if shapes != ((n, 3), (n, self.joint_count, 4), (n, len(MORPHS))):
            if n == 0 and people.root_m.shape[0] == 0:
                return
            raise StageError(
                f"poses of shapes {shapes} do not fit a cast of {n} people with "
                f"{self.joint_count} joints",
                remedy="pose every person of the cast, in its order",
            )
        _fill_rows(
            self._bones,
            np.ascontiguousarray(people.root_m, np.float64),
            np.ascontiguousarray(people.orientation_wxyz, np.float64),
            np.ascontiguousarray(people.morphs_01, np.float64),
            self._world,
            self._place,
            self.rows,
            self.watched_m,
        )
