"""Which parts of a body an observer perceives, for many poses at once."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Pose, Vector, rotate
from visavis.stimuli.characters.body_parts import GROUPS, PART_INDEX, PARTS
from visavis.stimuli.characters.character import Character, Material, SkinnedMesh
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.raster_kernels import (
    BOTH_SIDES,
    Bytes,
    Faces,
    Floats,
    Ground,
    Moving,
    Posed,
    Skin,
    joint_matrices,
    perceive,
    pose_first,
    skin_points,
)
from visavis.stimuli.picture import StaticMesh

MAX_KNOWN: Final = 64
INSIDE_TURNS: Final = 0.5
"""Winding number above which a point counts as inside a body."""


@dataclass(frozen=True, eq=False)
class SeenBody:
    """A skinned body as the buffer's kernels read it: `labels` are parts, plus `BOTH_SIDES` where
    a triangle is seen from behind as well.
    """

    skeleton: Skeleton
    rest: Floats
    joints: Bytes
    weights: Floats
    triangles: npt.NDArray[np.int32]
    labels: Bytes

    @property
    def skin(self) -> Skin:
        """The vertices as the kernels read them."""
        return Skin(self.rest, self.joints, self.weights)

    @property
    def faces(self) -> Faces:
        """The triangles as the kernels read them."""
        return Faces(self.triangles, self.labels)

    def first_in(self, view: Outlook, matrices: Floats) -> Posed:
        """Return the body in a pose (55, 3, 4) as a view sees it."""
        return pose_first(self.skin, self.faces, matrices, view.eye, *view.size_px)

    @cached_property
    def _moving_of(self) -> dict[bytes, Moving]:
        return {}

    def moving_with(self, joints: npt.NDArray[np.bool_]) -> Moving:
        """Return what moves when these joints (55,) do; kept, for probes ask again and again."""
        key = joints.tobytes()
        moving = self._moving_of.get(key)
        if moving is None:
            vertex = np.any(joints[self.joints] & (self.weights > 0), axis=1)
            triangle = vertex[self.triangles].any(axis=1)
            moving = Moving(
                np.flatnonzero(vertex),
                Faces(self.triangles[triangle], self.labels[triangle]),
                ~triangle,
            )
            if len(self._moving_of) >= MAX_KNOWN:
                self._moving_of.clear()
            self._moving_of[key] = moving
        return moving


def seen_body(
    mesh: SkinnedMesh, skeleton: Skeleton, materials: Sequence[Material] = ()
) -> SeenBody:
    """Pack one level of detail of a character; hair and cloth are seen from both sides."""
    both = np.array([m.double_sided for m in materials] or [False])
    material = mesh.triangle_material if materials else np.zeros(len(mesh.triangles), np.uint8)
    return SeenBody(
        skeleton=skeleton,
        rest=np.ascontiguousarray(mesh.vertices_m, dtype=np.float64),
        joints=np.ascontiguousarray(mesh.joints, dtype=np.uint8),
        weights=np.ascontiguousarray(mesh.weights, dtype=np.float64),
        triangles=np.ascontiguousarray(mesh.triangles, dtype=np.int32),
        labels=np.ascontiguousarray(
            mesh.triangle_part + BOTH_SIDES * both[material], dtype=np.uint8
        ),
    )


def body_of(character: Character, *, most_triangles: int = 8000) -> SeenBody:
    """Pack the finest copy for measuring of a character with at most so many triangles."""
    fitting = [m for m in character.measuring if len(m.triangles) <= most_triangles]
    mesh = (fitting or character.measuring[-1:])[0]
    return seen_body(mesh, character.skeleton, character.materials)


def holding(body: SeenBody, thing: StaticMesh, joint: str, grip: Pose) -> SeenBody:
    """Put a rigid thing into a hand: `grip` leads from the thing's frame to the joint's at rest.

    Its triangles bear the part "held_object". Raises MotionError for an unknown joint.
    """
    index = body.skeleton.index(joint)
    at_rest = body.skeleton.rest_m[index] + grip.position_m
    points = rotate(grip.orientation_wxyz, thing.vertices_m.astype(np.float64)) + at_rest
    n, t = len(points), len(thing.triangles)
    joints: Bytes = np.zeros((n, 4), dtype=np.uint8)
    joints[:, 0] = index
    weights = np.zeros((n, 4))
    weights[:, 0] = 1.0
    label: Bytes = np.full(t, PART_INDEX["held_object"], dtype=np.uint8)
    return replace(
        body,
        rest=np.concatenate([body.rest, points]),
        joints=np.concatenate([body.joints, joints]),
        weights=np.concatenate([body.weights, weights]),
        triangles=np.concatenate([body.triangles, thing.triangles + np.int32(len(body.rest))]),
        labels=np.concatenate([body.labels, label]),
    )


def mask_of(parts: tuple[str, ...]) -> npt.NDArray[np.bool_]:
    """Return which part numbers (256,) belong to named parts or groups of parts.

    Raises:
        MotionError: there is no such part or group.
    """
    mask = np.zeros(256, dtype=np.bool_)
    for name in parts:
        if name not in GROUPS and name not in PARTS[1:]:
            names = ", ".join((*PARTS[1:], *GROUPS))
            raise MotionError(f"there is no body part {name!r}; choose from {names}")
        for part in GROUPS.get(name, (name,)):
            mask[PART_INDEX[part]] = True
    return mask


def matrices_of(skeleton: Skeleton, root_m: Vector, local_wxyz: Vector) -> Floats:
    """Return matrices (n, 55, 3, 4) that lead rest points to n poses."""
    roots = np.ascontiguousarray(root_m, dtype=np.float64).reshape(-1, 3)
    turns = np.ascontiguousarray(local_wxyz, dtype=np.float64).reshape(len(roots), -1, 4)
    out = np.empty((len(roots), turns.shape[1], 3, 4))
    joint_matrices(skeleton.parents, skeleton.offsets_m, skeleton.rest_m, roots, turns, out)
    return out


def perceived_parts(
    body: SeenBody,
    view: Outlook,
    root_m: Vector,
    local_wxyz: Vector,
    *,
    pool: ThreadPoolExecutor | None = None,
    threads: int = 1,
) -> Bytes:
    """Return the perceived part (n, h, w) at every pixel for poses root (n, 3), turns (n, 55, 4).

    0 is nothing, an occluder, or a part in the dark. With a pool the poses are shared among
    `threads`; the result is the same.
    """
    matrices = matrices_of(body.skeleton, root_m, local_wxyz)
    ids = _unknown_parts(view, len(matrices))
    if len(matrices) == 0:
        return ids
    # Poses that move the same joints share the still rest of the body, which is drawn once.
    groups, first = poses_alike(body, matrices), body.first_in(view, matrices[0])

    def work(share: Sequence[tuple[Moving, npt.NDArray[np.int64]]]) -> None:
        _perceive_groups(body, view, first, matrices, share, ids)

    if pool is None or threads < 2 or len(matrices) < threads:
        work(groups)
    else:
        for job in [pool.submit(work, share) for share in _deal(groups, threads)]:
            job.result()
    return ids


def seen_and_free_parts(
    body: SeenBody, view: Outlook, root_m: Vector, local_wxyz: Vector
) -> tuple[Bytes, Bytes]:
    """Return the perceived part (n, h, w) at every pixel for poses root (n, 3), turns (n, 55, 4),
    and what would be perceived with nothing in between.
    """
    matrices = matrices_of(body.skeleton, root_m, local_wxyz)
    free, visible = _unknown_parts(view, len(matrices)), _unknown_parts(view, len(matrices))
    nothing = replace(view, behind=np.zeros_like(view.behind))
    if len(matrices):
        groups = poses_alike(body, matrices)
        first = body.first_in(nothing, matrices[0])
        _perceive_groups(body, nothing, first, matrices, groups, free, (view.behind, visible))
    return visible, free


_NOTHING_BEFORE: Final = (np.empty((0, 0)), np.empty((0, 0, 0), dtype=np.uint8))


def _unknown_parts(view: Outlook, n: int) -> Bytes:
    height, width = view.size_px
    return np.empty((n, height, width), dtype=np.uint8)


def _perceive_groups(
    body: SeenBody,
    view: Outlook,
    first: Posed,
    matrices: Floats,
    groups: Sequence[tuple[Moving, npt.NDArray[np.int64]]],
    ids: Bytes,
    before_and_visible: tuple[Floats, Bytes] = _NOTHING_BEFORE,
) -> None:
    # The more moves, the less is still: what is drawn for one group serves those that move less.
    grounds: list[tuple[Moving, Ground]] = []
    for moving, rows in sorted(groups, key=lambda one: -len(one[0].faces.labels)):
        for other, under in reversed(grounds):
            if not (other.is_still & ~moving.is_still).any():
                missing = moving.is_still & ~other.is_still
                ground = Ground(under.ids.copy(), under.nearness.copy(), missing)
                break
        else:
            ground = Ground(np.zeros(view.size_px, np.uint8), view.behind.copy(), moving.is_still)
        grounds.append((moving, ground))
        perceive(
            body.skin,
            moving,
            first,
            ground,
            matrices,
            rows,
            view.eye,
            view.lighting,
            ids,
            *before_and_visible,
        )


def poses_alike(body: SeenBody, matrices: Floats) -> list[tuple[Moving, npt.NDArray[np.int64]]]:
    """Sort poses by which joints stand elsewhere than in the first one, at most: where nothing
    does, a pose is among the largest group, as if they did.
    """
    differs = (matrices != matrices[0]).any(axis=(2, 3))
    rows_of: dict[bytes, list[int]] = {}
    for k, row in enumerate(differs):
        rows_of.setdefault(row.tobytes(), []).append(k)
    like_first = rows_of.pop(bytes(differs.shape[1]))
    largest = max(rows_of, key=lambda key: len(rows_of[key]), default=bytes(differs.shape[1]))
    rows_of[largest] = sorted([*like_first, *rows_of.get(largest, [])])
    return [
        (body.moving_with(np.frombuffer(joints, np.bool_)), np.array(rows, dtype=np.int64))
        for joints, rows in rows_of.items()
    ]


def _deal(
    groups: list[tuple[Moving, npt.NDArray[np.int64]]], threads: int
) -> list[list[tuple[Moving, npt.NDArray[np.int64]]]]:
    """Deal poses to threads so that each draws about as many triangles."""
    costs = np.concatenate([np.full(len(r), 1.0 + len(m.faces.triangles)) for m, r in groups])
    cost_before = np.cumsum(costs) - costs / 2
    thread_of = np.minimum((cost_before * threads / costs.sum()).astype(int), threads - 1)
    shares: list[list[tuple[Moving, npt.NDArray[np.int64]]]] = [[] for _ in range(threads)]
    start = 0
    for moving, rows in groups:
        mine = thread_of[start : start + len(rows)]
        for n in np.unique(mine):
            shares[n].append((moving, rows[mine == n]))
        start += len(rows)
    return shares


def posed_points(body: SeenBody, root_m: Vector, local_wxyz: Vector) -> Floats:
    """Return the vertices (v, 3) of a body in one pose."""
    out = np.empty_like(body.rest)
    matrix = matrices_of(body.skeleton, root_m[None], local_wxyz[None])[0]
    skin_points(body.skin, matrix, out)
    return out


def refuse_observer_inside(
    body: SeenBody, eye_m: Vector, root_m: Vector, local_wxyz: Vector
) -> None:
    """Raise MotionError when the observer's eye is inside the posed body."""
    corners = posed_points(body, root_m, local_wxyz)[body.triangles] - eye_m
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    solid = np.sum(a * np.cross(b, c), axis=1)
    flat = (
        la * lb * lc
        + np.sum(a * b, axis=1) * lc
        + np.sum(b * c, axis=1) * la
        + np.sum(c * a, axis=1) * lb
    )
    turns = float(np.sum(2 * np.arctan2(solid, flat)) / (4 * np.pi))
    if abs(turns) > INSIDE_TURNS or min(la.min(), lb.min(), lc.min()) < 1e-3:
        raise MotionError(
            f"the observer's eye at {np.round(eye_m, 2).tolist()} is inside the body it observes; "
            "move the observer"
        )
