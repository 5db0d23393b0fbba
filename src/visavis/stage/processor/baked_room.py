"""Rooms lit once, at vertices that lie close where the light changes and far apart elsewhere."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.stage.card.vertices import RoomVertices
from visavis.stage.processor.models import linear_light
from visavis.stage.processor.vertex_light import (
    CODES_OF_ROOT,
    FACTORS_OF_ROOT,
    Floats,
    lamp_rows,
    light_points,
)
from visavis.stimuli.picture import Room

MAX_EDGE_M, MIN_EDGE_M = 2.5, 0.3
MAX_ERROR = 2.5 / 255
"""An edge is cut when halfway along it the light is farther than this from the ends' mean."""
MAX_CUTS = 6
SAME_PLACE_M = 1e-4

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BakedRoom:
    """A room's vertices and the light (v, 3) of each, in codes at full brightness."""

    vertices: RoomVertices
    light: Floats


def baked_room(laid_out: RoomVertices, room: Room) -> BakedRoom:
    """Subdivide a room's triangles where the light changes, and light its vertices."""
    rows = lamp_rows(room)
    vertices, indices, runs = laid_out.vertices, [], []
    light = np.zeros((len(vertices), 3), np.float32)
    places = np.round(vertices["place_m"] / SAME_PLACE_M).astype(np.int64)
    _, place = np.unique(places, axis=0, return_inverse=True)
    place, first = place.ravel(), 0
    for run in laid_out.runs:
        triangles = laid_out.indices[run.first : run.first + run.count].reshape(-1, 3)
        corners = np.unique(triangles)
        has_picture = run.texture is not None
        light[corners] = _light(vertices[corners], rows, has_picture=has_picture)
        for _ in range(MAX_CUTS):
            vertices, light, place, finer = _cut(
                vertices, light, place, triangles, rows, has_picture=has_picture
            )
            if len(finer) == len(triangles):
                break
            triangles = finer
        indices.append(triangles.ravel())
        runs.append(replace(run, first=first, count=triangles.size))
        first += triangles.size
    all_indices = np.concatenate(indices) if indices else laid_out.indices
    return BakedRoom(RoomVertices(vertices, all_indices.astype(np.int32), tuple(runs), ()), light)


def _light(
    vertices: npt.NDArray[np.void], rows: tuple[Floats, Floats], *, has_picture: bool
) -> Floats:
    out = np.zeros((len(vertices), 3), np.float32)
    light_points(
        np.ascontiguousarray(vertices["place_m"]),
        vertices["normal"][:, :3].astype(np.float32),
        linear_light(vertices["colour"][:, :3]),
        vertices["look"][:, 1].astype(np.float32) / np.float32(255),
        np.full(len(vertices), has_picture),
        *rows,
        CODES_OF_ROOT,
        FACTORS_OF_ROOT,
        out,
    )
    return out


def _between(a: npt.NDArray[np.void], b: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """Return the vertices halfway."""
    out = a.copy()
    for name in ("place_m", "normal", "uv"):
        out[name] = (a[name] + b[name]) / 2
    mean = (a["colour"].astype(np.int64) + b["colour"]) // 2
    out["colour"] = mean.astype(np.uint8)
    return out


def _cut(
    vertices: npt.NDArray[np.void],
    light: Floats,
    place: Ints,
    triangles: npt.NDArray[np.int32],
    rows: tuple[Floats, Floats],
    *,
    has_picture: bool,
) -> tuple[npt.NDArray[np.void], Floats, Ints, npt.NDArray[np.int32]]:
    """Halve every edge whose middle is lit differently from the mean of its ends.

    Edges at one place are cut together, whatever surface they belong to: no cracks open.
    """
    pairs = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    a, b, edge_of = _unique_pairs(pairs)
    length = np.linalg.norm(vertices["place_m"][a] - vertices["place_m"][b], axis=1)
    middle = _between(vertices[a], vertices[b])
    lit = _light(middle, rows, has_picture=has_picture)
    error = np.abs(lit - (light[a] + light[b]) / 2).max(axis=1)
    needs_cut = (length > MAX_EDGE_M) | ((error > MAX_ERROR) & (length > MIN_EDGE_M))
    _, _, same = _unique_pairs(np.stack([place[a], place[b]], axis=1))
    together = np.zeros(same.max(initial=-1) + 1, np.bool_)
    np.logical_or.at(together, same, needs_cut)
    needs_cut = together[same]
    if not needs_cut.any():
        return vertices, light, place, triangles
    number = np.where(needs_cut, len(vertices) + np.cumsum(needs_cut) - 1, -1)
    middles = number[edge_of].reshape(-1, 3)
    new_place = place.max(initial=0) + 1 + same[needs_cut]
    return (
        np.concatenate([vertices, middle[needs_cut]]),
        np.concatenate([light, lit[needs_cut]]),
        np.concatenate([place, new_place]),
        _split(triangles, middles.astype(np.int32)),
    )


def _unique_pairs(pairs: npt.NDArray[Any]) -> tuple[Ints, Ints, Ints]:
    """Return the different pairs whatever their order, lower and higher, and which each one is."""
    low, high = np.sort(pairs.astype(np.int64), axis=1).T
    keys, which = np.unique(low << 32 | high, return_inverse=True)
    return keys >> 32, keys & 0xFFFFFFFF, which.ravel()


def _split(
    triangles: npt.NDArray[np.int32], middles: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Split triangles at the middles (t, 3) of their edges, −1 where an edge stays whole."""
    count = (middles >= 0).sum(axis=1)
    (a, b, c), (ab, bc, ca) = triangles[count == 3].T, middles[count == 3].T
    quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    out = [triangles[count == 0], *(np.stack(corners, axis=1) for corners in quarters)]
    for turn in range(3):
        (a, b, c), (ab, bc, ca) = (np.roll(x, -turn, axis=1).T for x in (triangles, middles))
        one = (count == 1) & (ab >= 0)
        out.append(np.stack([a, ab, c], axis=1)[one])
        out.append(np.stack([ab, b, c], axis=1)[one])
        two = (count == 2) & (ca < 0)
        out.append(np.stack([ab, b, bc], axis=1)[two])
        out.append(np.stack([a, ab, bc], axis=1)[two])
        out.append(np.stack([a, bc, c], axis=1)[two])
    return np.concatenate(out)
