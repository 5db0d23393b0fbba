"""The office of the waving study: desks, screens, shelves, plants, a pillar, windows."""

from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, unit
from visavis.stimuli.picture import Block, Light, Prop, Room
from visavis.stimuli.rooms import furniture, surfaces
from visavis.stimuli.rooms.solids import box, cylinder, flat, join_meshes
from visavis.stimuli.scenes import office as places

CEILING_M: Final = 3.0
WINDOWS_X_M: Final = (-3.9, -1.95, 0.25, 2.2)


@lru_cache(maxsize=1)
def office() -> Room:
    """Return the office; the same object each time."""
    return Room(
        name="office",
        props=(*_shell(), *_desks(), *_between(), *_waiting_line()),
        lights=(
            Light("sun", np.array([0.55, 0.54, 0.52]), direction=_unit(0.62, -0.62, -0.48),
                  casts_shadow=True),
            # Above the ceiling, which stops no light: beneath it they would burn a patch into it.
            Light("spot", np.array([10.6, 10.4, 9.9]), position_m=np.array([-0.6, 3.4, -1.6]),
                  direction=_unit(0.12, -0.62, -0.80), half_angle_deg=66.0, casts_shadow=True),
            Light("point", np.array([4.4, 4.4, 4.4]), position_m=np.array([0.0, 3.5, 0.6])),
            Light("point", np.array([3.6, 3.6, 3.6]), position_m=np.array([0.0, 3.5, -5.8])),
        ),
        sky=np.array([0.40, 0.40, 0.41]),
        ground=np.array([0.36, 0.34, 0.31]),
        background_srgb=(24, 24, 26),
    )  # fmt: skip


def _unit(x: float, y: float, z: float) -> Vector:
    return unit(np.array([x, y, z]))


def _shell() -> list[Prop]:
    low, high = places.ROOM_LOW_M, places.ROOM_HIGH_M
    floor = furniture.level(
        "floor", low, high, 0.0, (188, 160, 128), surfaces.planks(51, 8), uv_m=1.6,
        roughness_01=0.45,
    )  # fmt: skip
    ceiling = furniture.level(
        "ceiling", low, high, CEILING_M, (250, 250, 248), surfaces.tiles(52, 3, joint=0.88),
        faces_up=False, uv_m=1.8,
    )  # fmt: skip
    ceiling = replace(ceiling, emission_01=0.4)  # lit by what floor and walls give back
    around = furniture.walls(
        "room",
        (low[0], 0, low[1]),
        (high[0], CEILING_M, high[1]),
        (214, 214, 208),
        surfaces.plaster(53),
    )
    back = low[1]
    panes = join_meshes(
        *(
            flat((x, 0.95, back + 0.012), (1.7, 0, 0), (0, 1.55, 0), (236, 240, 244))
            for x in WINDOWS_X_M
        ),
    )
    frames = join_meshes(*(
        join_meshes(
            box((x + 0.85, 0.93, back + 0.06), (1.84, 0.04, 0.14), (232, 231, 228)),
            box((x + 0.85, 2.52, back + 0.02), (1.78, 0.06, 0.05), (232, 231, 228)),
            *(box((x + s, 1.72, back + 0.02), (0.05, 1.6, 0.05), (232, 231, 228))
              for s in (0.0, 0.85, 1.7)),
        )
        for x in WINDOWS_X_M
    ))  # fmt: skip
    # Closed slats as a picture: single ones are thinner than pixels.
    blinds = join_meshes(
        *(
            flat((x + 0.02, 2.04, back + 0.06), (1.66, 0, 0), (0, 0.46, 0), (232, 231, 226))
            for x in WINDOWS_X_M
        )
    )
    rails = join_meshes(
        *(
            box((x + 0.85, high, back + 0.06), (1.68, thick, 0.01), (226, 225, 221))
            for x in WINDOWS_X_M
            for high, thick in ((2.49, 0.06), (2.035, 0.03))
        )
    )
    left, right, front = low[0] + 0.015, high[0] - 0.015, high[1] - 0.015
    prints = surfaces.marble(54)
    wall_pictures = (
        *furniture.wall_picture(
            "print_blue", (left, 1.85, -2.65), -90.0, (0.9, 1.2), (92, 124, 140), prints, mat_m=0.1
        ),
        *furniture.wall_picture(
            "print_ochre", (left, 1.85, -4.65), -90.0, (0.9, 1.2), (168, 134, 92), prints, mat_m=0.1
        ),
        *furniture.wall_picture(
            "whiteboard",
            (right, 1.65, -3.9),
            90.0,
            (1.8, 1.1),
            (240, 241, 240),
            frame=(150, 153, 158),
        ),
        *furniture.wall_picture(
            "print_green", (right, 1.7, 0.2), 90.0, (0.7, 0.9), (122, 140, 104), prints, mat_m=0.09
        ),
        *furniture.wall_picture(
            "pinboard",
            (1.6, 1.6, front),
            0.0,
            (1.6, 1.0),
            (186, 146, 104),
            surfaces.carpet(57),
            frame=furniture.WOOD,
        ),
        *furniture.door("door", (-1.6, 0, front), 0.0),
    )
    lamps = [
        lamp
        for x in (-2.4, 0.0, 2.4)
        for z in (-5.2, -2.4, 0.4)
        for lamp in furniture.ceiling_lamp(f"lamp_{x}_{z}", (x, CEILING_M - 0.04, z), (1.2, 0.3))
    ]
    return [
        floor, ceiling, *around, *lamps, *wall_pictures,
        furniture.place_prop("windows", panes, (0, 0, 0), 0.0, surfaces.outside(56),
                             emission_01=0.95, casts_shadow=False),
        furniture.place_prop("window_frames", frames, (0, 0, 0), 0.0, casts_shadow=False),
        furniture.place_prop("blinds", blinds, (0, 0, 0), 0.0, surfaces.slats(8), emission_01=0.25,
                             casts_shadow=False),
        furniture.place_prop("blind_rails", rails, (0, 0, 0), 0.0, casts_shadow=False),
    ]  # fmt: skip


def _desks() -> list[Prop]:
    props: list[Prop] = []
    for clerk in places.CLERKS:
        z = clerk.z_m + places.DESK_BEFORE_M
        props += furniture.desk(
            f"desk_{clerk.name}",
            (clerk.x_m, 0, z),
            180.0,
            front=(226, 226, 222),
            height_m=places.DESK_HEIGHT_M,
        )
        top = places.DESK_HEIGHT_M
        props += furniture.monitor(
            f"monitor_{clerk.name}", (clerk.x_m - 0.52, top, z + 0.05), clerk.yaw_deg - 145.0
        )
        props.append(
            furniture.keyboard(f"keyboard_{clerk.name}", (clerk.x_m - 0.30, top, z - 0.17), 10.0)
        )
        papers = join_meshes(
            box((0.33, top + 0.004, 0.02), (0.21, 0.008, 0.297), (240, 240, 236)),
            box((0.36, top + 0.009, 0.0), (0.21, 0.004, 0.297), (250, 250, 248)),
            cylinder((0.62, top, 0.14), (0.62, top + 0.095, 0.14), 0.04, (158, 70, 58)),
        )
        props.append(furniture.place_prop(f"papers_{clerk.name}", papers, (clerk.x_m, 0, z), 0.0))
        props += furniture.chair(
            f"chair_{clerk.name}",
            clerk.floor_m,
            clerk.yaw_deg,
            seat_m=places.SEAT_M,
            cloth=(58, 62, 70),
        )
    return props


def _between() -> list[Prop]:
    props: list[Prop] = []
    for i, spot in enumerate(places.PLANTS):
        props += furniture.plant(spot.name, spot.floor_m, seed=60 + i, height_m=1.45)
    for i, spot in enumerate(places.SHELVES):
        props += furniture.shelf(spot.name, spot.floor_m, spot.yaw_deg, seed=70 + i, height_m=1.1)
    pillar = join_meshes(
        box((0, CEILING_M / 2, 0), (0.42, CEILING_M, 0.42), (222, 221, 216), chamfer_m=0.02),
        box((0, 0.06, 0), (0.46, 0.12, 0.46), (120, 118, 114)),
    )
    props.append(
        furniture.place_prop(
            "pillar",
            pillar,
            places.PILLAR.floor_m,
            0.0,
            surfaces.plaster(55),
            blocks=(Block((0, 0, 0), 0.23, 0.23, CEILING_M),),
        )
    )
    return props


def _waiting_line() -> list[Prop]:
    """Return the line on the floor behind which customers wait, with posts and a belt."""
    line = box((0, 0.003, -0.45), (5.6, 0.006, 0.07), (222, 180, 60))
    posts = join_meshes(
        *(
            join_meshes(
                cylinder((x, 0, -0.75), (x, 0.025, -0.75), 0.16, furniture.STEEL, sides=24),
                cylinder((x, 0.02, -0.75), (x, 0.95, -0.75), 0.026, furniture.STEEL, sides=14),
            )
            for x in (-3.3, 3.1)
        )
    )
    return [
        furniture.place_prop("waiting_line", line, (0, 0, 0), 0.0, casts_shadow=False),
        furniture.place_prop(
            "posts",
            posts,
            (0, 0, 0),
            0.0,
            roughness_01=0.3,
            blocks=tuple(Block((x, 0, -0.75), 0.16, 0.16, 0.025, round=True) for x in (-3.3, 3.1)),
        ),
    ]
