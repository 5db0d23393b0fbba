"""Eyeballs as true spheres round the joint, and lashes as single hairs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from character_making.figure import SIDES, Figure
from character_making.makehuman import Indices
from character_making.pieces import Piece, kept, triangulated
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX

_RINGS, _SECTORS = 18, 28


def eyeball(figure: Figure, side: str) -> Piece:
    """Return one eyeball; its pole lies on the visual axis, straight ahead of the joint."""
    centre, radius = figure.at(f"{side}_eye"), figure.eye_radius_m
    # Rings are dense at the front, where lids and iris need a round outline.
    polar = np.pi * (np.linspace(0, 1, _RINGS + 1) ** 1.35)[1:-1]
    around = 2 * np.pi * np.arange(_SECTORS) / _SECTORS
    p, a = np.meshgrid(polar, around, indexing="ij")
    ball = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), -np.cos(p)], axis=-1)
    ball = np.concatenate([[[0.0, 0.0, -1.0]], ball.reshape(-1, 3), [[0.0, 0.0, 1.0]]])
    ring = 1 + np.arange(len(polar) * _SECTORS).reshape(len(polar), _SECTORS)
    turn = np.roll(ring, -1, axis=1)
    last = len(ball) - 1
    triangles = np.concatenate(
        [
            np.stack([np.zeros(_SECTORS, dtype=np.int64), turn[0], ring[0]], axis=1),
            np.stack([ring[:-1], turn[:-1], turn[1:]], axis=-1).reshape(-1, 3),
            np.stack([ring[:-1], turn[1:], ring[1:]], axis=-1).reshape(-1, 3),
            np.stack([np.full(_SECTORS, last), ring[-1], turn[-1]], axis=1),
        ]
    )
    weights = np.zeros((len(ball), len(figure.rig.skeleton.names)))
    weights[:, figure.rig.skeleton.index(f"{side}_eye")] = 1.0
    # The white is duller and redder towards the corners.
    corner = np.clip((1 + ball[:, 2]) * 1.2, 0, 1)[:, None]
    colour = (1 - corner) * np.array([0.875, 0.86, 0.845]) + corner * np.array([0.74, 0.60, 0.57])
    return Piece(
        vertices_m=centre + radius * ball,
        triangles=triangles,
        weights=weights,
        colour=colour,
        part=np.full(len(triangles), PART_INDEX[f"{side}_eye"]),
        material="eye",
        normals=ball,
    )


def eyeballs(figure: Figure) -> list[Piece]:
    """Return both eyeballs."""
    return [eyeball(figure, side) for side, _ in SIDES]


UNLIT_MOUTH = np.array([0.30, 0.12, 0.11])


def mouth_pieces(figure: Figure) -> list[Piece]:
    """Return teeth and tongue, which show when the mouth opens."""
    pieces = []
    tones = {
        "upper-teeth": (0.74, 0.71, 0.66),
        "lower-teeth": (0.68, 0.65, 0.60),
        "tongue": (0.66, 0.34, 0.33),
    }
    jaw = figure.source.target("jawOpen")
    opened = np.zeros_like(figure.vertices_m)
    opened[jaw.vertices] = jaw.delta_m
    # Behind closed lips nothing of them may show at the corners.
    back = 0.0065 * figure.stature_m / 1.72
    inside = figure.vertices_m * np.array([0.88, 1.0, 1.0]) + np.array([0.0, 0.0, back])
    # Little light comes to the corners of a mouth.
    aside_m = np.abs(figure.vertices_m[:, 0]) * 1.72 / figure.stature_m
    lit = np.interp(aside_m, [0.008, 0.016], [1.0, 0.0])[:, None]
    for name, tone in tones.items():
        triangles = triangulated(figure.source.quads(f"helper-{name}"))
        whole = Piece(
            vertices_m=inside,
            triangles=triangles,
            weights=figure.weights,
            colour=lit * np.array(tone) + (1 - lit) * UNLIT_MOUTH,
            part=np.full(len(triangles), PART_INDEX["face"]),
            material="teeth",
            morphs={"jaw_open": opened},
        )
        pieces.append(kept(whole, np.ones(len(triangles), dtype=bool)))
    return pieces


@dataclass(frozen=True)
class Lash:
    """How lashes of one lid are drawn: hairs from column to column of the base mesh's strip, the
    share of its length they reach, half their width at the root, and the share of the skin in
    their colour: fine hairs that cover little of a pixel.
    """

    between: int
    reach: float
    half_wide_m: float
    skin: float


LASHES = {"1": Lash(3, 0.75, 0.00011, 0.45), "2": Lash(3, 0.85, 0.00028, 0.0)}
"""Of the lower and of the upper lid, by the base mesh's numbers."""


def lashes(
    figure: Figure, colour: Vector, skin: Vector, morphs: Mapping[str, Vector]
) -> list[Piece]:
    """Return lashes as single tapering hairs between root and tip of the base mesh's strips."""
    pieces = []
    for side in ("l", "r"):
        for strip, lash in LASHES.items():
            quads = figure.source.quads(f"helper-{side}-eyelashes-{strip}")
            tone = (1 - lash.skin) * colour + lash.skin * skin
            pieces.append(_hairs(figure, quads, lash, tone, morphs))
    return pieces


def _columns(quads: Indices, distance: Vector) -> list[list[int]]:
    """Follow a strip of lashes from its root, the row nearest to the eye, to its tips."""
    ways: dict[int, set[int]] = {}
    for a, b in np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)]).tolist():
        ways.setdefault(a, set()).add(b)
        ways.setdefault(b, set()).add(a)
    columns = []
    for start in sorted(ways):
        if distance[start] > min(distance[n] for n in ways[start]) - 1e-4 and not all(
            distance[n] > distance[start] - 4e-4 for n in ways[start]
        ):
            continue
        path = [start]
        while True:
            up = [n for n in ways[path[-1]] if distance[n] > distance[path[-1]] + 6e-4]
            if not up:
                break
            path.append(max(up, key=lambda n: distance[n] - distance[path[-1]]))
        if len(path) >= 3:
            columns.append(path)
    return columns


def _hairs(
    figure: Figure, quads: Indices, lash: Lash, colour: Vector, morphs: Mapping[str, Vector]
) -> Piece:
    side = "left" if figure.source.base_m[quads[0, 0], 0] < 0 else "right"
    # The way from root to tip is read off the base mesh, so that all figures have the same.
    cube = figure.source.joint_vertices[f"{side[0]}-eye"]
    plain = np.linalg.norm(figure.source.base_m - figure.source.base_m[cube].mean(axis=0), axis=1)
    columns = _columns(quads, plain)
    columns.sort(key=lambda path: float(figure.source.base_m[path[0], 0]))

    def rows(values: Vector) -> Vector:
        """Return (hairs, 3, 3): root, middle, tip of every hair."""
        root = np.array([values[path[1]] for path in columns])
        middle = np.array([values[path[min(2, len(path) - 1)]] for path in columns])
        end = np.array([values[path[-1]] for path in columns])
        ways = np.stack(
            [root, root + lash.reach * (middle - root), root + lash.reach * (end - root)], 1
        )
        steps = [
            (1 - t) * ways[:-1] + t * ways[1:]
            for t in np.linspace(0, 1, lash.between, endpoint=False)
        ]
        return np.concatenate([np.stack(steps, axis=1).reshape(-1, 3, 3), ways[-1:]])

    way = rows(figure.vertices_m)
    n = len(way)
    wide = lash.half_wide_m * np.array([[1.0, 0.0, 0.0]])
    vertices = np.stack(
        [way[:, 0] - wide, way[:, 0] + wide, way[:, 1] - 0.7 * wide, way[:, 1] + 0.7 * wide,
         way[:, 2]], axis=1,
    ).reshape(-1, 3)  # fmt: skip
    at = 5 * np.arange(n)[:, None]
    triangles = np.concatenate([at + np.array(k) for k in ((0, 1, 3), (0, 3, 2), (2, 3, 4))])
    weights = np.zeros((5 * n, len(figure.rig.skeleton.names)))
    weights[:, figure.rig.skeleton.index("head")] = 1.0
    moves = {}
    for name, delta in morphs.items():
        moved = rows(delta)
        moves[name] = moved[:, [0, 0, 1, 1, 2]].reshape(-1, 3)
    return Piece(
        vertices_m=vertices,
        triangles=triangles,
        weights=weights,
        colour=np.tile(colour, (len(vertices), 1)),
        part=np.full(len(triangles), PART_INDEX["face"]),
        material="lash",
        morphs=moves,
    )
