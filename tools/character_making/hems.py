"""Hems: tops as long as one can sit on a chair in, moved by the thighs they lie on, and trousers
that keep shoes below them.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from lab.geometry import Vector
from stimuli.characters.character import Character, SkinnedMesh
from stimuli.characters.rest_pose import heaviest
from tools.character_making.cloth_places import TILE_M
from tools.character_making.figure import SIDES
from tools.character_making.pieces import Indices

LENGTH = 0.048
"""How far below the joints of the thighs a top ends at most, in statures."""
_SHORTENED_FROM_M = 0.03
"""Height above the hips from which on a top that is too long is drawn up."""
_NEIGHBOURS, _NEAR_M = 8, 0.005
_BETWEEN_LEGS_M, _SIDE_M, _FADE_M = 0.10, 0.06, 0.05
_KNEES_M, _UNDER_END_M = -0.3, -0.005
_BEHIND_SHARE = 0.4
"""Of the thighs' weight stays with cloth behind."""
_INSIDE_M, _COVERED_M = 0.014, 0.008
"""How far inside a trouser leg a shoe stays, from so far above the hem on."""
_WITH_SHIN_M, _ON_SHOE_M, _ON_SHOE_SHARE = 0.02, 0.05, 0.5
_TURN_M, _HEM_TURN, _LEG_M = 0.06, 0.26, 0.14
"""What a radian round the ankle counts for, and radians to either side that tell the hem;
how far above the ankle shoes and trousers are looked at."""


def with_hems(character: Character, length: float = LENGTH) -> Character:
    """Return a person whose top ends above the seat of a chair, at most `length` statures below the
    joints of the thighs, whose front goes with the thighs
    below it instead of letting them through, and whose shoes stay below the trousers.
    """
    meshes = []
    for mesh in (*character.levels, *character.measuring):
        cloth = _Cloth(mesh, character)
        _top(cloth, length)
        for side, _ in SIDES:
            _trouser_leg(cloth, side)
        meshes.append(cloth.mesh())
    n = len(character.levels)
    return replace(character, levels=tuple(meshes[:n]), measuring=tuple(meshes[n:]))


class _Cloth:
    """A mesh whose vertices and weights are being changed."""

    def __init__(self, mesh: SkinnedMesh, character: Character) -> None:
        self.skeleton = character.skeleton
        self.stature_m = character.stature_m
        self.vertices_m = mesh.vertices_m.astype(np.float64)
        self.uv = None if mesh.uv is None else mesh.uv.astype(np.float64)
        self.weights = np.zeros((len(mesh.vertices_m), len(self.skeleton.names)))
        np.put_along_axis(self.weights, mesh.joints.astype(np.int64), mesh.weights, axis=1)
        self._mesh = mesh
        self._names = [material.name for material in character.materials]
        self._changed = np.zeros(len(mesh.vertices_m), dtype=bool)

    def of(self, material: str) -> Indices:
        """Return the vertices of a material."""
        chosen = self._mesh.triangle_material == self._names.index(material)
        return np.unique(self._mesh.triangles[chosen])

    def before_hips(self, material: str) -> Indices:
        """Return the vertices of a material about the hips, down to the knees."""
        some = self.of(material)
        height_m = self.vertices_m[some, 1]
        near: Indices = some[(height_m < _SHORTENED_FROM_M) & (height_m > _KNEES_M)]
        return near

    def joint_m(self, name: str) -> Vector:
        """Return where a joint is at rest."""
        place: Vector = self.skeleton.rest_m[self.skeleton.index(name)]
        return place

    def weigh(self, vertices: Indices, weights: Vector) -> None:
        """Set the weights of vertices."""
        self.weights[vertices] = weights
        self._changed[vertices] = True

    def mesh(self) -> SkinnedMesh:
        """Return the mesh as changed."""
        joints, weights = self._mesh.joints.copy(), self._mesh.weights.copy()
        joints[self._changed], weights[self._changed] = heaviest(self.weights[self._changed])
        return replace(
            self._mesh,
            vertices_m=self.vertices_m.astype(np.float32),
            uv=None if self.uv is None else self.uv.astype(np.float32),
            joints=joints,
            weights=weights,
        )


def _top(cloth: _Cloth, length: float) -> None:
    top, under, buttons, skin = (
        cloth.before_hips(name) for name in ("top", "under", "shoe", "skin")
    )
    before_m = cloth.vertices_m[top, 1].copy()
    top_end_m = cloth.joint_m("left_upper_leg")[1] - length * cloth.stature_m
    scale = min((_SHORTENED_FROM_M - top_end_m) / (_SHORTENED_FROM_M - before_m.min()), 1.0)
    for some in (top, buttons):
        height_m = cloth.vertices_m[some, 1] - _SHORTENED_FROM_M
        cloth.vertices_m[some, 1] = _SHORTENED_FROM_M + height_m * scale
    # What is worn below an open jacket would look out below it where one sits.
    cloth.vertices_m[under, 1] = np.maximum(cloth.vertices_m[under, 1], _UNDER_END_M)
    if cloth.uv is not None:
        # Cloth that was cut shorter has the pattern it had.
        cloth.uv[top, 1] -= (cloth.vertices_m[top, 1] - before_m) / TILE_M
    worn = np.concatenate([top, under])
    cloth.weigh(worn, _with_thighs(cloth, worn, cloth.of("bottom")))
    if len(buttons):
        _, sewn_on = cKDTree(cloth.vertices_m[worn]).query(cloth.vertices_m[buttons])
        cloth.weigh(buttons, cloth.weights[worn[sewn_on]])
    # Skin that an open front would show does not come out where one sits.
    cloth.vertices_m[skin, 2] = 0.0


def _trouser_leg(cloth: _Cloth, side: str) -> None:
    ankle_m = cloth.joint_m(f"{side}_foot")
    leg, shoe = (
        some[
            (np.sign(cloth.vertices_m[some, 0]) == np.sign(ankle_m[0]))
            & (cloth.vertices_m[some, 1] < ankle_m[1] + _LEG_M)
        ]
        for some in (cloth.of("bottom"), cloth.of("shoe"))
    )
    leg_at, leg_round_m = _round_ankle(cloth.vertices_m[leg] - ankle_m)
    shoe_at, shoe_round_m = _round_ankle(cloth.vertices_m[shoe] - ankle_m)
    turned = np.abs((shoe_at[:, :1] - leg_at[None, :, 0] + np.pi) % (2 * np.pi) - np.pi)
    hem_m = np.where(turned < _HEM_TURN, leg_at[None, :, 1], np.inf).min(axis=1)
    covered_m = shoe_at[:, 1] - np.where(np.isfinite(hem_m), hem_m, leg_at[:, 1].min())
    apart = np.hypot(turned * _TURN_M, shoe_at[:, 1:] - leg_at[None, :, 1])
    few = min(_NEIGHBOURS, len(leg))
    nearest = np.argsort(apart, axis=1)[:, :few]
    near = 1 / (np.take_along_axis(apart, nearest, axis=1) + _NEAR_M)
    near /= near.sum(axis=1, keepdims=True)

    room_m = (near * leg_round_m[nearest]).sum(axis=1) - _INSIDE_M
    too_wide = np.clip(1 - room_m / np.maximum(shoe_round_m, 1e-6), 0, 1)
    inward = too_wide * np.clip(covered_m / _COVERED_M, 0, 1)
    off = cloth.vertices_m[shoe][:, [0, 2]] - ankle_m[[0, 2]]
    cloth.vertices_m[np.ix_(shoe, [0, 2])] = ankle_m[[0, 2]] + off * (1 - inward)[:, None]

    shin = np.einsum("vk,vkj->vj", near, cloth.weights[leg][nearest])
    share = np.clip(covered_m / _WITH_SHIN_M, 0, 1)[:, None]
    on_foot = cloth.weights[shoe].copy()
    cloth.weigh(shoe, (1 - share) * on_foot + share * shin)
    # A hem lies on the shoe and is lifted by it.
    _, closest = cKDTree(cloth.vertices_m[shoe]).query(cloth.vertices_m[leg])
    lifted = np.clip(1 - (leg_at[:, 1] - leg_at[:, 1].min()) / _ON_SHOE_M, 0, 1)
    lifted = _ON_SHOE_SHARE * lifted[:, None]
    cloth.weigh(leg, (1 - lifted) * cloth.weights[leg] + lifted * on_foot[closest])


def _round_ankle(off_m: Vector) -> tuple[Vector, Vector]:
    """Return angle round the upright and height (v, 2), and distance (v,) from the upright."""
    angle = np.arctan2(off_m[:, 0], off_m[:, 2])
    return np.stack([angle, off_m[:, 1]], axis=1), np.hypot(off_m[:, 0], off_m[:, 2])


def _with_thighs(cloth: _Cloth, hanging: Indices, below: Indices) -> Vector:
    """Return weights (v, joints) with which cloth before the hips goes with the trousers it hangs
    over; left passes into right where trousers have their seam.
    """
    points_m, weights = cloth.vertices_m[hanging], cloth.weights[hanging]
    distance_m, nearest = cKDTree(cloth.vertices_m[below]).query(points_m, _NEIGHBOURS)
    near: Vector = 1 / (np.asarray(distance_m) + _NEAR_M)
    near /= near.sum(axis=1, keepdims=True)
    worn: Vector = np.einsum("vk,vkj->vj", near, cloth.weights[below][nearest])
    hips, left, right = (
        cloth.skeleton.index(name) for name in ("hips", "left_upper_leg", "right_upper_leg")
    )
    both = worn[:, left] + worn[:, right]
    # A person faces −z, with the left hand at −x.
    to_left = np.clip(0.5 - points_m[:, 0] / _BETWEEN_LEGS_M, 0, 1)
    worn[:, left], worn[:, right] = both * to_left, both * (1 - to_left)
    share = np.clip(-points_m[:, 1] / _FADE_M, 0, 1)[:, None]
    # Behind it hangs from the seat: drawn along, it would go under whoever sits.
    before = np.clip(0.5 - points_m[:, 2] / _SIDE_M, 0, 1)[:, None]
    behind = weights.copy()
    behind[:, [left, right]] *= _BEHIND_SHARE
    behind[:, hips] += (weights - behind)[:, [left, right]].sum(axis=1)
    mixed: Vector = (1 - share) * weights + share * (before * worn + (1 - before) * behind)
    return mixed
