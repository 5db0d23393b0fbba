"""One sculpted person with the landmarks that clothes, hair and colours are laid out by."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from character_making.makehuman import BODY_VERTICES, Indices, MakeHuman
from character_making.reposing import rig_of
from character_making.shaping import Shape, shaped
from visavis.lab.geometry import Vector, unit
from visavis.stimuli.characters.rest_pose import Rig

SIDES = (("left", "l"), ("right", "r"))


@dataclass(frozen=True, eq=False)
class Figure:
    """A naked person as sculpted: all vertices of the base mesh, joints and weights."""

    source: MakeHuman
    shape: Shape
    vertices_m: Vector
    rig: Rig

    @property
    def weights(self) -> Vector:
        """Weights of the base mesh's vertices for the canonical joints."""
        return self.source.weights

    @property
    def body_m(self) -> Vector:
        """The body's own vertices (13380, 3)."""
        return self.vertices_m[:BODY_VERTICES]

    def at(self, joint: str) -> Vector:
        """Return where a joint stands as sculpted."""
        place: Vector = self.rig.at_m[self.rig.skeleton.index(joint)]
        return place

    def joint_columns(self, *stems: str, side: str = "") -> Indices:
        """Return the columns of the weights whose joints' names end so."""
        return np.array(
            [
                j
                for j, name in enumerate(self.rig.skeleton.names)
                if name.startswith(side) and any(name.endswith(stem) for stem in stems)
            ]
        )

    @cached_property
    def floor_m(self) -> float:
        """Height of the bare soles."""
        return float(self.body_m[:, 1].min())

    @cached_property
    def stature_m(self) -> float:
        """Crown to bare sole."""
        return float(self.body_m[:, 1].max()) - self.floor_m

    @cached_property
    def eye_radius_m(self) -> float:
        """Radius of the eyeballs, fitted to the base mesh's."""
        quads = np.unique(self.source.quads("helper-l-eye"))
        distance = np.linalg.norm(self.vertices_m[quads] - self.at("left_eye"), axis=1)
        return float(np.quantile(distance, 0.5))

    def arm_s(self, points_m: Vector, weights: Vector) -> Vector:
        """Return places along the arm (v,): 0 shoulder, 1 elbow, 2 wrist; −1 on the trunk."""
        s = np.full(len(points_m), -1.0)
        for side, _ in SIDES:
            chain = [self.at(f"{side}_{part}") for part in ("upper_arm", "lower_arm", "hand")]
            along = [_share(points_m, chain[k], chain[k + 1]) for k in range(2)]
            place = np.where(along[0] < 1, np.minimum(along[0], 1), 1 + np.maximum(along[1], 0))
            lower = weights[
                :,
                self.joint_columns("lower_arm", "hand", "proximal", "middle", "distal", side=side),
            ].sum(axis=1)
            arm = weights[:, self.joint_columns("upper_arm", side=side)].sum(axis=1) + lower
            place = np.where(lower > 0.5, np.maximum(place, 1 + along[1]), place)
            on_arm = arm > 0.35
            s[on_arm] = np.maximum(place[on_arm], -0.5)
        return s

    def neck_s(self, points_m: Vector) -> Vector:
        """Return places up the neck (v,): 0 at its base, 1 where the head turns."""
        return _share(points_m, self.at("neck"), self.at("head"))


def _share(points_m: Vector, start_m: Vector, end_m: Vector) -> Vector:
    along = end_m - start_m
    share: Vector = (points_m - start_m) @ along / (along @ along)
    return share


def figure_of(source: MakeHuman, shape: Shape, stature_m: float, sole_m: float) -> Figure:
    """Shape a person and scale them to a bare stature; shoes have soles `sole_m` thick."""
    vertices = shaped(source, shape)
    body = vertices[:BODY_VERTICES, 1]
    vertices = vertices * (stature_m / (body.max() - body.min()))
    floor = float(vertices[:BODY_VERTICES, 1].min())
    return Figure(source, shape, vertices, rig_of(source, vertices, floor - sole_m))


def outward(points_m: Vector, centre_m: Vector) -> Vector:
    """Return unit vectors away from a centre."""
    return unit(points_m - centre_m)
