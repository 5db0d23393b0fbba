"""Furniture: chairs, desks, screens, plants, shelves, lamps; each stands on the floor at the
origin with its front towards −z, unless it says otherwise.
"""

from dataclasses import replace

import numpy as np

from visavis.lab.geometry import Vector, quat_from_yaw_pitch_deg, rotate
from visavis.stimuli.characters.character import MaterialKind
from visavis.stimuli.picture import Block, Prop, StaticMesh
from visavis.stimuli.rooms import surfaces
from visavis.stimuli.rooms.solids import (
    Point,
    Srgb,
    box,
    cylinder,
    flat,
    join_meshes,
    lathe,
    move_mesh,
)

WOOD: Srgb = (168, 124, 82)
DARK_WOOD: Srgb = (104, 72, 48)
STEEL: Srgb = (150, 153, 158)
BLACK: Srgb = (38, 39, 42)
PANEL_ABOVE_M = 0.13
"""How far above the floor the panel before a desk ends."""


def chair(
    name: str, at_m: Point, yaw_deg: float, *, seat_m: float = 0.45, cloth: Srgb = (70, 84, 108)
) -> tuple[Prop, ...]:
    """Return a padded chair: its seat's top `seat_m` above `at_m`, `at_m` below its middle."""
    pad = 0.05
    cushion = join_meshes(
        box((0, seat_m - pad / 2, 0.02), (0.45, pad, 0.44), cloth, chamfer_m=0.018, uv_m=0.3),
        box((0, seat_m + 0.33, 0.245), (0.43, 0.34, 0.04), cloth, chamfer_m=0.015, uv_m=0.3),
    )
    legs = [
        cylinder((x, 0, z), (0.93 * x, seat_m - pad, 0.93 * top_z), 0.013, STEEL, sides=10)
        for x in (-0.21, 0.21)
        for z, top_z in ((-0.19, -0.19), (0.17, 0.23))
    ]
    posts = [
        cylinder((x, seat_m - pad, 0.235), (x, seat_m + 0.45, 0.27), 0.012, STEEL, sides=10)
        for x in (-0.19, 0.19)
    ]
    frame = join_meshes(
        *legs, *posts, box((0, seat_m - pad - 0.01, 0.02), (0.43, 0.02, 0.42), BLACK)
    )
    seat = Block((0, seat_m - pad - 0.02, 0.02), 0.225, 0.22, pad + 0.02)
    feet = [
        Block((x, 0, z), 0.013, 0.013, seat_m - pad, round=True)
        for x in (-0.21, 0.21)
        for z in (-0.19, 0.17)
    ]
    return (
        place_prop(f"{name}_cushion", cushion, at_m, yaw_deg, surfaces.weave(3), kind="cloth"),
        place_prop(f"{name}_frame", frame, at_m, yaw_deg, roughness_01=0.35, blocks=(seat, *feet)),
    )


def desk(
    name: str,
    at_m: Point,
    yaw_deg: float,
    *,
    width_m: float = 1.5,
    height_m: float = 0.73,
    depth_m: float = 0.7,
    front: Srgb | None = None,
) -> tuple[Prop, ...]:
    """Return a desk; with `front` a panel of that colour closes the side away from the sitter."""
    top = box((0, height_m - 0.015, 0), (width_m, 0.03, depth_m), WOOD, chamfer_m=0.004, uv_m=0.8)
    legs = join_meshes(
        *(
            box((x, (height_m - 0.03) / 2, 0), (0.04, height_m - 0.03, depth_m - 0.08), STEEL)
            for x in (-width_m / 2 + 0.05, width_m / 2 - 0.05)
        )
    )
    under, legs_x = height_m - 0.03, width_m / 2 - 0.05
    blocks: tuple[Block, ...]
    if front is None:
        blocks = (
            Block((0, under, 0), width_m / 2, depth_m / 2, height_m - under),
            *(Block((x, 0, 0), 0.02, depth_m / 2 - 0.04, under) for x in (-legs_x, legs_x)),
        )
    else:
        # A single block, closed but for its foot: parts that hide the same sky would count twice.
        high = height_m - PANEL_ABOVE_M
        blocks = (Block((0, PANEL_ABOVE_M, 0), width_m / 2, depth_m / 2, high),)
    props = [
        place_prop(
            f"{name}_top",
            top,
            at_m,
            yaw_deg,
            surfaces.planks(11, 3),
            roughness_01=0.45,
            blocks=blocks,
        ),
        place_prop(f"{name}_legs", legs, at_m, yaw_deg, roughness_01=0.4),
    ]
    if front is not None:
        panel = box(
            (0, (height_m - 0.03) / 2 + 0.06, -depth_m / 2 + 0.03),
            (width_m - 0.12, height_m - 0.17, 0.02),
            front,
            chamfer_m=0.003,
        )
        props.append(place_prop(f"{name}_front", panel, at_m, yaw_deg))
    return tuple(props)


def monitor(name: str, at_m: Point, yaw_deg: float) -> tuple[Prop, ...]:
    """Return a screen on its foot, standing on a desk top at `at_m`, its picture towards −z."""
    case = join_meshes(
        box((0, 0.30, 0.01), (0.52, 0.31, 0.025), BLACK, chamfer_m=0.005),
        cylinder((0, 0.0, 0.03), (0, 0.22, 0.03), 0.018, STEEL, sides=12),
        cylinder((0, 0, 0.03), (0, 0.012, 0.03), 0.10, STEEL, sides=24),
    )
    picture = flat((0.25, 0.155, -0.004), (-0.50, 0, 0), (0, 0.29, 0), (92, 128, 168))
    return (
        place_prop(f"{name}_case", case, at_m, yaw_deg, roughness_01=0.4),
        place_prop(f"{name}_picture", picture, at_m, yaw_deg, emission_01=0.5),
    )


def keyboard(name: str, at_m: Point, yaw_deg: float) -> Prop:
    """Return a keyboard lying on a desk top at `at_m`."""
    keys = [
        box((0.026 * (c - 7), 0.02, 0.022 * (r - 2)), (0.02, 0.008, 0.017), (72, 74, 78))
        for r in range(5)
        for c in range(15)
    ]
    base = box((0, 0.009, 0), (0.42, 0.018, 0.13), BLACK, chamfer_m=0.004)
    return place_prop(name, join_meshes(base, *keys), at_m, yaw_deg, casts_shadow=False)


def plant(
    name: str, at_m: Point, *, seed: int, height_m: float = 1.5, leaves: int = 90
) -> tuple[Prop, ...]:
    """Return a leafy plant in a pot: a sparse occluder that lets glimpses through."""
    rng = np.random.default_rng(seed)
    pot = join_meshes(
        lathe(
            [(0.12, 0), (0.16, 0.15), (0.18, 0.30), (0.165, 0.305), (0.15, 0.26)], (196, 188, 176)
        ),
        cylinder((0, 0.255, 0), (0, 0.262, 0), 0.15, (58, 44, 34), sides=24),
    )
    stems, blades = [], []
    for _ in range(9):
        turn, lean = rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 0.28)
        top = np.array([np.cos(turn) * lean, rng.uniform(0.75, 1.0), np.sin(turn) * lean])
        stems.append(
            cylinder((0.03 * np.cos(turn), 0.26, 0.03 * np.sin(turn)), top * [1, height_m - 0.1, 1],
                     0.008, (92, 104, 58), sides=6, end_radius_m=0.004)
        )  # fmt: skip
        for _ in range(leaves // 9):
            up = rng.uniform(0.30, 1.0)
            root = np.array([0, 0.26, 0]) * (1 - up) + top * [1, height_m - 0.1, 1] * up
            blades.append(_leaf(rng, root))
    leafage = join_meshes(*blades)
    return (
        place_prop(
            f"{name}_pot",
            pot,
            at_m,
            0.0,
            roughness_01=0.5,
            blocks=(Block((0, 0, 0), 0.13, 0.13, 0.30, round=True),),
        ),
        place_prop(f"{name}_stems", join_meshes(*stems), at_m, 0.0),
        place_prop(f"{name}_leaves", leafage, at_m, 0.0, double_sided=True, roughness_01=0.5),
    )


def _leaf(rng: np.random.Generator, root: Vector) -> StaticMesh:
    turn, length = rng.uniform(0, 2 * np.pi), rng.uniform(0.13, 0.24)
    out = np.array([np.cos(turn), rng.uniform(-0.35, 0.7), np.sin(turn)])
    out /= np.linalg.norm(out)
    side = np.cross(out, [0, 1, 0])
    side /= np.linalg.norm(side)
    width = 0.30 * length
    bend = np.array([0, -0.25 * length, 0])
    points = np.array(
        [
            root,
            root + 0.45 * length * out + width / 2 * side,
            root + length * out + bend,
            root + 0.45 * length * out - width / 2 * side,
        ]
    )
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    normal = normal / np.linalg.norm(normal) * (1 if normal[1] > 0 else -1)
    green = np.array([70, 110, 58]) * rng.uniform(0.75, 1.2)
    return StaticMesh(
        vertices_m=points.astype(np.float32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        colour_srgb=np.tile(np.clip(green, 0, 255).astype(np.uint8), (4, 1)),
        triangles=np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32),
        uv=np.zeros((4, 2), dtype=np.float32),
    )


def shelf(
    name: str,
    at_m: Point,
    yaw_deg: float,
    *,
    seed: int,
    width_m: float = 0.9,
    height_m: float = 1.4,
) -> tuple[Prop, ...]:
    """Return shelves with folders of several colours; a solid occluder."""
    rng = np.random.default_rng(seed)
    depth, board = 0.32, 0.022
    levels = np.linspace(board, height_m - board / 2, max(2, round(height_m / 0.36)) + 1)
    wood = [box((0, y, 0), (width_m, board, depth), WOOD, uv_m=0.8) for y in levels]
    wood += [
        box((x, height_m / 2, 0), (board, height_m, depth), WOOD, uv_m=0.8)
        for x in (-width_m / 2, width_m / 2)
    ]
    wood.append(box((0, height_m / 2, depth / 2), (width_m, height_m, 0.01), DARK_WOOD, uv_m=0.8))
    colours = [(64, 84, 112), (142, 60, 52), (78, 108, 84), (196, 188, 168), (58, 58, 64)]
    folders = []
    for below in levels[:-1]:
        x = -width_m / 2 + 0.03
        while x < width_m / 2 - 0.09:
            thick, tall = rng.uniform(0.035, 0.075), rng.uniform(0.24, 0.31)
            if rng.random() < 0.85:
                folders.append(
                    box((x + thick / 2, below + board / 2 + tall / 2, 0.0), (thick - 0.003, tall,
                        0.26), colours[int(rng.integers(len(colours)))], chamfer_m=0.003)
                )  # fmt: skip
            x += thick
    return (
        place_prop(
            f"{name}_boards",
            join_meshes(*wood),
            at_m,
            yaw_deg,
            surfaces.planks(12, 3),
            blocks=(Block((0, 0, 0), (width_m + board) / 2, depth / 2, height_m),),
        ),
        place_prop(f"{name}_folders", join_meshes(*folders), at_m, yaw_deg),
    )


def ceiling_lamp(name: str, at_m: Point, size_m: tuple[float, float]) -> tuple[Prop, ...]:
    """Return a luminous panel with its frame, its underside at `at_m`."""
    w, d = size_m
    glow = flat((-w / 2, -0.001, -d / 2), (w, 0, 0), (0, 0, d), (255, 250, 240))
    frame = box((0, 0.02, 0), (w + 0.06, 0.038, d + 0.06), (210, 210, 208))
    return (
        place_prop(f"{name}_frame", frame, at_m, 0.0, casts_shadow=False),
        place_prop(f"{name}_glow", glow, at_m, 0.0, emission_01=1.0, casts_shadow=False),
    )


def door(name: str, at_m: Point, yaw_deg: float) -> tuple[Prop, ...]:
    """Return a closed door and its frame before a wall at `at_m`, seen from −z."""
    leaf = box((0, 1.03, 0), (0.95, 2.06, 0.05), DARK_WOOD, uv_m=0.7)
    frame = join_meshes(
        box((0, 2.09, 0), (1.11, 0.08, 0.07), (226, 224, 218)),
        *(box((x, 1.03, 0), (0.08, 2.06, 0.07), (226, 224, 218)) for x in (-0.51, 0.51)),
        cylinder((0.38, 1.05, -0.025), (0.38, 1.05, -0.08), 0.011, STEEL, sides=12),
        cylinder((0.39, 1.05, -0.07), (0.27, 1.05, -0.07), 0.011, STEEL, sides=12),
    )
    return (
        place_prop(f"{name}_leaf", leaf, at_m, yaw_deg, surfaces.planks(22, 2), casts_shadow=False),
        place_prop(f"{name}_frame", frame, at_m, yaw_deg, casts_shadow=False),
    )


def wall_picture(
    name: str,
    at_m: Point,
    yaw_deg: float,
    size_m: tuple[float, float],
    colour: Srgb,
    texture: surfaces.Texture | None = None,
    *,
    frame: Srgb = (60, 58, 56),
    mat_m: float = 0.0,
) -> tuple[Prop, ...]:
    """Return a framed picture or board on a wall, its middle at `at_m`, seen from −z."""
    w, h = size_m
    edge, mat = 0.03, (240, 238, 232)
    bars = join_meshes(
        *(box((s * (w + edge) / 2, 0, 0), (edge, h + 2 * edge, 0.03), frame) for s in (-1, 1)),
        *(box((0, s * (h + edge) / 2, 0), (w, edge, 0.03), frame) for s in (-1, 1)),
        flat((w / 2, -h / 2, -0.004), (-w, 0, 0), (0, h, 0), mat),
    )
    w, h = w - 2 * mat_m, h - 2 * mat_m
    face = flat((w / 2, -h / 2, -0.006), (-w, 0, 0), (0, h, 0), colour)
    return (
        place_prop(f"{name}_frame", bars, at_m, yaw_deg, casts_shadow=False),
        place_prop(f"{name}_face", face, at_m, yaw_deg, texture, casts_shadow=False),
    )


def walls(
    name: str,
    low_m: Point,
    high_m: Point,
    colour: Srgb,
    texture: surfaces.Texture,
    *,
    uv_m: float = 2.0,
) -> tuple[Prop, ...]:
    """Return the four inner walls of a box-shaped room from corner to corner."""
    (x0, y0, z0), (x1, y1, z1) = low_m, high_m
    up = (0, y1 - y0, 0)
    faces = (
        flat((x0, y0, z0), (x1 - x0, 0, 0), up, colour, uv_m=uv_m),
        flat((x1, y0, z0), (0, 0, z1 - z0), up, colour, uv_m=uv_m),
        flat((x1, y0, z1), (x0 - x1, 0, 0), up, colour, uv_m=uv_m),
        flat((x0, y0, z1), (0, 0, z0 - z1), up, colour, uv_m=uv_m),
    )
    skirting = join_meshes(
        box(((x0 + x1) / 2, y0 + 0.05, z0 + 0.006), (x1 - x0, 0.10, 0.012), (232, 230, 224)),
        box(((x0 + x1) / 2, y0 + 0.05, z1 - 0.006), (x1 - x0, 0.10, 0.012), (232, 230, 224)),
        box((x0 + 0.006, y0 + 0.05, (z0 + z1) / 2), (0.012, 0.10, z1 - z0), (232, 230, 224)),
        box((x1 - 0.006, y0 + 0.05, (z0 + z1) / 2), (0.012, 0.10, z1 - z0), (232, 230, 224)),
    )
    return (
        place_prop(
            f"{name}_walls", join_meshes(*faces), (0, 0, 0), 0.0, texture, casts_shadow=False
        ),
        place_prop(f"{name}_skirting", skirting, (0, 0, 0), 0.0, casts_shadow=False),
    )


def level(
    name: str,
    low_m: Point,
    high_m: Point,
    height_m: float,
    colour: Srgb,
    texture: surfaces.Texture,
    *,
    faces_up: bool = True,
    uv_m: float = 2.0,
    roughness_01: float = 0.6,
) -> Prop:
    """Return a floor (or a ceiling) between two corners (x, z), cut into squares of 1 m or so."""
    (x0, z0), (x1, z1) = low_m, high_m
    columns, rows = max(1, round(x1 - x0)), max(1, round(z1 - z0))
    dx, dz = (x1 - x0) / columns, (z1 - z0) / rows
    pieces = []
    for i in range(columns):
        for j in range(rows):
            corner = (x0 + i * dx, height_m, z0 + (j + 1) * dz)
            u, v = (dx, 0, 0), (0, 0, -dz)
            if not faces_up:
                corner, v = (x0 + i * dx, height_m, z0 + j * dz), (0, 0, dz)
            piece = flat(corner, u, v, colour)
            uv = piece.vertices_m[:, [0, 2]] / np.float32(uv_m)
            pieces.append(
                StaticMesh(
                    piece.vertices_m,
                    piece.normals,
                    piece.colour_srgb,
                    piece.triangles,
                    uv.astype(np.float32),
                )
            )
    return place_prop(
        name,
        join_meshes(*pieces),
        (0, 0, 0),
        0.0,
        texture,
        roughness_01=roughness_01,
        casts_shadow=False,
    )


def place_prop(
    name: str,
    mesh: StaticMesh,
    at_m: Point,
    yaw_deg: float,
    texture: surfaces.Texture | None = None,
    *,
    roughness_01: float = 0.8,
    kind: MaterialKind = "other",
    emission_01: float = 0.0,
    casts_shadow: bool = True,
    double_sided: bool = False,
    blocks: tuple[Block, ...] = (),
) -> Prop:
    """Return a mesh with its material and its blocks, turned and set on its place."""
    material = surfaces.surface(
        name, texture, roughness_01=roughness_01, kind=kind, double_sided=double_sided
    )
    standing = tuple(_place_block(b, at_m, yaw_deg) for b in blocks)
    return Prop(
        name, move_mesh(mesh, at_m, yaw_deg=yaw_deg), material, emission_01, casts_shadow, standing
    )


def shift_prop(prop: Prop, by_m: Point) -> Prop:
    """Return a prop and its blocks set elsewhere on the same floor, or on one as much higher."""
    blocks = tuple(_place_block(block, by_m, 0.0) for block in prop.blocks)
    return replace(prop, mesh=move_mesh(prop.mesh, by_m), blocks=blocks)


def _place_block(block: Block, at_m: Point, yaw_deg: float) -> Block:
    middle = rotate(quat_from_yaw_pitch_deg(yaw_deg), np.array(block.at_m)) + np.asarray(at_m)
    x, y, z = middle.tolist()
    floor = block.floor_m + float(at_m[1])
    return replace(block, at_m=(x, y, z), floor_m=floor, yaw_deg=block.yaw_deg + yaw_deg)
