"""The seminar room of the stare study: audience on a stepped wooden stage, speaker behind.

Steps and chairs follow from where the heads of `visavis.stimuli.scenes.audience` are: the people
who sit there decide how high each chair must be, and how far before their eyes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg, yaw_pitch_deg_of
from visavis.stimuli.picture import Block, Light, Prop, Room, StaticMesh
from visavis.stimuli.rooms import furniture, surfaces
from visavis.stimuli.rooms.solids import Srgb, box, cylinder, flat, join_meshes, move_mesh
from visavis.stimuli.scenes import audience

STEPS_TURN_DEG: Final = audience.PARTICIPANT_TURN_DEG - audience.AUDIENCE_TURN_DEG
"""The steps run across this direction, left of the participant's view axis."""
STEP_EDGES_M: Final = (1.0, 1.66, 2.66, 3.46, 5.2)
"""Where the steps begin along that direction, from below the participant's eyes."""
STEP_HEIGHTS_M: Final = (0.0, 0.32, 0.64, 0.91)
"""So high that the feet of the smallest of the cast come flat on a step, to 4 cm."""
HIP_BEHIND_EYES_M: Final = 0.16
"""How far a seated person's hips are behind the midpoint of the eyes."""
CEILING_M: Final = 3.6
DESK_DEPTH_M: Final = 0.30
"""How far the desk before the first row reaches from its far edge towards the participant."""
SEAT_M: Final = 0.45
HIPS_BEHIND_MIDDLE_M: Final = 0.04
"""How far the joints of somebody's hips are behind the middle of their chair, against its back."""
SEAT_CLOTHS: Final = ((74, 88, 112), (96, 84, 92), (82, 98, 88))


def room_before_m(point_m: Vector, floor_m: float) -> float:
    """Return how far a toe at a point is behind the edge of the step of that height; on the floor,
    behind the desk.
    """
    depth = float(point_m @ direction_from_yaw_pitch_deg(STEPS_TURN_DEG, 0.0))
    begin = STEP_EDGES_M[STEP_HEIGHTS_M.index(floor_m)]
    return depth - begin + (DESK_DEPTH_M - 0.06 if floor_m == 0.0 else 0.0)


def step_height_m(point_m: Vector) -> float:
    """Return the height of the floor or step below a point of the world."""
    depth = float(point_m @ direction_from_yaw_pitch_deg(STEPS_TURN_DEG, 0.0))
    step = int(np.searchsorted(STEP_EDGES_M, depth)) - 1
    return STEP_HEIGHTS_M[step] if 0 <= step < len(STEP_HEIGHTS_M) else 0.0


@dataclass(frozen=True)
class Chair:
    """The height of its seat's `top_m`, and how far behind the middle of the sitter's eyes
    its middle is.
    """

    top_m: float
    behind_eyes_m: float


@lru_cache(maxsize=1)
def _without_chairs() -> tuple[Prop, ...]:
    shell = _shell(audience.PARTICIPANT_TURN_DEG)
    return (*shell, *_steps(STEPS_TURN_DEG), *_front(), *_speaker_place())


@lru_cache(maxsize=1024)
def _chair_props(row: int, chair: Chair | None) -> tuple[Prop, ...]:
    agent = audience.agent_at(row, str(row))  # whoever sits there
    floor = step_height_m(agent.eye_centre_m - HIP_BEHIND_EYES_M * agent.facing)
    chair = chair or Chair(floor + SEAT_M, HIP_BEHIND_EYES_M)
    middle = agent.eye_centre_m - chair.behind_eyes_m * agent.facing
    return furniture.chair(
        f"chair_{agent.place}",
        (middle[0], floor, middle[2]),
        float(yaw_pitch_deg_of(agent.facing)[0]),
        seat_m=chair.top_m - floor,
        cloth=SEAT_CLOTHS[row % len(SEAT_CLOTHS)],
    )


@lru_cache(maxsize=16)
def _room(chairs: tuple[tuple[str, Chair], ...]) -> Room:
    props, chair_of = list(_without_chairs()), dict(chairs)
    for i, place in enumerate(audience.PLACES):
        props += _chair_props(i, chair_of.get(place))
    return Room(
        name="audience_room",
        props=tuple(props),
        lights=_lights(audience.PARTICIPANT_TURN_DEG),
        sky=np.array([0.36, 0.36, 0.37]),
        ground=np.array([0.32, 0.29, 0.26]),
        background_srgb=(24, 24, 26),
    )


def audience_room(chairs: Mapping[str, Chair] | None = None) -> Room:
    """Return the room; `chairs` are by place.

    The same object comes back for the same chairs.
    """
    return _room(tuple(sorted((chairs or {}).items(), key=lambda item: item[0])))


def _place(mesh: StaticMesh, turn_deg: float) -> StaticMesh:
    return move_mesh(mesh, yaw_deg=turn_deg)


def _shell(turn: float) -> list[Prop]:
    low, high = (-4.6, -6.4), (4.6, 3.6)
    floor = furniture.level(
        "floor", low, high, 0.0, (142, 132, 120), surfaces.carpet(2), uv_m=0.8, roughness_01=0.95
    )
    ceiling = furniture.level(
        "ceiling", low, high, CEILING_M, (232, 231, 228), surfaces.tiles(5, 3, joint=0.88),
        faces_up=False, uv_m=1.8,
    )  # fmt: skip
    ceiling = replace(ceiling, emission_01=0.45)  # lit by what floor and walls give back
    around = furniture.walls(
        "room",
        (low[0], 0, low[1]),
        (high[0], CEILING_M, high[1]),
        (206, 203, 194),
        surfaces.plaster(4),
    )
    wood = join_meshes(
        *(
            box((x, 1.62, low[1] + 0.03), (0.10, 2.5, 0.04), furniture.WOOD, uv_m=0.7)
            for x in np.arange(-3.9, 4.0, 0.2)
        )
    )
    board = flat((-1.7, 1.55, low[1] + 0.06), (3.4, 0, 0), (0, 1.5, 0), (238, 240, 238))
    frame = join_meshes(
        box((0, 1.53, low[1] + 0.07), (3.5, 0.05, 0.05), furniture.STEEL),
        box((0, 3.07, low[1] + 0.07), (3.5, 0.05, 0.05), furniture.STEEL),
    )
    windows = []
    for z in (-4.6, -2.2, 0.2):
        windows += [
            flat((high[0] - 0.01, 1.0, z), (0, 0, 1.5), (0, 1.9, 0), (236, 240, 244)),
        ]
    sills = join_meshes(*(
        join_meshes(
            box((high[0] - 0.03, 0.97, z + 0.75), (0.16, 0.05, 1.66), (226, 224, 218)),
            box((high[0] - 0.02, 1.95, z + 0.75), (0.05, 0.05, 1.5), (226, 224, 218)),
            box((high[0] - 0.02, 1.95, z + 0.75), (0.05, 1.9, 0.05), (226, 224, 218)),
            *(box((high[0] - 0.02, 1.95, z + s), (0.05, 1.96, 0.06), (226, 224, 218))
              for s in (0.0, 1.5)),
            box((high[0] - 0.02, 2.92, z + 0.75), (0.05, 0.06, 1.56), (226, 224, 218)),
        )
        for z in (-4.6, -2.2, 0.2)
    ))  # fmt: skip
    door = join_meshes(
        box((low[0] + 0.02, 1.03, 1.6), (0.05, 2.06, 0.95), furniture.DARK_WOOD, uv_m=0.7),
        box((low[0] + 0.03, 2.09, 1.6), (0.07, 0.08, 1.11), (226, 224, 218)),
        box((low[0] + 0.03, 1.03, 1.09), (0.07, 2.06, 0.08), (226, 224, 218)),
        box((low[0] + 0.03, 1.03, 2.11), (0.07, 2.06, 0.08), (226, 224, 218)),
        cylinder((low[0] + 0.05, 1.05, 1.98), (low[0] + 0.10, 1.05, 1.98), 0.02, furniture.STEEL),
    )
    own = [
        floor,
        ceiling,
        *around,
        furniture.place_prop(
            "slats", wood, (0, 0, 0), 0.0, surfaces.planks(21, 3), casts_shadow=False
        ),
        furniture.place_prop("whiteboard", board, (0, 0, 0), 0.0, roughness_01=0.2),
        furniture.place_prop("whiteboard_frame", frame, (0, 0, 0), 0.0),
        furniture.place_prop(
            "windows",
            join_meshes(*windows),
            (0, 0, 0),
            0.0,
            surfaces.outside(28),
            emission_01=0.9,
            casts_shadow=False,
        ),
        furniture.place_prop("window_frames", sills, (0, 0, 0), 0.0, casts_shadow=False),
        furniture.place_prop("door", door, (0, 0, 0), 0.0, surfaces.planks(22, 2)),
    ]
    for x in (-2.3, 2.3):
        for z in (-4.8, -2.4, 0.0):
            own += furniture.ceiling_lamp(f"lamp_{x}_{z}", (x, CEILING_M - 0.04, z), (0.6, 1.2))
    return [
        Prop(p.name, _place(p.mesh, turn), p.material, p.emission_01, p.casts_shadow) for p in own
    ]


def _steps(turn: float) -> list[Prop]:
    props = []
    for i, height in enumerate(STEP_HEIGHTS_M):
        if height == 0.0:
            continue
        begin, end = STEP_EDGES_M[i], STEP_EDGES_M[-1]
        tread = box(
            (0, height - 0.02, -(begin + end) / 2),
            (6.6, 0.04, end - begin),
            (176, 138, 96),
            chamfer_m=0.006,
            uv_m=1.0,
        )
        riser = box(
            (0, (height - 0.04) / 2, -(begin + 0.03 + end) / 2),
            (6.56, height - 0.04, end - begin - 0.03),
            (120, 90, 62),
            uv_m=1.0,
        )
        props += [
            furniture.place_prop(f"step_{i}", _place(tread, turn), (0, 0, 0), 0.0,
                             surfaces.planks(23, 7), roughness_01=0.5),
            furniture.place_prop(f"riser_{i}", riser, (0, 0, 0), turn, surfaces.planks(24, 4),
                             blocks=(_riser_block(i),)),
        ]  # fmt: skip
    return props


def _riser_block(step: int) -> Block:
    """Return what of a step rises above the one before it."""
    begin, end, below = STEP_EDGES_M[step] + 0.03, STEP_EDGES_M[-1], STEP_HEIGHTS_M[step - 1]
    high = STEP_HEIGHTS_M[step] - below
    at = 0.0, below, -(begin + end) / 2
    return Block(at, 3.28, (end - begin) / 2, high, below)


def _front() -> list[Prop]:
    """Return the desk before the first row: its far edge hides what the beams of the geometry
    hide, and the first row's legs are below it.
    """
    left, right = audience.stage_front_occluders()[:2]
    top = float(left.start_m[1] + left.radius_m)
    line = [p * np.array([1.0, 0.0, 1.0]) for p in (left.start_m, left.end_m, right.end_m)]
    tops, panels, blocks = [], [], []
    for i in range(2):
        far, near = (_parallel_edge(line, i, d) for d in (-0.06, DESK_DEPTH_M + 0.06))
        tops.append(_slab(far, near, top - 0.04, top, furniture.DARK_WOOD, uv_m=0.7))
        far, near = (_parallel_edge(line, i, DESK_DEPTH_M + d) for d in (-0.015, 0.015))
        panels.append(_slab(far, near, 0.0, top - 0.04, (150, 110, 72), uv_m=1.0))
        for shift, half, low, high in (
            (DESK_DEPTH_M, 0.015, 0.0, top - 0.04),
            (DESK_DEPTH_M / 2, DESK_DEPTH_M / 2 + 0.06, top - 0.04, top),
        ):
            (x0, _, z0), (x1, _, z1) = _parallel_edge(line, i, shift)
            yaw = float(np.degrees(np.arctan2(z0 - z1, x1 - x0)))
            at = (x0 + x1) / 2, low, (z0 + z1) / 2
            blocks.append(Block(at, np.hypot(x1 - x0, z1 - z0) / 2, half, high - low, 0.0, yaw))
    return [
        furniture.place_prop(
            "front",
            join_meshes(*panels),
            (0, 0, 0),
            0.0,
            surfaces.planks(25, 6),
            blocks=tuple(blocks),
        ),
        furniture.place_prop(
            "front_rail",
            join_meshes(*tops),
            (0, 0, 0),
            0.0,
            surfaces.planks(26, 2),
            roughness_01=0.4,
        ),
    ]


def _parallel_edge(line: list[Vector], part: int, shift_m: float) -> tuple[Vector, Vector]:
    """Return the ends of a part of a bent line shifted towards the participant, mitred."""
    spans = [b - a for a, b in pairwise(line)]
    across = [np.array([-s[2], 0.0, s[0]]) / np.linalg.norm(s) for s in spans]
    bend = (across[0] + across[1]) / (1.0 + across[0] @ across[1])
    moved_line = (
        line[0] + shift_m * across[0],
        line[1] + shift_m * bend,
        line[2] + shift_m * across[1],
    )
    return moved_line[part], moved_line[part + 1]


def _slab(
    far: tuple[Vector, Vector],
    near: tuple[Vector, Vector],
    low_m: float,
    high_m: float,
    colour: Srgb,
    *,
    uv_m: float,
) -> StaticMesh:
    """Return an upright prism over the ground between two edges, each from left to right."""
    span = far[1] - far[0]
    length, depth = float(np.linalg.norm(span)), float(np.linalg.norm(near[0] - far[0]))
    straight = box((0, 0, 0), (length, high_m - low_m, depth), colour, uv_m=uv_m)
    x, y, z = straight.vertices_m.T.astype(np.float64)
    u, w = (x / length + 0.5)[:, None], (z / depth + 0.5)[:, None]
    corners = (1 - w) * ((1 - u) * far[0] + u * far[1]) + w * ((1 - u) * near[0] + u * near[1])
    corners[:, 1] = y + (low_m + high_m) / 2
    prism = move_mesh(straight, yaw_deg=float(np.degrees(np.arctan2(-span[2], span[0]))))
    return replace(prism, vertices_m=corners.astype(np.float32))


def _speaker_place() -> list[Prop]:
    """Return the lectern between the speaker and the audience."""
    feet = audience.SPEAKER_EYE_M * np.array([1.0, 0.0, 1.0])
    to_audience = direction_from_yaw_pitch_deg(audience.PARTICIPANT_TURN_DEG, 0.0)
    at = feet + 0.55 * to_audience
    lectern = join_meshes(
        box((0, 0.54, 0), (0.50, 1.08, 0.36), furniture.DARK_WOOD, chamfer_m=0.01, uv_m=0.7),
        box((0, 1.10, 0.02), (0.58, 0.04, 0.46), furniture.WOOD, chamfer_m=0.008, uv_m=0.7),
    )
    return [
        furniture.place_prop(
            "lectern",
            lectern,
            at,
            audience.PARTICIPANT_TURN_DEG,
            surfaces.planks(27, 3),
            blocks=(Block((0, 0, 0), 0.25, 0.18, 1.08),),
        )
    ]


def _lights(turn: float) -> tuple[Light, ...]:
    from_windows = direction_from_yaw_pitch_deg(turn + 62.0, -38.0)
    key = move_mesh(box((1.9, CEILING_M - 0.1, -0.6), (0.1, 0.1, 0.1), (0, 0, 0)), yaw_deg=turn)
    place = key.vertices_m.mean(axis=0).astype(np.float64)
    fill = np.array([-1.6, CEILING_M - 0.3, 0.9])
    target = np.array([-0.4, 1.2, -2.6])
    return (
        Light("sun", np.array([0.62, 0.60, 0.58]), direction=from_windows, casts_shadow=True),
        Light(
            "spot",
            np.array([9.5, 9.1, 8.5]),
            position_m=place,
            direction=(target - place) / np.linalg.norm(target - place),
            half_angle_deg=62.0,
            casts_shadow=True,
        ),
        Light("point", np.array([2.6, 2.6, 2.7]), position_m=fill),
    )
