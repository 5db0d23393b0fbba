"""Put pieces together into a character: weights, rest pose, normals, levels."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from character_making.figure import Figure
from character_making.pieces import Indices, Piece, vertex_normals
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Material, Morph, SkinnedMesh
from visavis.stimuli.characters.rest_pose import heaviest, to_rest

_MOVES_M = 2e-5


def assembled(
    figure: Figure, pieces: Sequence[Piece], materials: Sequence[Material]
) -> SkinnedMesh:
    """Return the pieces at rest as one mesh."""
    names = [m.name for m in materials]
    with_uv = any(piece.corner_uv is not None for piece in pieces)
    parts: dict[str, list[npt.NDArray[np.generic]]] = {}
    morphs: dict[str, list[tuple[Indices, Vector]]] = {}
    count = 0

    def add(name: str, value: npt.NDArray[np.generic]) -> None:
        parts.setdefault(name, []).append(value)

    for piece in pieces:
        joints, weights = heaviest(piece.weights)
        rest, blend = to_rest(figure.rig, piece.vertices_m, joints, weights)
        normals = vertex_normals(rest, piece.triangles)
        if piece.normals is not None:
            given = np.linalg.solve(blend, piece.normals[..., None])[..., 0]
            normals = given / np.linalg.norm(given, axis=1, keepdims=True)
        source, triangles, uv = _split_at_seams(piece)
        for name, delta in piece.morphs.items():
            turned = np.linalg.solve(blend, delta[..., None])[source, :, 0].astype(np.float64)
            moves = np.flatnonzero(np.abs(turned).max(axis=1) > _MOVES_M).astype(np.int64)
            if len(moves):
                morphs.setdefault(name, []).append((moves + count, turned[moves]))
        add("vertices", rest[source])
        add("normals", normals[source])
        add("colour", np.round(255 * np.clip(piece.colour[source], 0, 1)))
        add("joints", joints[source])
        add("weights", weights[source])
        add("triangles", triangles + count)
        add("part", piece.part)
        add("material", np.full(len(triangles), names.index(piece.material)))
        if with_uv:
            add("uv", uv)
        count += len(source)
    whole = {name: np.concatenate(values) for name, values in parts.items()}
    return SkinnedMesh(
        vertices_m=whole["vertices"].astype(np.float32),
        normals=whole["normals"].astype(np.float32),
        colour_srgb=whole["colour"].astype(np.uint8),
        uv=whole["uv"].astype(np.float32) if with_uv else None,
        joints=whole["joints"].astype(np.uint8),
        weights=whole["weights"].astype(np.float32),
        triangles=whole["triangles"].astype(np.int32),
        triangle_part=whole["part"].astype(np.uint8),
        triangle_material=whole["material"].astype(np.uint8),
        morphs={
            name: Morph(
                np.concatenate([v for v, _ in rows]).astype(np.int32),
                np.concatenate([d for _, d in rows]).astype(np.float32),
            )
            for name, rows in morphs.items()
        },
    )


def _split_at_seams(piece: Piece) -> tuple[Indices, Indices, Vector]:
    """Copy vertices that bear several texture places: source vertex, triangles, uv."""
    if piece.corner_uv is None:
        n = len(piece.vertices_m)
        return np.arange(n), piece.triangles, np.zeros((n, 2))
    places = np.round(piece.corner_uv.reshape(-1, 2) * 8192).astype(np.int64)
    places -= places.min(axis=0)
    wide, high = places.max(axis=0) + 1
    keys = (piece.triangles.reshape(-1) * wide + places[:, 0]) * high + places[:, 1]
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    source = piece.triangles.reshape(-1)[first]
    uv = piece.corner_uv.reshape(-1, 2)[first]
    return source, inverse.reshape(-1, 3), uv
