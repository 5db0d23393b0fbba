"""Closed surfaces moved by joints, many of them in one table for compiled kernels.

Linear blend skinning, of no more than a volume needs. Every slice of a surface lies in the box of
its images by the joints that move it, because a blended vertex lies between its images. Only slices
whose boxes meet those of another body are posed, which gives tighter boxes; where these do not meet
either, nothing is shared.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.contact import boxes_meeting
from visavis.analysis.collisions.errors import MalformedMesh
from visavis.analysis.collisions.meshes import ClosedMesh, Faces
from visavis.analysis.collisions.pair import corners_of
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.quaternion_kernels import write_matrix

Bones = npt.NDArray[np.int16]
Index = npt.NDArray[np.int64]
Index32 = npt.NDArray[np.int32]

SLICE_M = 0.08
"""Thickness of the slices into which a piece is cut along its longest side at rest. Each is a ring
or a cap of the surface, so its box holds what lies inside, too."""
_PLANES = 12
"""So many planes are tried between two slices whose boxes meet."""
_ROUNDING_M = 1e-9
"""Wide boxes are wider by this, so that rounding takes no vertex out of them."""


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
        everything = np.arange(len(vertices), dtype=np.int32)
        skin_vertices(self.rest_m, self.bones, self.weights, moves, everything, vertices)
        return ClosedMesh(vertices, self.faces)


class Bodies(NamedTuple):
    """k surfaces one after the other, each cut into slices.

    `joints_m` (k, j, 3). The others are those of all bodies; what belongs to body i lies from
    place i to place i + 1 of `vertex_of`, `face_of`, `slice_of` and `piece_of` (k + 1,). Faces are
    in order of their slices: those of a slice lie from its place to the next one's of `face_begin`,
    their corners, each once, of `corner_begin`, both counted over all bodies. A piece is what one
    `joint` moves of a slice, `slice` by number within the body: at rest it lies within `half_m` of
    `centre_m`.
    """

    joints_m: Vector
    vertex_of: Index
    rest_m: Vector
    bones: Bones
    weights: Vector
    face_of: Index
    faces: Faces
    slice_of: Index
    face_begin: Index
    corner_begin: Index
    corner: Index32
    piece_of: Index
    slice: Index
    joint: Index
    centre_m: Vector
    half_m: Vector


class Pose(NamedTuple):
    """A body of `Bodies` at one moment, posed as far as it was asked for.

    `moves` (j, 3, 4) of its joints; `wide` (s, 6) boxes that hold its slices, `whole` (6,) the one
    that holds all. `moment` (1,) counts the poses; of this one are those vertices (v, 3), and those
    `tight` boxes (s, 6) round the faces of slices, whose `vertex_moment` (v,) or `slice_moment`
    (s,) says so. `sides` (v,) and `number` (v + 1,) are room for kernels.
    """

    moves: Vector
    wide: Vector
    whole: Vector
    moment: Index
    vertices_m: Vector
    vertex_moment: Index
    tight: Vector
    slice_moment: Index
    sides: npt.NDArray[np.uint8]
    number: Index32


def pack(bodies: Sequence[SkinnedBody]) -> Bodies:
    """Put surfaces with the same joints into one table."""
    cuts = [_cut(body) for body in bodies]

    def beginnings(sizes: Sequence[int]) -> Index:
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    def one_array(parts: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
        return np.ascontiguousarray(np.concatenate(parts))

    return Bodies(
        joints_m=np.array([b.joints_m for b in bodies]),
        vertex_of=beginnings([len(b.rest_m) for b in bodies]),
        rest_m=one_array([c.rest_m for c in cuts]),
        bones=one_array([c.bones for c in cuts]),
        weights=one_array([c.weights for c in cuts]),
        face_of=beginnings([len(b.faces) for b in bodies]),
        faces=one_array([c.faces for c in cuts]),
        slice_of=beginnings([len(c.n_faces) for c in cuts]),
        face_begin=beginnings(one_array([c.n_faces for c in cuts]).tolist()),
        corner_begin=beginnings(one_array([c.n_corners for c in cuts]).tolist()),
        corner=one_array([c.corner for c in cuts]),
        piece_of=beginnings([len(c.slice) for c in cuts]),
        slice=one_array([c.slice for c in cuts]),
        joint=one_array([c.joint for c in cuts]),
        centre_m=one_array([c.centre_m for c in cuts]),
        half_m=one_array([c.half_m for c in cuts]),
    )


class _Cut(NamedTuple):
    """One body cut into slices; `slice` to `half_m` of its pieces."""

    rest_m: Vector
    bones: Bones
    weights: Vector
    faces: Faces
    n_faces: Index
    n_corners: Index
    corner: Index32
    slice: Index
    joint: Index
    centre_m: Vector
    half_m: Vector


def _cut(body: SkinnedBody) -> _Cut:
    """Cut a body into slices; a face belongs to that of its first corner."""
    strongest = body.bones[np.arange(len(body.bones)), body.weights.argmax(axis=1)]
    key = np.zeros((len(strongest), 2), np.int64)
    for bone in np.unique(strongest).tolist():
        members = np.flatnonzero(strongest == bone)
        rest_m = body.rest_m[members]
        axis = int(np.ptp(rest_m, axis=0).argmax())
        key[members, 0] = bone
        key[members, 1] = np.floor((rest_m[:, axis] - rest_m[:, axis].min()) / SLICE_M)
    slices = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    slice_of_face = np.unique(slices[body.faces[:, 0]], return_inverse=True)[1].ravel()
    n_faces = np.bincount(slice_of_face)
    # A slice's vertices are neighbours in memory, and those moved by as many joints follow each
    # other: both let a processor run ahead.
    last = np.argsort(body.weights == 0, axis=1, kind="stable")
    bones: Bones = np.take_along_axis(body.bones, last, axis=1)
    weights: Vector = np.take_along_axis(body.weights, last, axis=1)
    order = np.lexsort(((weights > 0).sum(axis=1), slices))
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order))
    rest_m, bones, weights = body.rest_m[order], bones[order], weights[order]
    faces = number[body.faces[np.argsort(slice_of_face, kind="stable")]]
    corners = [np.unique(part) for part in np.split(faces, np.cumsum(n_faces)[:-1])]
    pieces = []
    for of_slice, own in enumerate(corners):
        has_weight = weights[own] > 0
        for joint in np.unique(bones[own][has_weight]).tolist():
            moved_m = rest_m[own[((bones[own] == joint) & has_weight).any(axis=1)]]
            pieces.append((of_slice, joint, moved_m.min(axis=0), moved_m.max(axis=0)))
    piece_slices, joints, low_m, high_m = (np.array(column) for column in zip(*pieces, strict=True))
    return _Cut(
        rest_m,
        bones,
        weights,
        faces,
        n_faces,
        np.array([len(own) for own in corners]),
        np.concatenate(corners).astype(np.int32),
        piece_slices,
        joints,
        (low_m + high_m) / 2,
        (high_m - low_m) / 2,
    )


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
def skin_vertices(
    rest: Vector, bones: Bones, weights: Vector, moves: Vector, some: Index32, out: Vector
) -> None:
    """Write some vertices of (v, 3), each moved by the blend of its four joints."""
    # Linear blend skinning: Σ weight · move(vertex) over the four joints. One loop over all of
    # them, and numbers without a sign: a call or a view for each took twice as long.
    for i in range(some.shape[0]):
        v = np.uint32(some[i])
        x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
        px = py = pz = 0.0
        for k in range(4):
            w = weights[v, k]
            if w == 0.0:
                continue
            j = np.uint32(bones[v, k])
            px += w * (
                moves[j, 0, 0] * x + moves[j, 0, 1] * y + moves[j, 0, 2] * z + moves[j, 0, 3]
            )
            py += w * (
                moves[j, 1, 0] * x + moves[j, 1, 1] * y + moves[j, 1, 2] * z + moves[j, 1, 3]
            )
            pz += w * (
                moves[j, 2, 0] * x + moves[j, 2, 1] * y + moves[j, 2, 2] * z + moves[j, 2, 3]
            )
        out[v, 0], out[v, 1], out[v, 2] = px, py, pz


@compiled
def body_of(bodies: Bodies, i: int) -> Bodies:
    """Return body i alone, as views."""
    v0, v1 = bodies.vertex_of[i], bodies.vertex_of[i + 1]
    f0, f1 = bodies.face_of[i], bodies.face_of[i + 1]
    s0, s1 = bodies.slice_of[i], bodies.slice_of[i + 1]
    p0, p1 = bodies.piece_of[i], bodies.piece_of[i + 1]
    c0, c1 = bodies.corner_begin[s0], bodies.corner_begin[s1]
    return Bodies(
        bodies.joints_m[i : i + 1],
        bodies.vertex_of[i : i + 2],
        bodies.rest_m[v0:v1],
        bodies.bones[v0:v1],
        bodies.weights[v0:v1],
        bodies.face_of[i : i + 2],
        bodies.faces[f0:f1],
        bodies.slice_of[i : i + 2],
        bodies.face_begin[s0 : s1 + 1],
        bodies.corner_begin[s0 : s1 + 1],
        bodies.corner[c0:c1],
        bodies.piece_of[i : i + 2],
        bodies.slice[p0:p1],
        bodies.joint[p0:p1],
        bodies.centre_m[p0:p1],
        bodies.half_m[p0:p1],
    )


@compiled
def room_for(bodies: Bodies) -> Pose:
    """Return room to pose any one of some bodies."""
    v = s = 0
    for i in range(bodies.vertex_of.size - 1):
        v = max(v, bodies.vertex_of[i + 1] - bodies.vertex_of[i])
        s = max(s, bodies.slice_of[i + 1] - bodies.slice_of[i])
    return Pose(
        np.empty((bodies.joints_m.shape[1], 3, 4)),
        np.empty((s, 6)),
        np.empty(6),
        np.zeros(1, np.int64),
        np.empty((v, 3)),
        np.zeros(v, np.int64),
        np.empty((s, 6)),
        np.zeros(s, np.int64),
        np.empty(v, np.uint8),
        np.empty(v + 1, np.int32),
    )


@compiled
def move_joints(body: Bodies, position: Vector, world: Vector, scale: float, pose: Pose) -> None:
    """Move a body's joints to (j, 3) and (j, 4): only its wide boxes are of the new pose."""
    pose.moment[0] += 1
    joint_moves(position, world, body.joints_m[0], scale, pose.moves)
    n_slices = body.face_begin.size - 1
    wide, whole = pose.wide, pose.whole
    for s in range(n_slices):
        for c in range(3):
            wide[s, c], wide[s, c + 3] = np.inf, -np.inf
    for q in range(body.slice.size):
        s, m = body.slice[q], pose.moves[body.joint[q]]
        for r in range(3):
            # The box of a turned box: |R| · half sides round the moved centre.
            at = m[r, 3]
            reach = _ROUNDING_M
            for c in range(3):
                at += m[r, c] * body.centre_m[q, c]
                reach += abs(m[r, c]) * body.half_m[q, c]
            wide[s, r] = min(wide[s, r], at - reach)
            wide[s, r + 3] = max(wide[s, r + 3], at + reach)
    for c in range(3):
        whole[c], whole[c + 3] = np.inf, -np.inf
    for s in range(n_slices):
        for c in range(3):
            whole[c] = min(whole[c], wide[s, c])
            whole[c + 3] = max(whole[c + 3], wide[s, c + 3])


@compiled
def pose_slices(body: Bodies, pose: Pose, slices: Index32) -> None:
    """Skin the corners of the faces of some slices, and write the tight boxes round them."""
    moment, first = pose.moment[0], body.corner_begin[0]
    begin, corner, rest, bones = body.corner_begin, body.corner, body.rest_m, body.bones
    weights, moves, vertices_m = body.weights, pose.moves, pose.vertices_m
    vertex_moment, slice_moment, tight = pose.vertex_moment, pose.slice_moment, pose.tight
    fresh = pose.number
    for s in slices:
        if slice_moment[s] == moment:
            continue
        slice_moment[s] = moment
        start, end = begin[s] - first, begin[s + 1] - first
        n = 0
        for k in range(start, end):
            v = np.uint32(corner[k])
            fresh[n] = corner[k]
            n += vertex_moment[v] != moment
            vertex_moment[v] = moment
        skin_vertices(rest, bones, weights, moves, fresh[:n], vertices_m)
        x0 = y0 = z0 = np.inf
        x1 = y1 = z1 = -np.inf
        for k in range(start, end):
            v = np.uint32(corner[k])
            x, y, z = vertices_m[v, 0], vertices_m[v, 1], vertices_m[v, 2]
            x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
            x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
        tight[s, 0], tight[s, 1], tight[s, 2] = x0, y0, z0
        tight[s, 3], tight[s, 4], tight[s, 5] = x1, y1, z1


@compiled
def comes_near(body: Bodies, pose: Pose, x_m: float, z_m: float, reach_m: float) -> bool:
    """Tell whether a slice's wide box lies within a distance of a place, seen from above."""
    wide = pose.wide
    for s in range(body.face_begin.size - 1):
        dx = max(wide[s, 0] - x_m, 0.0, x_m - wide[s, 3])
        dz = max(wide[s, 2] - z_m, 0.0, z_m - wide[s, 5])
        if dx * dx + dz * dz <= reach_m * reach_m:
            return True
    return False


@compiled
def boxes_meet(a: Vector, b: Vector) -> bool:
    """Tell whether two boxes (6,) share volume."""
    return bool(
        a[0] < b[3] and b[0] < a[3] and a[1] < b[4] and b[1] < a[4] and a[2] < b[5] and b[2] < a[5]
    )


@compiled
def box_of_meetings(
    a: Bodies, pose_a: Pose, b: Bodies, pose_b: Pose, only_wide: bool, box: Vector
) -> bool:
    """Write the box (2, 3) round everything that slices of two bodies share, and tell whether
    there is anything: in no pair of slices that planes keep apart. Slices whose wide boxes meet
    are posed; with `only_wide` these boxes tell.
    """
    box[0], box[1] = np.inf, -np.inf
    n_a, n_b = a.face_begin.size - 1, b.face_begin.size - 1
    near_a, near_b = np.empty(n_a + 1, np.int32), np.empty(n_b + 1, np.int32)
    n_a = boxes_meeting(pose_b.whole, pose_a.wide[:n_a], near_a)
    n_b = boxes_meeting(pose_a.whole, pose_b.wide[:n_b], near_b)
    wide_b = np.empty((n_b, 6))
    for n in range(n_b):
        wide_b[n] = pose_b.wide[near_b[n]]
    pairs, is_paired = np.empty(n_b + 1, np.int32), np.zeros(n_b, np.bool_)
    n = 0
    for m in range(n_a):
        n_pairs = boxes_meeting(pose_a.wide[near_a[m]], wide_b, pairs)
        if n_pairs > 0 and only_wide:
            return True
        near_a[n] = near_a[m]
        n += n_pairs > 0
        is_paired[pairs[:n_pairs]] = True
    # Posed are those of `b`, then those of `a` that still meet one.
    near_b = near_b[:n_b][is_paired]
    pose_slices(b, pose_b, near_b)
    tight_b = pose_b.tight[near_b]
    near_a = near_a[:n]
    is_near = np.empty(n, np.bool_)
    for m in range(n):
        is_near[m] = boxes_meeting(pose_a.wide[near_a[m]], tight_b, pairs) > 0
    near_a = near_a[is_near]
    pose_slices(a, pose_a, near_a)
    touching = False
    for i in near_a:
        tight = pose_a.tight[i]
        for j in range(tight_b.shape[0]):
            if not boxes_meet(tight, tight_b[j]):
                continue
            touching = touching or not _are_apart(a, pose_a, int(i), b, pose_b, int(near_b[j]))
            # Union of the pairwise intersections; `box` stays inverted where no pair meets.
            for k in range(3):
                box[0, k] = min(box[0, k], max(tight[k], tight_b[j, k]))
                box[1, k] = max(box[1, k], min(tight[k + 3], tight_b[j, k + 3]))
    return touching


@compiled
def _are_apart(a: Bodies, pose_a: Pose, i: int, b: Bodies, pose_b: Pose, j: int) -> bool:
    """Tell whether a plane was found between posed slices i of `a` and j of `b`.

    Each slice, and what lies inside it, is on its side of the plane, so they share nothing.
    """
    first_a, first_b = a.corner_begin[0], b.corner_begin[0]
    begin_a, end_a = a.corner_begin[i] - first_a, a.corner_begin[i + 1] - first_a
    begin_b, end_b = b.corner_begin[j] - first_b, b.corner_begin[j + 1] - first_b
    mine, theirs, box_a, box_b = pose_a.vertices_m, pose_b.vertices_m, pose_a.tight, pose_b.tight
    corner_a, corner_b = a.corner, b.corner
    # Gilbert's search for the shortest way (x, y, z) between them: whatever is across it decides.
    x = (box_b[j, 0] + box_b[j, 3] - box_a[i, 0] - box_a[i, 3]) / 2
    y = (box_b[j, 1] + box_b[j, 4] - box_a[i, 1] - box_a[i, 4]) / 2
    z = (box_b[j, 2] + box_b[j, 5] - box_a[i, 2] - box_a[i, 5]) / 2
    for _ in range(_PLANES):
        most, least = -np.inf, np.inf
        p = q = np.uint32(0)
        for k in range(begin_a, end_a):
            v = np.uint32(corner_a[k])
            along = mine[v, 0] * x + mine[v, 1] * y + mine[v, 2] * z
            if along > most:
                most, p = along, v
        for k in range(begin_b, end_b):
            v = np.uint32(corner_b[k])
            along = theirs[v, 0] * x + theirs[v, 1] * y + theirs[v, 2] * z
            if along < least:
                least, q = along, v
        if least - most > _ROUNDING_M * (abs(x) + abs(y) + abs(z)):
            return True
        # On to the point nearest to nothing on the way from here to the two corners found.
        dx = theirs[q, 0] - mine[p, 0] - x
        dy = theirs[q, 1] - mine[p, 1] - y
        dz = theirs[q, 2] - mine[p, 2] - z
        length = dx * dx + dy * dy + dz * dz
        if length == 0.0:
            return False
        share = min(max(-(x * dx + y * dy + z * dz) / length, 0.0), 1.0)
        x, y, z = x + share * dx, y + share * dy, z + share * dz
    return False


@compiled
def shadow(
    body: Bodies, pose: Pose, axis: int, low_m: Vector, high_m: Vector
) -> tuple[Vector, Faces]:
    """Return the corners and faces of a posed body that a column through a box may cross.

    As `in_shadow` does of a whole surface; slices beside the shadow stay as they are.
    """
    iu, iv = (axis + 1) % 3, (axis + 2) % 3
    n_slices = body.face_begin.size - 1
    slices = np.empty(n_slices, np.int32)
    n = 0
    for s in range(n_slices):
        slices[n] = s
        n += not _is_beside(pose.wide[s], iu, iv, low_m, high_m)
    pose_slices(body, pose, slices[:n])
    n_over = n_faces = n_corners = 0
    for s in slices[:n]:
        if _is_beside(pose.tight[s], iu, iv, low_m, high_m):
            continue
        slices[n_over] = s
        n_over += 1
        n_faces += body.face_begin[s + 1] - body.face_begin[s]
        n_corners += body.corner_begin[s + 1] - body.corner_begin[s]
    vertices_m, sides, number = pose.vertices_m, pose.sides, pose.number
    u0, u1, v0, v1 = low_m[iu], high_m[iu], low_m[iv], high_m[iv]
    first, corner_begin, corner = body.corner_begin[0], body.corner_begin, body.corner
    for s in slices[:n_over]:
        begin, end = corner_begin[s], corner_begin[s + 1]
        for m in range(begin - first, end - first):
            i = np.uint32(corner[m])
            u, v = vertices_m[i, iu], vertices_m[i, iv]
            code = np.int32(1) if u <= u0 else np.int32(0)
            code |= np.int32(2) if u >= u1 else np.int32(0)
            code |= np.int32(4) if v <= v0 else np.int32(0)
            code |= np.int32(8) if v >= v1 else np.int32(0)
            sides[i] = code
            number[i] = -1
    near = np.empty(n_faces + 1, np.int32)
    n_near = 0
    first, face_begin, faces = body.face_begin[0], body.face_begin, body.faces
    for s in slices[:n_over]:
        begin, end = face_begin[s], face_begin[s + 1]
        for f in range(begin - first, end - first):
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            near[n_near] = f
            n_near += (sides[np.uint32(a)] & sides[np.uint32(b)] & sides[np.uint32(c)]) == 0
    return corners_of(vertices_m, faces, near[:n_near], number, n_corners)


@compiled
def _is_beside(box: Vector, iu: int, iv: int, low_m: Vector, high_m: Vector) -> bool:
    """Tell whether a box (6,) lies beside another one, seen along the third axis."""
    return bool(
        box[iu + 3] <= low_m[iu]
        or box[iu] >= high_m[iu]
        or box[iv + 3] <= low_m[iv]
        or box[iv] >= high_m[iv]
    )
