"""Lamps as the shader reads them, and the frusta their shadows are drawn through."""

from dataclasses import dataclass

import numpy as np

from visavis.lab.geometry import Vector, unit
from visavis.stage.card.shaders.lighting import MAX_LIGHTS, MAX_SHADOWS, MAX_TAPS
from visavis.stage.errors import StageError
from visavis.stage.geometry.projection import looking
from visavis.stimuli.picture import Light, Room

KIND_NUMBERS = {"sun": 0.0, "spot": 1.0, "point": 2.0}
SUN_AWAY_M = 30.0
WIDEST_SHADOW_DEG = 75.0
LIGHTING_BYTES = 4 * (4 + 4 + 12 * MAX_LIGHTS + 16 * MAX_SHADOWS + 4 * MAX_SHADOWS)


@dataclass(frozen=True, eq=False)
class ShadowView:
    """The matrix (4, 4) from world through which the shadow map of a lamp is drawn.

    Edges of shadows are softened by `taps` a way, which span 2 · `taps` - 1 texels. A metre spans
    `metre_01` of the map at one metre from the lamp, of a sun's everywhere. Depth
    goes from `near_m` to `far_m`; a sun's, which grows evenly, is counted from 0.
    """

    light: int
    from_world: Vector
    taps: int
    metre_01: float
    near_m: float
    far_m: float


def shadow_views(
    room: Room, low_m: Vector, high_m: Vector, *, map_px: int, softness_m: float
) -> tuple[ShadowView, ...]:
    """Return the views of the lamps that cast shadows; a sun's covers the box low to high."""
    casting = [i for i, light in enumerate(room.lights) if light.casts_shadow]
    return tuple(
        _shadow_view(i, room.lights[i], low_m, high_m, map_px, softness_m)
        for i in casting[:MAX_SHADOWS]
    )


def _shadow_view(
    index: int, light: Light, low_m: Vector, high_m: Vector, map_px: int, softness_m: float
) -> ShadowView:
    centre, radius = (low_m + high_m) / 2, float(np.linalg.norm(high_m - low_m)) / 2 + 0.2
    if light.kind == "sun":
        direction = unit(np.asarray(_require_vector(light.direction, light), np.float64))
        matrix = looking(centre - SUN_AWAY_M * direction, direction)
        near, far = SUN_AWAY_M - radius, SUN_AWAY_M + radius
        flat = np.diag([1 / radius, 1 / radius, -2 / (far - near), 1.0])
        flat[2, 3] = -(far + near) / (far - near)
        metre = 1 / (2 * radius)
        return ShadowView(
            index, flat @ matrix, _taps(softness_m * map_px * metre), metre, 0.0, far - near
        )
    place = np.asarray(_require_vector(light.position_m, light), np.float64)
    along = light.direction if light.direction is not None else np.array([0.0, -1.0, 0.0])
    half_deg = light.half_angle_deg if light.kind == "spot" else WIDEST_SHADOW_DEG
    slope = float(np.tan(np.radians(min(half_deg, WIDEST_SHADOW_DEG))))
    farthest = float(np.linalg.norm(np.maximum(abs(low_m - place), abs(high_m - place)))) + 0.5
    near = 0.15
    deep = np.array(
        [
            [1 / slope, 0, 0, 0],
            [0, 1 / slope, 0, 0],
            [
                0,
                0,
                -(farthest + near) / (farthest - near),
                -2 * farthest * near / (farthest - near),
            ],
            [0, 0, -1, 0],
        ]
    )
    usual_m = 2.5
    return ShadowView(
        index,
        deep @ looking(place, along),
        _taps(softness_m * map_px / (2 * slope * usual_m)),
        1 / (2 * slope),
        near,
        farthest,
    )


def _taps(softness_texels: float) -> int:
    """Return the taps a way that blur by so many texels to either side of an edge."""
    return int(np.clip(round(softness_texels + 0.5), 2, MAX_TAPS))


def lighting_block(room: Room, shadows: tuple[ShadowView, ...]) -> bytes:
    """Return the `Lighting` uniform block of a room.

    Raises:
        StageError: the room has more lamps than can be drawn, or one lacks its place.
    """
    lights = room.lights
    if len(lights) > MAX_LIGHTS:
        raise StageError(
            f"room {room.name!r} has {len(lights)} lamps",
            remedy=f"use at most {MAX_LIGHTS} lamps in a room",
        )
    head = np.zeros((2, 4), np.float32)
    head[0, :3], head[0, 3] = room.sky, len(lights)
    head[1, :3], head[1, 3] = room.ground, len(shadows)
    lamps = np.zeros((3, MAX_LIGHTS, 4), np.float32)
    map_of = {view.light: k for k, view in enumerate(shadows)}
    for i, light in enumerate(lights):
        lamps[0, i, :3], lamps[1, i, :3] = lamp_place(light), lamp_axis(light)
        lamps[0, i, 3] = KIND_NUMBERS[light.kind]
        lamps[1, i, 3] = np.cos(np.radians(light.half_angle_deg))
        lamps[2, i, :3] = light.intensity
        lamps[2, i, 3] = map_of.get(i, -1)
    matrices = np.zeros((MAX_SHADOWS, 4, 4), np.float32)
    shapes = np.zeros((MAX_SHADOWS, 4), np.float32)
    for k, view in enumerate(shadows):
        matrices[k] = view.from_world.T
        shapes[k] = view.taps, view.metre_01, view.near_m, view.far_m
    return b"".join(part.tobytes() for part in (head, lamps, matrices, shapes))


def lamp_place(light: Light) -> Vector:
    """Return where a lamp stands; zero for a sun.

    Raises:
        StageError: it has no place.
    """
    return np.zeros(3) if light.kind == "sun" else _require_vector(light.position_m, light)


def lamp_axis(light: Light) -> Vector:
    """Return the unit direction a lamp shines along; zero for a point.

    Raises:
        StageError: it has no direction.
    """
    if light.kind == "point":
        return np.zeros(3)
    return unit(np.asarray(_require_vector(light.direction, light), np.float64))


def _require_vector(vector: Vector | None, light: Light) -> Vector:
    if vector is None:
        raise StageError(
            f"a {light.kind} lamp lacks its place or direction",
            remedy="give a spot both, a point its place, a sun its direction",
        )
    return vector
