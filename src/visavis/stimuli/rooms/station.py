"""The metro station of the crowd study: a hall of arches between two platforms, with the board.

Coordinates are those of `visavis.stimuli.scenes.station_crowd`: the crowd fills a square about the
origin, the board hangs beyond the corner at (+x, −z).
"""

from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Pose, Vector, quat_from_yaw_pitch_deg
from visavis.stimuli.picture import Block, Light, PlacedProp, Prop, Room, StaticMesh
from visavis.stimuli.rooms import furniture, surfaces
from visavis.stimuli.rooms.solids import Srgb, box, cylinder, flat, join_meshes, lathe, move_mesh
from visavis.stimuli.scenes import station_crowd

HALF_WIDTH_M: Final = 6.6
"""From the middle of the hall to the middle of the columns."""
COLUMN_SPACING_M: Final = 5.0
SPRING_M: Final = 3.1
"""Where the arches spring from the columns."""
ENDS_M: Final = (-22.5, 17.5)
PLATFORM_M: Final = 4.2
"""Depth of a platform beyond the columns."""
CROWN_M: Final = 5.9
BOARD_SIZE_M: Final = (1.7, 1.0)
STATION_NAME: Final = "LINDEN SQUARE"
STONE: Srgb = (206, 198, 186)
PALE: Srgb = (232, 228, 220)
RED_STONE: Srgb = (136, 72, 62)


@lru_cache(maxsize=1)
def station() -> Room:
    """Return the station; the same object each time. The board's face is separate: `board_face`."""
    return Room(
        name="station",
        props=(
            *_floors(), *_columns(), *_vaults(), *_tracks(), *_board_case(), *_start_mark(),
            *_benches(),
        ),
        lights=(
            # Many lamps in a row throw one soft shadow each; together they act like this.
            Light("sun", np.array([0.44, 0.42, 0.385]),
                  direction=np.array([0.12, -1.0, -0.09]), casts_shadow=True),
            Light("point", np.array([6.5, 6.2, 5.6]), position_m=np.array([0.0, 4.9, -2.5])),
            Light("point", np.array([6.5, 6.2, 5.6]), position_m=np.array([0.0, 4.9, -12.5])),
            Light("point", np.array([6.5, 6.2, 5.6]), position_m=np.array([0.0, 4.9, 7.5])),
            Light("point", np.array([7.5, 7.5, 7.3]), position_m=np.array([-9.0, 4.2, -2.5])),
            Light("point", np.array([7.5, 7.5, 7.3]), position_m=np.array([9.0, 4.2, -2.5])),
        ),
        sky=np.array([0.42, 0.41, 0.385]),
        ground=np.array([0.39, 0.365, 0.33]),
        background_srgb=(16, 16, 18),
    )  # fmt: skip


def board_pose() -> Pose:
    """Return where the board hangs: its face towards the crowd's middle, +z of the pose."""
    x, y, z = station_crowd.BOARD_M
    return Pose(np.array([x, y, z]), quat_from_yaw_pitch_deg(float(np.degrees(np.arctan2(-x, -z)))))


@lru_cache(maxsize=64)
def board_face(track: str | None) -> PlacedProp:
    """Return the lit face of the timetable board; the track's number only when `track` is given."""
    amber, pale, dim = (255, 186, 60), (222, 226, 230), (96, 98, 104)
    track_text = track if track is not None else "- -"
    picture = surfaces.lettering(
        [
            ("DEPARTURES", 58, pale),
            ("next train", 44, dim if track is None else pale),
            (f"track {track_text}", 150, dim if track is None else amber),
            ("", 10, pale),
            ("come closer to read the track" if track is None else "all stations", 40, dim),
        ],
        (884, 520),
        (14, 16, 20),
        margin_px=36,
    )
    w, h = BOARD_SIZE_M
    face = flat((-w / 2, -h / 2, 0.051), (w, 0, 0), (0, h, 0), (255, 255, 255))
    return PlacedProp(
        furniture.place_prop(
            "board_face", face, (0, 0, 0), 0.0, picture, emission_01=1.0, casts_shadow=False
        ),
        board_pose(),
    )


def _floors() -> list[Prop]:
    (z0, z1), edge = ENDS_M, HALF_WIDTH_M + PLATFORM_M
    hall = furniture.level(
        "hall_floor", (-HALF_WIDTH_M, z0), (HALF_WIDTH_M, z1), 0.0, STONE,
        surfaces.tiles(31, 4, joint=0.8, mottling=0.045), uv_m=2.0, roughness_01=0.35,
    )  # fmt: skip
    sides = [
        furniture.level(
            f"platform_{name}", (x0, z0), (x1, z1), 0.0, (176, 170, 162),
            surfaces.tiles(32, 4, joint=0.8, mottling=0.045), uv_m=1.6, roughness_01=0.4,
        )
        for name, x0, x1 in (("left", -edge, -HALF_WIDTH_M), ("right", HALF_WIDTH_M, edge))
    ]  # fmt: skip
    length = z1 - z0
    lines = join_meshes(
        *(
            box((s * (edge - 0.45), 0.003, (z0 + z1) / 2), (0.18, 0.006, length), (226, 190, 66))
            for s in (-1, 1)
        )
    )
    bands = join_meshes(*(
        box((s * (HALF_WIDTH_M - 0.75), 0.002, (z0 + z1) / 2), (0.28, 0.004, length), RED_STONE,
            uv_m=1.0)
        for s in (-1, 1)
    ))  # fmt: skip
    return [
        hall, *sides,
        furniture.place_prop("safety_lines", lines, (0, 0, 0), 0.0, casts_shadow=False),
        furniture.place_prop("bands", bands, (0, 0, 0), 0.0, surfaces.marble(33),
                             casts_shadow=False, roughness_01=0.35),
    ]  # fmt: skip


def _columns_z() -> Vector:
    return np.arange(ENDS_M[0] + 2.5, ENDS_M[1], COLUMN_SPACING_M)


def _columns() -> list[Prop]:
    shafts, trims = [], []
    for side in (-1, 1):
        for z in _columns_z():
            at = (side * HALF_WIDTH_M, 0.0, float(z))
            shafts.append(move_mesh(
                join_meshes(
                    box((0, 0.55, 0), (0.78, 1.1, 0.78), RED_STONE, chamfer_m=0.04, uv_m=1.2),
                    box((0, 2.1, 0), (0.60, 2.0, 0.60), PALE, chamfer_m=0.10, uv_m=1.2),
                ), at))  # fmt: skip
            trims.append(move_mesh(
                join_meshes(
                    box((0, 0.06, 0), (0.92, 0.12, 0.92), (92, 84, 78), chamfer_m=0.02),
                    box((0, 1.12, 0), (0.72, 0.06, 0.72), (186, 188, 192), chamfer_m=0.01),
                    box((0, SPRING_M - 0.06, 0), (0.80, 0.12, 0.80), (186, 188, 192),
                        chamfer_m=0.02),
                ), at))  # fmt: skip
    return [
        furniture.place_prop(
            "columns", join_meshes(*shafts), (0, 0, 0), 0.0, surfaces.marble(34), roughness_01=0.4
        ),
        furniture.place_prop(
            "column_trims",
            join_meshes(*trims),
            (0, 0, 0),
            0.0,
            roughness_01=0.25,
            blocks=tuple(
                Block((side * HALF_WIDTH_M, 0, float(z)), *half, high)
                for side in (-1, 1)
                for z in _columns_z()
                for half, high in (((0.46, 0.46), 0.12), ((0.39, 0.39), SPRING_M))
            ),
        ),
    ]


def _arch_wall(radius_m: float, top_m: float) -> StaticMesh:
    """Return one bay of the wall above the columns: a face with a round opening, seen from +x."""
    angles = np.linspace(0, np.pi, 25)
    z, y = -radius_m * np.cos(angles), SPRING_M + radius_m * np.sin(angles)
    below = np.stack([np.zeros(25), y, z], 1)
    half = COLUMN_SPACING_M / 2
    above = np.stack([np.zeros(25), np.full(25, top_m), np.linspace(-half, half, 25)], 1)
    vertices = np.concatenate([below, above]).astype(np.float32)
    i = np.arange(24)
    triangles = np.concatenate(
        [np.stack([i, i + 25, i + 26], 1), np.stack([i, i + 26, i + 1], 1)]
    ).astype(np.int32)
    ends = [
        np.array([[0, SPRING_M, s * radius_m], [0, SPRING_M, s * half], [0, top_m, s * half]])
        for s in (-1.0, 1.0)
    ]
    more = np.array([[50, 52, 51], [53, 54, 55]], dtype=np.int32)
    vertices = np.concatenate([vertices, *ends]).astype(np.float32)
    triangles = np.concatenate([triangles, more])
    points = vertices[triangles]
    flip = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])[:, 0] < 0
    triangles[flip] = triangles[flip][:, ::-1]
    return StaticMesh(
        vertices,
        np.tile(np.array([1, 0, 0], dtype=np.float32), (len(vertices), 1)),
        np.tile(np.array(PALE, dtype=np.uint8), (len(vertices), 1)),
        triangles,
        (vertices[:, [2, 1]] / np.float32(2.0)).astype(np.float32),
    )


def _arch_band(radius_m: float, width_m: float) -> StaticMesh:
    """Return the steel band inside an opening, seen from below."""
    angles = np.linspace(0, np.pi, 25)
    outward = np.stack([np.zeros(25), -np.sin(angles), np.cos(angles)], 1)
    centre = np.array([0.0, SPRING_M, 0.0])
    rim = centre - radius_m * outward
    aside = np.array([width_m / 2, 0.0, 0.0])
    left, right = rim - aside, rim + aside
    i = np.arange(24)
    triangles = np.concatenate(
        [np.stack([i, i + 25, i + 26], 1), np.stack([i, i + 26, i + 1], 1)]
    ).astype(np.int32)
    vertices = np.concatenate([left, right]).astype(np.float32)
    points = vertices[triangles]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    if np.sum(normal * outward[triangles[:, 0] % 25]) < 0:
        triangles = triangles[:, ::-1]
    return StaticMesh(
        vertices,
        np.concatenate([outward, outward]).astype(np.float32),
        np.tile(np.array((178, 182, 188), dtype=np.uint8), (50, 1)),
        np.ascontiguousarray(triangles),
        np.zeros((50, 2), dtype=np.float32),
    )


def _vaults() -> list[Prop]:
    radius, top = COLUMN_SPACING_M / 2 - 0.30, SPRING_M + COLUMN_SPACING_M / 2 - 0.05
    bays = _columns_z()[:-1] + COLUMN_SPACING_M / 2
    walls, bands = [], []
    for side, yaw in ((-1, 0.0), (1, 180.0)):
        for z in bays:
            for face, turn in ((0.25, yaw), (-0.25, yaw + 180.0)):
                x = side * (HALF_WIDTH_M - face)
                walls.append(move_mesh(_arch_wall(radius, top), (x, 0, float(z)), yaw_deg=turn))
            bands.append(move_mesh(_arch_band(radius, 0.5), (side * HALF_WIDTH_M, 0, float(z))))
    return [
        furniture.place_prop("arches", join_meshes(*walls), (0, 0, 0), 0.0, surfaces.marble(35),
                             casts_shadow=False),
        furniture.place_prop("arch_bands", join_meshes(*bands), (0, 0, 0), 0.0, casts_shadow=False,
                             roughness_01=0.25),
        _ceiling(top), *_platform_ceilings(top), *_ceiling_lamps(), *_end_walls(),
    ]  # fmt: skip


def _ceiling(spring_m: float) -> Prop:
    """Return the low barrel vault over the hall."""
    across = np.linspace(-HALF_WIDTH_M + 0.25, HALF_WIDTH_M - 0.25, 17)
    rise = CROWN_M - spring_m
    height = spring_m + rise * (1 - (across / (HALF_WIDTH_M - 0.25)) ** 2)
    slope = -2 * rise * across / (HALF_WIDTH_M - 0.25) ** 2
    normal = np.stack([slope, -np.ones(17), np.zeros(17)], 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    rows = np.arange(ENDS_M[0], ENDS_M[1] + 0.1, 2.5)
    vertices = np.array([[x, y, z] for z in rows for x, y in zip(across, height, strict=True)])
    triangles = []
    for r in range(len(rows) - 1):
        i = r * 17 + np.arange(16)
        triangles += [np.stack([i, i + 1, i + 18], 1), np.stack([i, i + 18, i + 17], 1)]
    mesh = StaticMesh(
        vertices.astype(np.float32),
        np.tile(normal, (len(rows), 1)).astype(np.float32),
        np.tile(np.array((236, 232, 224), dtype=np.uint8), (len(vertices), 1)),
        np.concatenate(triangles).astype(np.int32),
        (vertices[:, [0, 2]] / 2.5).astype(np.float32),
    )
    return furniture.place_prop(
        "vault", mesh, (0, 0, 0), 0.0, surfaces.tiles(36, 1, joint=0.86, mottling=0.02),
        casts_shadow=False,
    )  # fmt: skip


def _platform_ceilings(spring_m: float) -> list[Prop]:
    edge = HALF_WIDTH_M + PLATFORM_M + 3.4
    return [
        furniture.level(
            f"platform_ceiling_{name}",
            (x0, ENDS_M[0]),
            (x1, ENDS_M[1]),
            spring_m - 0.05,
            (214, 210, 202),
            surfaces.plaster(37),
            faces_up=False,
        )
        for name, x0, x1 in (("left", -edge, -HALF_WIDTH_M), ("right", HALF_WIDTH_M, edge))
    ]


def _ceiling_lamps() -> list[Prop]:
    rings, glows = [], []
    for z in np.arange(ENDS_M[0] + 2.5, ENDS_M[1], 5.0):
        ring = lathe([(0.78, -0.10), (0.86, -0.10), (0.86, 0.02), (0.78, 0.02)], (188, 176, 146))
        rings.append(move_mesh(ring, (0, CROWN_M - 0.05, float(z))))
        glows.append(
            move_mesh(
                cylinder((0, -0.06, 0), (0, -0.03, 0), 0.78, (255, 246, 226), sides=32),
                (0, CROWN_M - 0.03, float(z)),
            )
        )
    glows += [
        box((side * (HALF_WIDTH_M + 2.1), 5.42, z), (0.16, 0.06, 1.5), (255, 250, 240))
        for side in (-1, 1)
        for z in np.arange(ENDS_M[0] + 2.5, ENDS_M[1], 5.0)
    ]
    return [
        furniture.place_prop(
            "lamp_rings", join_meshes(*rings), (0, 0, 0), 0.0, casts_shadow=False, roughness_01=0.3
        ),
        furniture.place_prop(
            "lamps", join_meshes(*glows), (0, 0, 0), 0.0, emission_01=1.0, casts_shadow=False
        ),
    ]


def _end_walls() -> list[Prop]:
    edge, height = HALF_WIDTH_M + PLATFORM_M + 3.4, CROWN_M + 0.2
    far, near = ENDS_M
    faces = join_meshes(
        flat((-edge, -1.2, far), (2 * edge, 0, 0), (0, height + 1.2, 0), STONE, uv_m=2.0),
        flat((edge, -1.2, near), (-2 * edge, 0, 0), (0, height + 1.2, 0), STONE, uv_m=2.0),
    )
    stairs = join_meshes(
        *(
            box((0, 0.16 * k + 0.08, far + 2.6 - 0.32 * k), (5.2, 0.16, 0.32), (178, 170, 160))
            for k in range(8)
        ),
        box((0, 2.45, far + 0.02), (5.6, 2.3, 0.02), (58, 54, 52)),
    )
    return [
        furniture.place_prop("end_walls", faces, (0, 0, 0), 0.0, surfaces.tiles(38, 6, joint=0.85),
                             casts_shadow=False),
        furniture.place_prop("stairs", stairs, (0, 0, 0), 0.0, casts_shadow=False),
    ]  # fmt: skip


def _tracks() -> list[Prop]:
    (z0, z1), edge = ENDS_M, HALF_WIDTH_M + PLATFORM_M
    length, middle = z1 - z0, (z0 + z1) / 2
    beds, rails, far_walls, names = [], [], [], []
    for s in (-1, 1):
        x = s * (edge + 1.7)
        beds.append(box((x, -1.15, middle), (3.4, 0.1, length), (64, 60, 56), uv_m=1.0))
        beds.append(box((s * (edge + 0.02), -0.55, middle), (0.04, 1.1, length), (120, 112, 104)))
        beds += [
            box((x, -1.06, z), (2.4, 0.10, 0.24), (82, 74, 66)) for z in np.arange(z0, z1, 1.2)
        ]
        rails += [
            box((x + r, -0.96, middle), (0.07, 0.12, length), (136, 128, 120))
            for r in (-0.76, 0.76)
        ]
        wall = flat((s * (edge + 3.4), -1.2, z0 if s > 0 else z1), (0, 0, s * length),
                    (0, CROWN_M + 1.2, 0), (206, 206, 200), uv_m=1.6)  # fmt: skip
        far_walls.append(wall)
        names += [
            flat((s * (edge + 3.37), 1.45, z - s * 1.6), (0, 0, s * 3.2), (0, 0.5, 0),
                 (255, 255, 255))
            for z in (-12.0, -2.0, 8.0)
        ]  # fmt: skip
    return [
        furniture.place_prop("track_beds", join_meshes(*beds), (0, 0, 0), 0.0, casts_shadow=False),
        furniture.place_prop("rails", join_meshes(*rails), (0, 0, 0), 0.0, casts_shadow=False,
                             roughness_01=0.25),
        furniture.place_prop("far_walls", join_meshes(*far_walls), (0, 0, 0), 0.0,
                             surfaces.tiles(39, 8, joint=0.82), casts_shadow=False,
                             roughness_01=0.3),
        furniture.place_prop("signs", join_meshes(*names), (0, 0, 0), 0.0, _name_sign(),
                             emission_01=0.45, casts_shadow=False),
    ]  # fmt: skip


def _name_sign() -> surfaces.Texture:
    return surfaces.lettering(
        [(STATION_NAME, 84, (244, 245, 246))], (896, 140), (30, 58, 118), margin_px=22
    )


def _board_case() -> list[Prop]:
    x, y, z = station_crowd.BOARD_M
    w, h = BOARD_SIZE_M
    yaw = float(np.degrees(np.arctan2(-x, -z)))
    case = join_meshes(
        box((0, 0, 0), (w + 0.08, h + 0.08, 0.10), (46, 48, 54), chamfer_m=0.01),
        *(
            cylinder(
                (s * 0.55, h / 2, 0), (s * 0.55, 4.95 - y, 0), 0.025, furniture.STEEL, sides=12
            )
            for s in (-1, 1)
        ),
    )
    return [furniture.place_prop("board_case", case, (x, y, z), yaw, roughness_01=0.3)]


def _start_mark() -> list[Prop]:
    x, z = station_crowd.START_M
    bars = join_meshes(
        *(
            move_mesh(box((0, 0.004, 0), (0.55, 0.008, 0.11), (40, 92, 190)), yaw_deg=turn)
            for turn in (45.0, -45.0)
        )
    )
    return [furniture.place_prop("start_mark", bars, (x, 0, z), 0.0, casts_shadow=False)]


def _benches() -> list[Prop]:
    props = []
    for side in (-1, 1):
        for z in (-17.5, -12.5, 12.5):
            seat = join_meshes(
                box((0, 0.43, 0), (1.8, 0.05, 0.44), furniture.WOOD, chamfer_m=0.01, uv_m=0.7),
                box((0, 0.20, 0), (1.5, 0.40, 0.30), (120, 114, 108), chamfer_m=0.02),
            )
            props.append(
                furniture.place_prop(
                    f"bench_{side}_{z}",
                    seat,
                    (side * (HALF_WIDTH_M - 1.4), 0, z),
                    90.0,
                    surfaces.planks(40, 4),
                    blocks=(
                        Block((0, 0.405, 0), 0.9, 0.22, 0.05),
                        Block((0, 0, 0), 0.75, 0.15, 0.40),
                    ),
                )
            )
    return props
