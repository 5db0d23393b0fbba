"""Decide who is in view and how detailed each person is drawn."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lab.geometry import Vector
from stage.projection import axes
from stimuli.picture import Camera

BODY_RADIUS_M = 1.25
"""No part of a person is farther than this from the hips."""


@dataclass(frozen=True)
class DetailRule:
    """Down to which level people are drawn: level i ends at `limits_m[i]` from the eyes.

    A person changes level only `hysteresis_01` of the limit beyond it, so nobody flickers.
    `finest` is the best level ever used (2 draws everybody at the lightest of three).
    """

    limits_m: tuple[float, ...] = (2.0, 6.0)
    hysteresis_01: float = 0.1
    finest: int = 0


def choose_levels(
    distance_m: Vector, before: npt.NDArray[np.int64], rule: DetailRule
) -> npt.NDArray[np.int64]:
    """Return the level (n,) of people at these distances (n,); `before` is −1 at first."""
    limits = np.asarray(rule.limits_m)
    plain = np.searchsorted(limits, distance_m, side="right")
    outward = np.searchsorted(limits * (1 + rule.hysteresis_01), distance_m, side="right")
    inward = np.searchsorted(limits * (1 - rule.hysteresis_01), distance_m, side="right")
    kept = np.clip(before, outward, inward)
    chosen: npt.NDArray[np.int64] = np.where(before < 0, plain, kept)
    return np.maximum(chosen, rule.finest)


def in_view(centre_m: Vector, radius_m: float, cameras: Sequence[Camera]) -> npt.NDArray[np.bool_]:
    """Tell which spheres (n, 3) reach into the view of any camera."""
    seen = np.zeros(len(centre_m), dtype=np.bool_)
    for camera in cameras:
        planes = _planes(camera)
        inside = (centre_m - camera.pose.position_m) @ planes.T > -radius_m
        seen |= inside.all(axis=1)
    return seen


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
