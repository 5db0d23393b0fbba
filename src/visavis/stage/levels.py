"""Decide who is in view and how detailed each person is drawn."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stage.geometry.projection import axes
from visavis.stimuli.picture import Camera

BODY_RADIUS_M = 1.25
"""No part of a person is farther than this from the hips."""


FACE_M = 0.20
"""Height of a face from chin to hairline."""


@dataclass(frozen=True)
class DetailRule:
    """Down to which level people are drawn: level i as long as a face spans `faces_px[i]` pixels.

    A person changes level only `hysteresis_01` of the limit beyond it, so nobody flickers.
    `finest` is the best level ever used (2 draws everybody at the lightest of three); where
    everybody together would have more than `budget_triangles`, the smaller faces get level 1.
    """

    faces_px: tuple[float, ...] = (24.0, 9.0)
    hysteresis_01: float = 0.1
    finest: int = 0
    budget_triangles: int | None = 1_500_000


def faces_px(distance_m: Vector, px_per_tangent: float) -> Vector:
    """Return how many pixels faces (n,) span, given those of a tangent of 1."""
    spans: Vector = FACE_M * px_per_tangent / np.maximum(distance_m, 1e-3)
    return spans


def choose_levels(
    face_px: Vector,
    before: npt.NDArray[np.int64],
    rule: DetailRule,
    triangles: npt.NDArray[np.int64],
) -> npt.NDArray[np.int64]:
    """Return the level (n,) of people whose faces span so many pixels (n,); `before` is −1 at
    first. `triangles` (n, levels) says what each level costs.
    """
    limits = -np.asarray(rule.faces_px)
    plain = np.searchsorted(limits, -face_px, side="left")
    outward = np.searchsorted(limits * (1 - rule.hysteresis_01), -face_px, side="left")
    inward = np.searchsorted(limits * (1 + rule.hysteresis_01), -face_px, side="left")
    steady = np.clip(before, outward, inward)
    level: npt.NDArray[np.int64] = np.where(before < 0, plain, steady)
    level = np.minimum(np.maximum(level, rule.finest), triangles.shape[1] - 1)
    if rule.budget_triangles is not None and len(level):
        # The largest faces stay at level 0 as long as all others fit in at level 1.
        everyone = np.arange(len(level))
        least = triangles[everyone, np.maximum(level, min(1, triangles.shape[1] - 1))]
        more = np.where(level == 0, triangles[:, 0] - least, 0)
        if least.sum() + more.sum() <= rule.budget_triangles:
            return level
        order = np.argsort(-face_px, kind="stable")
        too_much = least.sum() + np.cumsum(more[order]) > rule.budget_triangles
        level[order[too_much & (level[order] == 0)]] = 1
    return level


def in_view(centre_m: Vector, radius_m: float, cameras: Sequence[Camera]) -> npt.NDArray[np.bool_]:
    """Return which spheres (n, 3) reach into the view of any camera."""
    is_inside = np.zeros(len(centre_m), dtype=np.bool_)
    for camera in cameras:
        planes = _planes(camera)
        inside = (centre_m - camera.pose.position_m) @ planes.T > -radius_m
        is_inside |= inside.all(axis=1)
    return is_inside


def _planes(camera: Camera) -> Vector:
    """Return inward unit normals (5, 3) in world of the view's sides and of its front."""
    local = np.array(
        [
            [1.0, 0.0, camera.left],
            [-1.0, 0.0, -camera.right],
            [0.0, 1.0, camera.bottom],
            [0.0, -1.0, -camera.top],
            [0.0, 0.0, -1.0],
        ]
    )
    local /= np.sqrt((local * local).sum(axis=1, keepdims=True))
    planes: Vector = local @ axes(camera.pose).T
    return planes
