"""Set the lids of a face at rest: neutral, neither drooping over the iris nor slanting."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from character_making.eyes import eyeball
from character_making.figure import SIDES, Figure
from character_making.makehuman import BODY_VERTICES
from character_making.pieces import triangulated
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.characters.coverage import seen_tags, view_from

UPPER_M, LOWER_M = (0.0045, 0.0050), (-0.0058, -0.0053)
"""Between which heights above the middle of an iris of 6.2 mm radius lids cross it at rest: the
upper one covers its rim by 1.2 to 1.7 mm, the lower one touches it."""
_SLANT_LEFT = {"upper": 0.25, "lower": 0.5}
"""How much of a lid's own slant is left."""
_UPPER_FALLS_M, _LOWER_FALLS_M = (0.0006, 0.0014), (-0.0004, -0.0012)
"""Between how much lower than at the iris's middle lids are 6 mm beside it."""
_COLUMNS_M = np.linspace(-0.006, 0.006, 13)
"""Where lids are measured, outwards from the middle of the iris."""
_CORNERS_M = 0.0135
_ROUNDS, _STEP_M = 4, 0.0002
_ABOVE, _BELOW = 0.65, 0.45
"""Within how many radians about the eye above and below the lids' edges skin moves with them."""
_NEAR_M, _FAR_M = 0.006, 0.016
"""How far before the eyeball skin moves wholly and no longer."""


def with_neutral_lids(
    figure: Figure, morphs: Mapping[str, Vector]
) -> tuple[Figure, dict[str, Vector]]:
    """Return the figure with lids slid over its eyeballs to where they are in a neutral face, and
    shapes whose blinks close them from there.
    """
    own: tuple[Vector, Vector] | None = None
    now = figure
    for _ in range(_ROUNDS):
        upper, lower = _edges(now)
        if own is None:
            own = _neutral(upper, lower)
        now = _slid(now, (upper, lower), (own[0] - upper, own[1] - lower))
    moved = now.vertices_m - figure.vertices_m
    left = figure.vertices_m[:, 0] < 0
    blinks = {"left_blink": left, "right_blink": ~left}
    closing = {
        name: morphs[name] - moved * mine[:, None] if name in morphs else moved
        for name, mine in blinks.items()
    }
    return now, {**morphs, **closing}


def _neutral(upper: Vector, lower: Vector) -> tuple[Vector, Vector]:
    """Return heights of the edges in a neutral face that are like the person's own."""
    middle = len(_COLUMNS_M) // 2
    edges = []
    for edge, bounds, share, round_m in (
        (upper, UPPER_M, _SLANT_LEFT["upper"], _UPPER_FALLS_M),
        (lower, LOWER_M, _SLANT_LEFT["lower"], _LOWER_FALLS_M),
    ):
        even, odd = (edge + edge[::-1]) / 2, (edge - edge[::-1]) / 2
        towards_corners = (_COLUMNS_M / _COLUMNS_M[-1]) ** 2
        falls = [-m * towards_corners for m in round_m]
        arch = np.clip(even - even[middle], np.minimum(*falls), np.maximum(*falls))
        edges.append(np.clip(even[middle], *bounds) + arch + share * odd)
    return edges[0], edges[1]


def _edges(figure: Figure) -> tuple[Vector, Vector]:
    """Return heights (columns,) above the middle of the iris of the edges of both lids as seen from
    the front, as the mean of both eyes.
    """
    quads = triangulated(figure.source.quads("body"))
    found = []
    for side, _ in SIDES:
        centre = figure.at(f"{side}_eye")
        ball = eyeball(figure, side)
        near = (np.abs(figure.body_m[quads].mean(axis=1) - centre) < 0.04).all(axis=1)
        triangles = np.concatenate([quads[near], ball.triangles + BODY_VERTICES])
        tags = np.repeat([1, PART_INDEX[f"{side}_eye"]], [near.sum(), len(ball.triangles)])
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        within = centre + corners * [0.016, 0.014, 0.025]
        seen = seen_tags(
            np.concatenate([figure.body_m, ball.vertices_m]),
            triangles.astype(np.int32),
            tags.astype(np.uint8),
            view_from(0.0),
            _STEP_M,
            within.astype(np.float32),
        )
        found.append(_outline(seen == PART_INDEX[f"{side}_eye"], -1 if side == "left" else 1))
    upper, lower = np.mean(found, axis=0)
    return upper, lower


def _outline(seen: npt.NDArray[np.bool_], outwards: int) -> Vector:
    middle_row, middle_column = (np.array(seen.shape) - 1) / 2
    rows = np.arange(seen.shape[0])
    heights = []
    for x in outwards * _COLUMNS_M:
        column = seen[:, round(middle_column + x / _STEP_M)]
        free = rows[column] if column.any() else np.array([middle_row])
        heights.append([free.max() + 0.5 - middle_row, free.min() - 0.5 - middle_row])
    return np.array(heights).T * _STEP_M


def _slid(figure: Figure, at_m: tuple[Vector, Vector], by_m: tuple[Vector, Vector]) -> Figure:
    """Return the figure with the lids' edges at heights `at_m` slid up by `by_m`."""
    vertices_m = figure.vertices_m.copy()
    for side, _ in SIDES:
        centre, radius = figure.at(f"{side}_eye"), figure.eye_radius_m
        away = vertices_m - centre
        x = away[:, 0] * (-1 if side == "left" else 1)
        distance = np.linalg.norm(away, axis=1)
        mine = (np.abs(x) < _CORNERS_M) & (distance < radius + _FAR_M) & (away[:, 2] < 0.002)
        x, away, distance = x[mine], away[mine], distance[mine]
        across = np.sqrt(np.maximum(radius**2 - x**2, 1e-9))
        upper, lower = (
            np.arcsin(np.clip(np.interp(x, _COLUMNS_M, e) / across, -1, 1)) for e in at_m
        )
        lift, drop = (np.interp(x, _COLUMNS_M, e) / across for e in by_m)
        corner = np.clip((_CORNERS_M - np.abs(x)) / (_CORNERS_M - 0.007), 0, 1)
        near = np.clip((radius + _FAR_M - distance) / (_FAR_M - _NEAR_M), 0, 1)
        fade = _eased(corner) * _eased(near) * np.clip((0.002 - away[:, 2]) / 0.006, 0, 1)
        angle = np.arctan2(away[:, 1], -away[:, 2])
        between = np.clip((angle - lower) / np.maximum(upper - lower, 1e-6), 0, 1)
        up = between * _eased(1 - np.clip((angle - upper) / _ABOVE, 0, 1))
        down = (1 - between) * _eased(1 - np.clip((lower - angle) / _BELOW, 0, 1))
        turn = angle + fade * (lift * up + drop * down)
        arm = np.hypot(away[:, 1], away[:, 2])
        vertices_m[mine, 1] = centre[1] + arm * np.sin(turn)
        vertices_m[mine, 2] = centre[2] - arm * np.cos(turn)
    return replace(figure, vertices_m=vertices_m)


def _eased(share: Vector) -> Vector:
    smooth: Vector = share**2 * (3 - 2 * share)
    return smooth
