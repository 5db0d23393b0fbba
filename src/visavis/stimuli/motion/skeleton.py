"""Skeletons: joints in a tree, all unturned at rest; where joints stand for given turns."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.slerp_kernels import forward_rows


@dataclass(frozen=True, eq=False)
class Skeleton:
    """n joints, parents before children, the root first.

    `parents` (n,) has −1 for the root. `offsets_m` (n, 3) lead from the parent to the joint at
    rest, where every joint has the axes of the world; the root's offset is zero, its place
    belongs to the motion. `tips_m` (n, 3) lead from a joint to the end of its body part (crown of
    the head, finger tip); NaN where the part ends at a child.
    """

    names: tuple[str, ...]
    parents: npt.NDArray[np.int64]
    offsets_m: Vector
    tips_m: Vector

    def __post_init__(self) -> None:
        n = len(self.names)
        parents = np.asarray(self.parents, dtype=np.int64)
        if parents.shape != (n,) or self.offsets_m.shape != (n, 3) or self.tips_m.shape != (n, 3):
            raise MotionError(f"{n} joint names, but parents, offsets or tips of another number")
        if n == 0 or parents[0] != -1 or not all(0 <= p < j for j, p in enumerate(parents) if j):
            raise MotionError("a skeleton starts with its one root and has parents before children")
        if len(set(self.names)) != n:
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise MotionError(f"joint {twice!r} appears twice in the skeleton; rename one")
        if not np.isfinite(self.offsets_m).all():
            raise MotionError("joint offsets must be finite numbers of metres")

    @cached_property
    def index_of(self) -> dict[str, int]:
        """Index of each joint by name."""
        return {name: i for i, name in enumerate(self.names)}

    def index(self, name: str) -> int:
        """Return the index of a joint.

        Raises:
            MotionError: there is no such joint.
        """
        if name not in self.index_of:
            raise MotionError(f"skeleton has no joint {name!r}; it has {', '.join(self.names)}")
        return self.index_of[name]

    @cached_property
    def mirror_index(self) -> npt.NDArray[np.int64]:
        """For every joint the index of its partner on the other side, or its own."""
        swap = {"left_": "right_", "right_": "left_"}
        partner = [
            next((swap[s] + name.removeprefix(s) for s in swap if name.startswith(s)), name)
            for name in self.names
        ]
        return np.array([self.index(name) for name in partner], dtype=np.int64)

    @cached_property
    def rest_m(self) -> Vector:
        """Joint positions (n, 3) at rest, from the root."""
        rest = np.zeros((len(self.names), 3))
        for j, parent in enumerate(self.parents[1:], start=1):
            rest[j] = rest[parent] + self.offsets_m[j]
        return rest

    @cached_property
    def leg_m(self) -> float:
        """Length of thigh and shin, mean of both sides, of a skeleton with canonical names."""
        lengths = [
            np.linalg.norm(self.offsets_m[self.index(f"{side}_{part}")])
            for side in ("left", "right")
            for part in ("lower_leg", "foot")
        ]
        return float(np.sum(lengths) / 2)


@dataclass(frozen=True, eq=False)
class Placement:
    """Joints in world: `position_m` (..., n, 3) and `orientation_wxyz` (..., n, 4)."""

    position_m: Vector
    orientation_wxyz: Vector


def forward(skeleton: Skeleton, root_m: Vector, local_wxyz: Vector) -> Placement:
    """Place all joints for root positions (..., 3) and turns against the parent (..., n, 4)."""
    n = len(skeleton.names)
    if local_wxyz.shape[-2:] != (n, 4) or root_m.shape != (*local_wxyz.shape[:-2], 3):
        raise MotionError(
            f"turns of shape {local_wxyz.shape} and roots of shape {root_m.shape} do not fit "
            f"{n} joints"
        )
    local = np.ascontiguousarray(local_wxyz, dtype=np.float64).reshape(-1, n, 4)
    root = np.ascontiguousarray(root_m, dtype=np.float64).reshape(-1, 3)
    positions, world = np.empty((len(local), n, 3)), np.empty_like(local)
    forward_rows(skeleton.parents, skeleton.offsets_m, root, local, positions, world)
    shape = local_wxyz.shape[:-2]
    return Placement(positions.reshape(*shape, n, 3), world.reshape(*shape, n, 4))


def local_of_world(skeleton: Skeleton, world_wxyz: Vector) -> Vector:
    """Return turns against the parent (..., n, 4) from orientations in world (..., n, 4)."""
    above = world_wxyz[..., skeleton.parents[1:], :]
    local = quat_multiply(quat_conjugate(above), world_wxyz[..., 1:, :])
    return np.concatenate([world_wxyz[..., :1, :], local], axis=-2)


def _finger_joints(hand_length: float) -> list[tuple[str, str, tuple[float, float, float]]]:
    """Return the finger joints of the left hand and their offsets; tips are named `.tip`."""
    straight, thumb = (-1.0, 0.0, 0.0), (-0.70, -0.15, -0.70)
    fingers = {
        "thumb": ((-0.12, -0.04, -0.15), thumb, (0.24, 0.18, 0.15)),
        "index": ((-0.50, 0.0, -0.14), straight, (0.23, 0.14, 0.11)),
        "middle": ((-0.51, 0.0, -0.03), straight, (0.25, 0.16, 0.12)),
        "ring": ((-0.48, 0.0, 0.07), straight, (0.23, 0.15, 0.11)),
        "little": ((-0.44, 0.0, 0.17), straight, (0.18, 0.11, 0.10)),
    }
    joints = []
    for finger, (knuckle, along, lengths) in fingers.items():
        above, at = "hand", np.array(knuckle)
        for part, length in zip(
            ("proximal", "middle", "distal", "tip"), (*lengths, 0), strict=True
        ):
            name = f"{finger}_{part}" if part != "tip" else f"{above}.tip"
            x, y, z = hand_length * at
            joints.append((name, above, (float(x), float(y), float(z))))
            above, at = name, length * np.array(along) / np.linalg.norm(along)
    return joints


def canonical_skeleton(height_m: float = 1.75) -> Skeleton:
    """Return the skeleton all motions of virtual humans are written for: 55 joints in a T-pose.

    It faces −z, left is −x, palms look down, thumbs forward. Names say side and part
    (`left_upper_arm`, `right_index_distal`). Segment lengths are the usual fractions of stature
    (Winter 2009, after Drillis & Contini 1966: thigh .245, shank .246, ankle height .039, upper
    arm .186, forearm .146, hand .108); trunk, face and fingers are ours.

    Raises:
        MotionError: the height is not that of a person (0.4 m to 3 m).
    """
    if not 0.4 <= height_m <= 3.0:
        raise MotionError(f"a person of {height_m} m; give a height between 0.4 m and 3 m")
    # Offsets in shares of stature, x to the right, y up, −z ahead; `.tip` ends a body part.
    trunk = [
        ("hips", "", (0.0, 0.0, 0.0)),
        ("spine", "hips", (0.0, 0.035, 0.0)),
        ("chest", "spine", (0.0, 0.065, 0.0)),
        ("upper_chest", "chest", (0.0, 0.070, 0.0)),
        ("neck", "upper_chest", (0.0, 0.110, 0.0)),
        ("head", "neck", (0.0, 0.050, 0.0)),
        ("head.tip", "head", (0.0, 0.125, 0.0)),
        ("jaw", "head", (0.0, 0.015, -0.020)),
        ("jaw.tip", "jaw", (0.0, -0.020, -0.045)),
        ("left_eye", "head", (-0.018, 0.061, -0.046)),
        ("left_eye.tip", "left_eye", (0.0, 0.0, -0.007)),
        ("right_eye", "head", (0.018, 0.061, -0.046)),
        ("right_eye.tip", "right_eye", (0.0, 0.0, -0.007)),
    ]
    # The left side; "*" marks a parent in the trunk. The right side mirrors x.
    side = [
        ("shoulder", "*upper_chest", (-0.012, 0.085, 0.0)),
        ("upper_arm", "shoulder", (-0.098, 0.0, 0.0)),
        ("lower_arm", "upper_arm", (-0.186, 0.0, 0.0)),
        ("hand", "lower_arm", (-0.146, 0.0, 0.0)),
        *_finger_joints(0.108),
        ("upper_leg", "*hips", (-0.052, -0.015, 0.0)),
        ("lower_leg", "upper_leg", (0.0, -0.245, 0.0)),
        ("foot", "lower_leg", (0.0, -0.246, 0.0)),
        ("toes", "foot", (0.0, -0.033, -0.075)),
        ("toes.tip", "toes", (0.0, -0.006, -0.040)),
    ]
    joints = list(trunk)
    for prefix, sign in (("left_", 1.0), ("right_", -1.0)):
        for name, above, (x, y, z) in side:
            parent = above[1:] if above.startswith("*") else prefix + above
            joints.append((prefix + name, parent, (sign * x, y, z)))
    names = tuple(name for name, _, _ in joints if not name.endswith(".tip"))
    index = {name: i for i, name in enumerate(names)}
    offsets, tips = np.zeros((len(names), 3)), np.full((len(names), 3), np.nan)
    parents = np.full(len(names), -1, dtype=np.int64)
    for name, parent, at in joints:
        if name.endswith(".tip"):
            tips[index[parent]] = height_m * np.array(at)
        else:
            offsets[index[name]] = height_m * np.array(at)
            parents[index[name]] = index.get(parent, -1)
    return Skeleton(names, parents, offsets, tips)
