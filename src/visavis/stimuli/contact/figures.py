"""The people of a crowd as capsules for contact, fitted to the characters that are drawn.

Every character that plays a part becomes nineteen capsules on its own skeleton, fitted to its
closed surface, so that what is seen is what touches.
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.closing import collision_mesh
from visavis.stimuli.contact.body import CAPSULE_JOINTS, bones
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.scenes.station_crowd import CHARACTERS


class Figures(NamedTuple):
    """k people in their own measures, as compiled kernels read them.

    `parents` (22,) of `BODY_JOINTS`; `lengths_m` (k, B_SIZE) of their builds; `skeleton_m`
    (k, 55, 3) offsets of all joints, `offsets_m` (k, 22, 3) of the body's; `columns` (19,) the
    joint each capsule hangs on; `start_m`, `end_m` (k, 19, 3) in that joint's frame at rest and
    `radius_m` (k, 19).
    """

    parents: npt.NDArray[np.int64]
    lengths_m: Vector
    skeleton_m: Vector
    offsets_m: Vector
    columns: npt.NDArray[np.int64]
    start_m: Vector
    end_m: Vector
    radius_m: Vector


@cache
def crowd_figures() -> Figures:
    """Return the figures that play `CHARACTERS`, in that order."""
    cast = [default_casting(part) for part in CHARACTERS]
    capsules_of_cast = [_capsules(person) for person in cast]
    starts, ends, radii = (np.array(rows) for rows in zip(*capsules_of_cast, strict=True))
    columns = [BODY_JOINTS.index(name) for name in CAPSULE_JOINTS]
    return Figures(
        parents=bones().parents,
        lengths_m=np.array([build_of(person).lengths_m for person in cast]),
        skeleton_m=np.array([person.skeleton.offsets_m for person in cast]),
        offsets_m=np.array([_offsets(person) for person in cast]),
        columns=np.array(columns),
        start_m=starts,
        end_m=ends,
        radius_m=radii,
    )


def _offsets(person: Character) -> Vector:
    index = [person.skeleton.index(name) for name in BODY_JOINTS]
    offsets: Vector = person.skeleton.offsets_m[index]
    return offsets


_ALONG: Final = {
    "neck": "head",
    "shoulder": "upper_arm",
    "upper_arm": "lower_arm",
    "lower_arm": "hand",
    "upper_leg": "lower_leg",
    "lower_leg": "foot",
}
"""Limbs lie along the way from their joint to this one."""
_FINGERS: Final = 1.6
"""The hand's capsule ends at this many times the way from the wrist to the knuckle."""
_BANDS: Final = ("hips", "spine", "upper_chest")
_TRUNK: Final = (*_BANDS, "chest")
_ROUNDS: Final = 5
_EVERY: Final = 4
"""Step through the surface's vertices: every fourth is enough to fit nineteen capsules."""


@cache
def _capsules(person: Character) -> tuple[Vector, Vector, Vector]:
    """Return starts, ends (19, 3) and radii (19,) fitted to a character's closed surface."""
    mesh, skeleton = collision_mesh(person), person.skeleton
    points = mesh.vertices_m[::_EVERY].astype(np.float64)
    owner = _owners(person)[::_EVERY]
    rest = {name: skeleton.rest_m[skeleton.index(name)] for name in BODY_JOINTS}
    trunk = points[np.isin(owner, [BODY_JOINTS.index(name) for name in _TRUNK])]
    starts, ends, radii = np.empty((19, 3)), np.empty((19, 3)), np.empty(19)
    for k, name in enumerate(CAPSULE_JOINTS):
        own = points[owner == BODY_JOINTS.index(name)]
        part = name.removeprefix("left_").removeprefix("right_")
        if part in _BANDS:
            starts[k], ends[k], radii[k] = _lying(trunk, _BANDS.index(part))
        elif part in _ALONG:
            side = name.removesuffix(part)
            onward = rest["head" if part == "neck" else side + _ALONG[part]]
            starts[k], ends[k], radii[k] = _along(own, rest[name], onward)
        elif part == "hand":
            side = name.removesuffix(part)
            knuckle = skeleton.rest_m[skeleton.index(f"{side}middle_proximal")]
            onward = rest[name] + _FINGERS * (knuckle - rest[name])
            starts[k], ends[k], radii[k] = _along(own, rest[name], onward)
        else:
            starts[k], ends[k], radii[k] = _round_long(own, {"head": 1, "foot": 2}[part])
    _settle(points, starts, ends, radii)
    _mirror(starts, ends, radii)
    at = np.array([rest[name] for name in CAPSULE_JOINTS])
    return starts - at, ends - at, radii


def _owners(person: Character) -> npt.NDArray[np.int64]:
    """Return for every vertex the body joint that moves it most; fingers count as the hand."""
    skeleton, mesh = person.skeleton, collision_mesh(person)
    body_joint_of = {skeleton.index(name): i for i, name in enumerate(BODY_JOINTS)}
    body = np.empty(len(skeleton.names), np.int64)
    for joint in range(len(body)):
        at = joint
        while at not in body_joint_of:
            at = int(skeleton.parents[at])
        body[joint] = body_joint_of[at]
    for side in ("left", "right"):
        body[skeleton.index(f"{side}_toes")] = BODY_JOINTS.index(f"{side}_foot")
    strongest = mesh.joints[np.arange(len(mesh.joints)), mesh.weights.argmax(axis=1)]
    owner: npt.NDArray[np.int64] = body[strongest]
    return owner


def _lying(trunk: Vector, band: int) -> tuple[Vector, Vector, float]:
    """Return a capsule across one of three equal bands of a trunk, from below."""
    low, high = np.quantile(trunk[:, 1], [0.01, 0.99])
    height = (high - low) / 3
    middle = low + (band + 0.5) * height
    own = trunk[np.abs(trunk[:, 1] - middle) < height / 2]
    back, front = np.quantile(own[:, 2], [0.03, 0.97])
    radius = (front - back) / 2
    half = max(float(np.quantile(np.abs(own[:, 0]), 0.97)) - radius, 0.01)
    centre = np.array([0.0, middle, (front + back) / 2])
    aside = np.array([half, 0.0, 0.0])
    return centre - aside, centre + aside, radius


def _along(own: Vector, joint: Vector, onward: Vector) -> tuple[Vector, Vector, float]:
    """Return a capsule along a bone, moved to the middle of its flesh."""
    length = float(np.linalg.norm(onward - joint))
    axis = (onward - joint) / length
    share = (own - joint) @ axis / length
    flesh = own[(share > 0.1) & (share < 0.9)]
    off = flesh - joint - ((flesh - joint) @ axis)[:, None] * axis
    middle = (np.quantile(off, 0.05, axis=0) + np.quantile(off, 0.95, axis=0)) / 2
    radius = float(np.linalg.norm(off - middle, axis=1).mean())
    return joint + middle, onward + middle, radius


def _round_long(own: Vector, axis: int) -> tuple[Vector, Vector, float]:
    """Return a capsule along one of the world's axes through a piece."""
    low, high = own.min(axis=0), own.max(axis=0)
    centre = (low + high) / 2
    others = [k for k in range(3) if k != axis]
    radius = float(np.linalg.norm((own - centre)[:, others], axis=1).mean())
    start, end = centre.copy(), centre.copy()
    half = max((high[axis] - low[axis]) / 2 - radius, 0.005)
    start[axis] += half
    end[axis] -= half
    return start, end, radius


def _settle(points: Vector, starts: Vector, ends: Vector, radii: Vector) -> None:
    """Make radii such that the surface lies on the capsules nearest to it, on average."""
    for _ in range(_ROUNDS):
        over = over_capsules(points, starts, ends, radii)
        nearest = over.argmin(axis=1)
        least = over.min(axis=1)
        for k in range(len(radii)):
            own = least[nearest == k]
            if len(own) >= 8:
                radii[k] = max(radii[k] + 0.7 * float(own.mean()), 0.01)


def over_capsules(points: Vector, starts: Vector, ends: Vector, radii: Vector) -> Vector:
    """Return how far points (n, 3) lie outside each of m capsules (n, m); below 0 is inside."""
    along = ends - starts
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    rel = points[:, None] - starts
    share = np.clip((rel * along).sum(axis=2) / square, 0, 1)
    over: Vector = np.linalg.norm(rel - share[:, :, None] * along, axis=2) - radii
    return over


def _mirror(starts: Vector, ends: Vector, radii: Vector) -> None:
    """Give left and right the mean of both, in place."""
    for k, name in enumerate(CAPSULE_JOINTS):
        if name.startswith("left_"):
            j = CAPSULE_JOINTS.index(name.replace("left_", "right_"))
            radii[k] = radii[j] = (radii[k] + radii[j]) / 2
            for ends_of in (starts, ends):
                mean = (ends_of[k] + ends_of[j] * [-1, 1, 1]) / 2
                ends_of[k], ends_of[j] = mean, mean * [-1, 1, 1]
