"""Hems: tops as long as one can sit on a chair in, moved by the thighs they lie on, and trousers
that keep shoes below them.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from character_making.cloth_places import TILE_M
from character_making.figure import SIDES
from character_making.pieces import Indices
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Character, SkinnedMesh
from visavis.stimuli.characters.levels import keep_triangles
from visavis.stimuli.characters.rest_pose import heaviest

LENGTH = 0.048
"""How far below the joints of the thighs a top ends at most, in statures."""
_SHORTENED_FROM_M = 0.03
"""Height above the hips from which on a top that is too long is drawn up."""
_NEIGHBOURS, _NEAR_M = 8, 0.005
_BETWEEN_LEGS_M, _SIDE_M, _FADE_M = 0.10, 0.06, 0.05
_KNEES_M, _UNDER_END_M = -0.3, -0.005
_BEHIND_SHARE = 0.4
"""Of the thighs' weight stays with cloth behind."""
_INSIDE_M, _HEM_M, _LEAST_ROOM_M = 0.008, 0.002, 0.02
"""How far inside a trouser leg a shoe stays, from so far above the hem on, and how far out of the
ankle's upright it may be anyhow."""
_AROUND, _ROW_M, _FINE, _DRAWN_IN = 60, 0.006, 8, 8
"""Trouser legs are looked at at so many angles, in rows so high; triangles at so many points a
side; and shoes drawn in so often."""
_WITH_SHIN_M, _ON_SHOE_M, _ON_SHOE_SHARE = 0.02, 0.05, 0.5
_TURN_M, _HEM_TURN, _LEG_M = 0.06, 0.26, 0.14
"""What a radian round the ankle counts for, and radians to either side that tell the hem;
how far above the ankle shoes and trousers are looked at."""
_MIN_BENDING = 60
"""Triangles of a shoe that bends where its toes do."""
_ROWS = round(2 * _LEG_M / _ROW_M)


def with_hems(character: Character, length: float = LENGTH) -> Character:
    """Return a person whose top ends above the seat of a chair, at most `length` statures below the
    joints of the thighs, whose front goes with the thighs
    below it instead of letting them through, and whose shoes stay below the trousers. No skin is
    left about the hips, but in copies for measuring.
    """
    meshes = []
    n = len(character.levels)
    for i, mesh in enumerate((*character.levels, *character.measuring)):
        cloth = _Cloth(mesh, character)
        _top(cloth, length)
        for side, _ in SIDES:
            # Copies for measuring have shoes of the size they are seen in, and nobody sees them.
            _trouser_leg(cloth, side, drawn_in=i < n)
            _stiff_if_coarse(cloth, side)
        # All of it is below clothes; an open front would show what is left where one sits.
        meshes.append(keep_triangles(cloth.mesh(), ~cloth.bare_hips()) if i < n else cloth.mesh())
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

    def among(self, some: Indices) -> Indices:
        """Return the triangles between some vertices, all corners of which are among them."""
        chosen = np.isin(self._mesh.triangles, some).all(axis=1)
        triangles: Indices = self._mesh.triangles[chosen].astype(np.int64)
        return triangles

    def before_hips(self, material: str) -> Indices:
        """Return the vertices of a material about the hips, down to the knees."""
        some = self.of(material)
        height_m = self.vertices_m[some, 1]
        near: Indices = some[(height_m < _SHORTENED_FROM_M) & (height_m > _KNEES_M)]
        return near

    def bare_hips(self) -> npt.NDArray[np.bool_]:
        """Tell which triangles (t,) are skin about the hips, down to the knees."""
        bare = self._mesh.triangle_material == self._names.index("skin")
        found: npt.NDArray[np.bool_] = bare & np.isin(
            self._mesh.triangles, self.before_hips("skin")
        ).any(axis=1)
        return found

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
    # Copies for measuring keep their skin, inside where one sits.
    cloth.vertices_m[skin, 2] = 0.0


def _trouser_leg(cloth: _Cloth, side: str, *, drawn_in: bool) -> None:
    ankle_m = cloth.joint_m(f"{side}_foot")
    leg, shoe = (
        some[
            (np.sign(cloth.vertices_m[some, 0]) == np.sign(ankle_m[0]))
            & (cloth.vertices_m[some, 1] < ankle_m[1] + _LEG_M)
        ]
        for some in (cloth.of("bottom"), cloth.of("shoe"))
    )
    leg_at, _ = _round_ankle(cloth.vertices_m[leg] - ankle_m)
    shoe_at, _ = _round_ankle(cloth.vertices_m[shoe] - ankle_m)
    turned = np.abs((shoe_at[:, :1] - leg_at[None, :, 0] + np.pi) % (2 * np.pi) - np.pi)
    hem_m = np.where(turned < _HEM_TURN, leg_at[None, :, 1], np.inf).min(axis=1)
    covered_m = shoe_at[:, 1] - np.where(np.isfinite(hem_m), hem_m, leg_at[:, 1].min())
    apart = np.hypot(turned * _TURN_M, shoe_at[:, 1:] - leg_at[None, :, 1])
    few = min(_NEIGHBOURS, len(leg))
    nearest = np.argsort(apart, axis=1)[:, :few]
    near = 1 / (np.take_along_axis(apart, nearest, axis=1) + _NEAR_M)
    near /= near.sum(axis=1, keepdims=True)
    if drawn_in:
        _kept_inside(cloth, ankle_m, leg, shoe)

    shin = np.einsum("vk,vkj->vj", near, cloth.weights[leg][nearest])
    share = np.clip(covered_m / _WITH_SHIN_M, 0, 1)[:, None]
    on_foot = cloth.weights[shoe].copy()
    cloth.weigh(shoe, (1 - share) * on_foot + share * shin)
    # A hem lies on the shoe and is lifted by it.
    _, closest = cKDTree(cloth.vertices_m[shoe]).query(cloth.vertices_m[leg])
    lifted = np.clip(1 - (leg_at[:, 1] - leg_at[:, 1].min()) / _ON_SHOE_M, 0, 1)
    lifted = _ON_SHOE_SHARE * lifted[:, None]
    cloth.weigh(leg, (1 - lifted) * cloth.weights[leg] + lifted * on_foot[closest])


def _stiff_if_coarse(cloth: _Cloth, side: str) -> None:
    """Let a shoe of a few triangles be moved by the foot alone: bent, it would turn inside out."""
    ankle_m = cloth.joint_m(f"{side}_foot")
    shoe = cloth.of("shoe")
    shoe = shoe[np.sign(cloth.vertices_m[shoe, 0]) == np.sign(ankle_m[0])]
    shoe = shoe[cloth.vertices_m[shoe, 1] < ankle_m[1] + _LEG_M]
    if len(cloth.among(shoe)) >= _MIN_BENDING:
        return
    foot, toes = (cloth.skeleton.index(f"{side}_{part}") for part in ("foot", "toes"))
    weights = cloth.weights[shoe]
    weights[:, foot] += weights[:, toes]
    weights[:, toes] = 0.0
    cloth.weigh(shoe, weights)


def _kept_inside(cloth: _Cloth, ankle_m: Vector, leg: Indices, shoe: Indices) -> None:
    """Draw a shoe in towards the ankle's upright until all of it above the hem is inside."""
    around = _Sleeve(_spread(cloth.vertices_m[cloth.among(leg)])[1].reshape(-1, 3) - ankle_m)
    triangles = cloth.among(shoe)
    # An upper and its sole have copies of their seam, which stay together.
    places = np.round(cloth.vertices_m * 1e5).astype(np.int64)
    _, place = np.unique(places, axis=0, return_inverse=True)
    place = place.ravel()
    for _ in range(_DRAWN_IN):
        shares, points = _spread(cloth.vertices_m[triangles])
        off_m = points - ankle_m
        scale = around.scale(off_m.reshape(-1, 3)).reshape(points.shape[:2])
        if (scale == 1).all():
            return
        inward = np.ones(len(places))
        for corner in range(3):
            # A corner answers for what is nearest to it.
            its = shares[:, corner] == shares.max(axis=1)
            np.minimum.at(inward, place[triangles[:, corner]], scale[:, its].min(axis=1))
        off_m = (cloth.vertices_m[shoe] - ankle_m) * np.array([1.0, 0.0, 1.0])
        cloth.vertices_m[shoe] -= (1 - inward[place[shoe], None]) * off_m


def _spread(corners_m: Vector) -> tuple[Vector, Vector]:
    """Return shares (s, 3) of corners and the points (t, s, 3) of triangles they make."""
    i, j = np.meshgrid(np.arange(_FINE + 1), np.arange(_FINE + 1))
    some = i + j <= _FINE
    shares = np.stack([i[some], j[some], _FINE - i[some] - j[some]], axis=1) / _FINE
    points: Vector = np.einsum("sk,tkc->tsc", shares, corners_m)
    return shares, points


class _Sleeve:
    """A trouser leg as seen from the upright through the ankle: its hem and its room, by angle."""

    def __init__(self, off_m: Vector) -> None:
        at, away_m = _round_ankle(off_m)
        angle, row = self._bins(at)
        self._room_m = np.full((_AROUND, _ROWS), np.inf)
        np.minimum.at(self._room_m, (angle, row), away_m)
        self._hem_m = np.full(_AROUND, np.inf)
        np.minimum.at(self._hem_m, angle, at[:, 1])
        for turn in (1, -1):
            self._hem_m = np.minimum(self._hem_m, np.roll(self._hem_m, turn))
            self._room_m = np.minimum(self._room_m, np.roll(self._room_m, turn, axis=0))
        above, below = self._room_m[:, 1:], self._room_m[:, :-1]
        self._room_m[:, :-1] = np.minimum(below, above)
        self._room_m[:, 1:] = np.minimum(self._room_m[:, 1:], below)

    @staticmethod
    def _bins(at: Vector) -> tuple[Indices, Indices]:
        angle = ((at[:, 0] + np.pi) / (2 * np.pi) * _AROUND).astype(np.int64) % _AROUND
        row = np.clip(((at[:, 1] + _LEG_M) / _ROW_M).astype(np.int64), 0, _ROWS - 1)
        return angle, row

    def scale(self, off_m: Vector) -> Vector:
        """Return by how much points (n, 3) have to be drawn in: 1 not at all."""
        at, away_m = _round_ankle(off_m)
        angle, row = self._bins(at)
        covered = at[:, 1] > self._hem_m[angle] + _HEM_M
        room_m = np.maximum(self._room_m[angle, row] - _INSIDE_M, _LEAST_ROOM_M)
        scale: Vector = np.where(covered, np.minimum(room_m / np.maximum(away_m, 1e-6), 1), 1.0)
        return scale


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
