"""A gallery of two partitions and two pillars, in which somebody who walks is often hidden."""

from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import unit
from visavis.stimuli.picture import Block, Light, Prop, Room
from visavis.stimuli.rooms import furniture, surfaces
from visavis.stimuli.rooms.solids import Srgb, box, flat, join_meshes

LOW_M: Final = (-7.0, -5.0)
HIGH_M: Final = (7.0, 5.0)
CEILING_M: Final = 3.4
PARTITIONS_M: Final = ((-4.0, -1.25, 0.4, -0.95), (2.6, -2.5, 2.9, 2.0))
"""West, north, east and south of each (x, z, x, z)."""
PARTITION_HIGH_M: Final = 2.6
PILLARS_M: Final = ((-1.6, 2.3), (5.1, -2.9))
PILLAR_M: Final = 0.5
WALL: Srgb = (226, 222, 214)
FRAME: Srgb = (52, 44, 38)
PICTURES: Final[tuple[tuple[float, float, int, float, Srgb], ...]] = (
    (-5.0, -4.98, 0, 1.4, (150, 72, 58)), (-1.5, -4.98, 0, 2.0, (70, 98, 132)),
    (3.2, -4.98, 0, 1.2, (196, 160, 84)), (-4.2, 4.98, 2, 1.8, (86, 118, 92)),
    (0.6, 4.98, 2, 1.3, (122, 88, 128)), (4.6, 4.98, 2, 1.6, (60, 76, 104)),
    (-6.98, 0.0, 1, 2.2, (168, 108, 66)), (6.98, 1.2, 3, 1.8, (98, 60, 70)),
    (-1.8, -0.94, 0, 1.5, (74, 112, 120)), (-1.8, -1.26, 2, 1.5, (178, 92, 74)),
    (2.59, -0.3, 3, 1.4, (104, 122, 78)), (2.91, -0.3, 1, 1.4, (66, 74, 128)),
)  # fmt: skip
"""Middle (x, z), quarter turns of the way it faces from +z, width, colour."""


@lru_cache(maxsize=1)
def gallery() -> Room:
    """Return the gallery; the same object each time."""
    floor = furniture.level(
        "floor", LOW_M, HIGH_M, 0.0, (168, 142, 112), surfaces.planks(3), uv_m=1.6, roughness_01=0.5
    )
    ceiling = furniture.level(
        "ceiling",
        LOW_M,
        HIGH_M,
        CEILING_M,
        (238, 237, 234),
        surfaces.plaster(5),
        faces_up=False,
        uv_m=2.0,
    )
    around = furniture.walls(
        "gallery",
        (LOW_M[0], 0, LOW_M[1]),
        (HIGH_M[0], CEILING_M, HIGH_M[1]),
        WALL,
        surfaces.plaster(4),
    )
    key = np.array([1.0, CEILING_M - 0.15, 0.8])
    return Room(
        name="gallery",
        props=(floor, ceiling, *around, *_standing(), *_pictures()),
        lights=(
            Light("spot", np.array([9.0, 8.8, 8.4]), key, unit(np.array([-0.2, -1.0, -0.15])),
                  80.0, casts_shadow=True),
            *(
                Light("point", np.array([3.0, 3.0, 2.9]), np.array([x, CEILING_M - 0.6, z]))
                for x, z in ((-4.5, 2.2), (-3.8, -3.2), (4.9, 2.6), (4.6, -3.2))
            ),
        ),
        sky=np.array([0.44, 0.44, 0.44]),
        ground=np.array([0.34, 0.32, 0.29]),
        background_srgb=(110, 112, 114),
    )  # fmt: skip


def _standing() -> list[Prop]:
    partitions = join_meshes(
        *(
            box(
                ((x0 + x1) / 2, PARTITION_HIGH_M / 2, (z0 + z1) / 2),
                (x1 - x0, PARTITION_HIGH_M, z1 - z0),
                (214, 214, 210),
            )
            for x0, z0, x1, z1 in PARTITIONS_M
        )
    )
    pillars = join_meshes(
        *(
            box((x, CEILING_M / 2, z), (PILLAR_M, CEILING_M, PILLAR_M), (198, 194, 186))
            for x, z in PILLARS_M
        )
    )
    return [
        furniture.place_prop(
            "partitions",
            partitions,
            (0, 0, 0),
            0.0,
            surfaces.plaster(6),
            blocks=tuple(
                Block(
                    ((x0 + x1) / 2, 0, (z0 + z1) / 2),
                    (x1 - x0) / 2,
                    (z1 - z0) / 2,
                    PARTITION_HIGH_M,
                )
                for x0, z0, x1, z1 in PARTITIONS_M
            ),
        ),
        furniture.place_prop(
            "pillars",
            pillars,
            (0, 0, 0),
            0.0,
            surfaces.plaster(7),
            blocks=tuple(
                Block((x, 0, z), PILLAR_M / 2, PILLAR_M / 2, CEILING_M) for x, z in PILLARS_M
            ),
        ),
    ]


def _pictures() -> list[Prop]:
    """Return the pictures on the walls: a frame, and a field of colour in two tones."""
    pieces = []
    for x, z, quarter, wide, colour in PICTURES:
        angle = quarter * np.pi / 2
        right = np.array([np.cos(angle), 0.0, -np.sin(angle)])
        front = np.array([np.sin(angle), 0.0, np.cos(angle)])
        tall = 0.75 * wide
        for margin_m, off, tone, part in (
            (0.12, 0.004, FRAME, 1.0),
            (0.0, 0.008, colour, 1.0),
            (0.0, 0.012, _lighter(colour), 0.45),
        ):
            low = np.array([x, 1.55 - (tall + margin_m) / 2, z]) + off * front
            corner = low - (wide + margin_m) / 2 * right
            up = np.array([0.0, part * (tall + margin_m), 0.0])
            pieces.append(
                flat(
                    tuple(corner.tolist()),
                    tuple(((wide + margin_m) * right).tolist()),
                    tuple(up.tolist()),
                    tone,
                )
            )
    return [
        furniture.place_prop("pictures", join_meshes(*pieces), (0, 0, 0), 0.0, casts_shadow=False)
    ]


def _lighter(colour: Srgb) -> Srgb:
    r, g, b = (round(0.55 * c + 0.45 * 235) for c in colour)
    return (r, g, b)
