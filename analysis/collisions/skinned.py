"""Closed surfaces moved by joints, many of them in one table for compiled kernels.

Linear blend skinning. A cheap and strict test comes before any volume: every piece of a surface
(the vertices that one joint moves most) lies in the box of its images by the joints that move it,
because a blended vertex lies between its images. Where no boxes meet, nothing is shared. Once
posed, the boxes of the faces of each slice of a piece are tighter and are tested again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.errors import MalformedMesh
from visavis.analysis.collisions.meshes import ClosedMesh, Faces
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.quaternion_kernels import write_matrix

Bones = npt.NDArray[np.int16]
Index = npt.NDArray[np.int64]

SLICE_M = 0.08
"""Thickness of the slices into which a piece is cut along its longest side at rest. Each is a ring
or a cap of the surface, so its box holds what lies inside, too."""


@dataclass(frozen=True, eq=False)
class SkinnedBody:
    """One closed surface at rest with what moves it.

    `rest_m` (v, 3) and `faces` (f, 3); `bones` (v, 4) joints with `weights` (v, 4) that sum to 1;
    `joints_m` (j, 3) where the joints are at rest, their axes those of the world.
    """

    rest_m: Vector
    faces: Faces
    bones: Bones
    weights: Vector
    joints_m: Vector

    def __post_init__(self) -> None:
        v = len(self.rest_m)
        if self.bones.shape != (v, 4) or self.weights.shape != (v, 4):
            raise MalformedMesh(
                f"{v} vertices with bones {self.bones.shape} and weights {self.weights.shape}; "
                "give four of each a vertex"
            )
        if v and not np.allclose(self.weights.sum(axis=1), 1, atol=1e-3):
            row = int(np.abs(self.weights.sum(axis=1) - 1).argmax())
            raise MalformedMesh(
                f"weights of vertex {row} sum to {self.weights[row].sum():g}; make them sum to 1"
            )

    def mesh_at(
        self, position_m: Vector, orientation_wxyz: Vector, scale: float = 1.0
    ) -> ClosedMesh:
        """Return the surface at joints (j, 3) and (j, 4) in world, at `scale` times its size."""
        vertices = np.empty_like(self.rest_m)
        moves = np.empty((len(self.joints_m), 3, 4))
        joint_moves(position_m, orientation_wxyz, self.joints_m, scale, moves)
        skin_vertices(self.rest_m, self.bones, self.weights, moves, vertices)
        return ClosedMesh(vertices, self.faces)


class Bodies(NamedTuple):
    """k surfaces one after the other; those of body i are `begin[i]` to `begin[i + 1]` of each.

    `vertex`, `face` and `piece` are these beginnings (k + 1,); `joints_m` (k, j, 3). A piece
    belongs to a `group` of its body, is moved by one `joint`, and holds at rest what lies within
    `half_m` of `centre_m`; `groups` (k,) counts them. `corner` are vertices, the corners of
    the faces of every slice of a group, `slice` which; `corners` their beginnings (k + 1,).
    """

    vertex: Index
    rest_m: Vector
    bones: Bones
    weights: Vector
    face: Index
    faces: Faces
    joints_m: Vector
    piece: Index
    group: Index
    joint: Index
    centre_m: Vector
    half_m: Vector
    groups: Index
    corners: Index
    corner: Faces
    slice: Faces
    slices: Index


def pack(bodies: Sequence[SkinnedBody]) -> Bodies:
    """Put surfaces with the same joints into one table."""
    pieces = [_pieces(body) for body in bodies]
    corners = [_corners(body) for body in bodies]

    def beginnings(sizes: Sequence[int]) -> Index:
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    return Bodies(
        vertex=beginnings([len(b.rest_m) for b in bodies]),
        rest_m=np.concatenate([b.rest_m for b in bodies]),
        bones=np.concatenate([b.bones for b in bodies]),
        weights=np.concatenate([b.weights for b in bodies]),
        face=beginnings([len(b.faces) for b in bodies]),
        faces=np.concatenate([b.faces for b in bodies]),
        joints_m=np.array([b.joints_m for b in bodies]),
        piece=beginnings([len(p[0]) for p in pieces]),
        group=np.concatenate([p[0] for p in pieces]),
        joint=np.concatenate([p[1] for p in pieces]),
        centre_m=np.concatenate([p[2] for p in pieces]),
        half_m=np.concatenate([p[3] for p in pieces]),
        groups=np.array([p[0].max() + 1 for p in pieces], np.int64),
        corners=beginnings([len(c[0]) for c in corners]),
        corner=np.concatenate([c[0] for c in corners]),
        slice=np.concatenate([c[1] for c in corners]),
        slices=np.array([c[1].max() + 1 for c in corners], np.int64),
    )


def _strongest(body: SkinnedBody) -> Bones:
    strongest: Bones = body.bones[np.arange(len(body.bones)), body.weights.argmax(axis=1)]
    return strongest


def _corners(body: SkinnedBody) -> tuple[Faces, Faces]:
    """Return the corners of the faces of every slice, each once, and the slice; by slice.

    A face belongs to the slice of its first corner, so every face lies in a box whole.
    """
    strongest = _strongest(body)
    key = np.zeros((len(strongest), 2), np.int64)
    for bone in np.unique(strongest).tolist():
        members = np.flatnonzero(strongest == bone)
        rest_m = body.rest_m[members]
        axis = int(np.ptp(rest_m, axis=0).argmax())
        key[members, 0] = bone
        key[members, 1] = np.floor((rest_m[:, axis] - rest_m[:, axis].min()) / SLICE_M)
    slices = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    both = np.stack([np.repeat(slices[body.faces[:, 0]], 3), body.faces.ravel()], axis=1)
    both = np.unique(both, axis=0).astype(np.int32)
    return np.ascontiguousarray(both[:, 1]), np.ascontiguousarray(both[:, 0])


def _pieces(body: SkinnedBody) -> tuple[Index, Index, Vector, Vector]:
    strongest = _strongest(body)
    groups, joints, centres, halves = [], [], [], []
    for number, bone in enumerate(np.unique(strongest).tolist()):
        members = np.flatnonzero(strongest == bone)
        joints_of_members = body.bones[members]
        has_weight = body.weights[members] > 0
        for joint in np.unique(joints_of_members[has_weight]).tolist():
            own = members[((joints_of_members == joint) & has_weight).any(axis=1)]
            low, high = body.rest_m[own].min(axis=0), body.rest_m[own].max(axis=0)
            groups.append(number)
            joints.append(joint)
            centres.append((low + high) / 2)
            halves.append((high - low) / 2)
    return np.array(groups), np.array(joints), np.array(centres), np.array(halves)


@compiled
def joint_moves(
    position: Vector, world: Vector, joints_m: Vector, scale: float, moves: Vector
) -> None:
    """Write what takes points at rest to world, (j, 3, 4), from joints (j, 3) and (j, 4)."""
    # x ↦ s·R·(x − joint at rest) + joint now, as one 3 × 4 matrix.
    for j in range(position.shape[0]):
        m = moves[j]
        write_matrix((world[j, 0], world[j, 1], world[j, 2], world[j, 3]), m)
        for r in range(3):
            for c in range(3):
                m[r, c] *= scale
            m[r, 3] = position[j, r] - (
                m[r, 0] * joints_m[j, 0] + m[r, 1] * joints_m[j, 1] + m[r, 2] * joints_m[j, 2]
            )


@compiled
def skin_vertices(rest: Vector, bones: Bones, weights: Vector, moves: Vector, out: Vector) -> None:
    """Write vertices (v, 3) moved by the blend of their four joints."""
    # Linear blend skinning: Σ weight · move(vertex) over the four joints.
    for v in range(rest.shape[0]):
        x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
        px = py = pz = 0.0
        for k in range(4):
            w = weights[v, k]
            if w == 0.0:
                continue
            m = moves[bones[v, k]]
            px += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
            py += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
            pz += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
        out[v, 0], out[v, 1], out[v, 2] = px, py, pz


@compiled
def group_boxes(
    group: Index,
    joint: Index,
    centre_m: Vector,
    half_m: Vector,
    n_groups: int,
    moves: Vector,
    boxes: Vector,
    whole: Vector,
) -> None:
    """Write the boxes (g, 6) that hold the posed groups, and the one (6,) that holds them all."""
    for g in range(n_groups):
        for c in range(3):
            boxes[g, c], boxes[g, c + 3] = np.inf, -np.inf
    for q in range(group.shape[0]):
        g, m = group[q], moves[joint[q]]
        for r in range(3):
            # The box of a turned box: |R| · half sides round the moved centre.
            at = m[r, 3]
            reach = 0.0
            for c in range(3):
                at += m[r, c] * centre_m[q, c]
                reach += abs(m[r, c]) * half_m[q, c]
            boxes[g, r] = min(boxes[g, r], at - reach)
            boxes[g, r + 3] = max(boxes[g, r + 3], at + reach)
    for c in range(3):
        whole[c], whole[c + 3] = np.inf, -np.inf
    for g in range(n_groups):
        for c in range(3):
            whole[c] = min(whole[c], boxes[g, c])
            whole[c + 3] = max(whole[c + 3], boxes[g, c + 3])


@compiled
def posed_boxes(
    vertices_m: Vector, corner: Faces, piece: Faces, n_slices: int, boxes: Vector
) -> None:
    """Write the boxes (s, 6) of the faces of each slice of a posed body."""
    for g in range(n_slices):
        for c in range(3):
            boxes[g, c], boxes[g, c + 3] = np.inf, -np.inf
    for k in range(corner.shape[0]):
        v, box = vertices_m[corner[k]], boxes[piece[k]]
        for c in range(3):
            box[c] = min(box[c], v[c])
            box[c + 3] = max(box[c + 3], v[c])


@compiled
def boxes_meet(a: Vector, b: Vector) -> bool:
    """Tell whether two boxes (6,) share volume."""
    return bool(
        a[0] < b[3] and b[0] < a[3] and a[1] < b[4] and b[1] < a[4] and a[2] < b[5] and b[2] < a[5]
    )


@compiled
def any_boxes_meet(a: Vector, n_a: int, b: Vector, n_b: int, whole_b: Vector) -> bool:
    """Tell whether any of the first boxes of `a` meets any of `b`."""
    for i in range(n_a):
        if boxes_meet(a[i], whole_b):
            for j in range(n_b):
                if boxes_meet(a[i], b[j]):
                    return True
    return False


@compiled
def box_of_meetings(a: Vector, n_a: int, b: Vector, n_b: int, whole_b: Vector, box: Vector) -> bool:
    """Write the box (2, 3) around everything the first boxes of `a` share with those of `b`, and
    tell whether there is anything.
    """
    box[0], box[1] = np.inf, -np.inf
    for i in range(n_a):
        if not boxes_meet(a[i], whole_b):
            continue
        for j in range(n_b):
            if not boxes_meet(a[i], b[j]):
                continue
            # Union of the pairwise intersections; `box` stays inverted where no pair meets.
            for k in range(3):
                box[0, k] = min(box[0, k], max(a[i, k], b[j, k]))
                box[1, k] = max(box[1, k], min(a[i, k + 3], b[j, k + 3]))
    return bool(box[0, 0] < box[1, 0])
