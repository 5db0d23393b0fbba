"""A plain, evenly lit room for a few people facing the participant, with chairs for sitters."""

from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import unit
from visavis.stimuli.picture import Light, Room
from visavis.stimuli.rooms import furniture, surfaces

LOW_M: Final = (-3.2, -4.6)
HIGH_M: Final = (3.2, 2.6)
CEILING_M: Final = 2.9
CLOTHS: Final = ((74, 88, 112), (96, 84, 92), (82, 98, 88))

Seat = tuple[float, float, float, float]
"""x, z, the sitter's yaw (degrees), height of the seat."""


@lru_cache(maxsize=16)
def plain_room(seats: tuple[Seat, ...] = ()) -> Room:
    """Return the room with its chairs; the same object for the same seats."""
    floor = furniture.level(
        "floor", LOW_M, HIGH_M, 0.0, (142, 134, 124), surfaces.carpet(2), uv_m=0.8,
        roughness_01=0.95,
    )  # fmt: skip
    ceiling = furniture.level(
        "ceiling", LOW_M, HIGH_M, CEILING_M, (232, 231, 228), surfaces.tiles(5, 3, joint=0.88),
        faces_up=False, uv_m=1.8,
    )  # fmt: skip
    around = furniture.walls(
        "room",
        (LOW_M[0], 0, LOW_M[1]),
        (HIGH_M[0], CEILING_M, HIGH_M[1]),
        (206, 203, 194),
        surfaces.plaster(4),
    )
    lamps = [
        lamp
        for x in (-1.4, 1.4)
        for z in (-2.8, -0.4)
        for lamp in furniture.ceiling_lamp(f"lamp_{x}_{z}", (x, CEILING_M - 0.04, z), (0.6, 1.2))
    ]
    chairs = [
        part
        for i, (x, z, yaw_deg, seat_m) in enumerate(seats)
        for part in furniture.chair(
            f"chair_{i}", (x, 0.0, z), yaw_deg, seat_m=seat_m, cloth=CLOTHS[i % len(CLOTHS)]
        )
    ]
    key, face = np.array([1.3, CEILING_M - 0.15, 0.2]), np.array([0.0, 1.1, -1.9])
    return Room(
        name="plain_room",
        props=(floor, ceiling, *around, *lamps, *chairs),
        lights=(
            Light(
                "spot", np.array([9.0, 8.7, 8.2]), key, unit(face - key), 75.0, casts_shadow=True
            ),
            Light("point", np.array([2.7, 2.7, 2.8]), np.array([-1.6, CEILING_M - 0.9, -0.2])),
            Light("point", np.array([0.9, 0.9, 0.9]), np.array([0.2, 1.3, -3.4])),
        ),
        sky=np.array([0.38, 0.38, 0.39]),
        ground=np.array([0.33, 0.30, 0.27]),
        background_srgb=(110, 114, 118),
    )
