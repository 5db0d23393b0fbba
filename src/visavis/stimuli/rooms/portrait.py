"""A corner in which close-ups are taken: a grey backdrop, and lamps before and above the person.

A person stands at the origin and faces +z. Both sides of a face get the same light: where the white
of one eye is brighter than that of the other, a look at the camera seems to go past it.
"""

from functools import lru_cache
from typing import Final, Literal

import numpy as np

from visavis.lab.geometry import unit
from visavis.stimuli.picture import Light, Room
from visavis.stimuli.rooms import furniture, surfaces
from visavis.stimuli.rooms.solids import flat

LightOf = Literal["day", "evening"]
BY_LAMP: Final = np.array([0.62, 0.40, 0.20])
"""Light of the evening beside that of the day: a lamp of some 2700 K."""
IN_THE_DARK: Final = np.array([0.22, 0.20, 0.24])
"""What is left of the light all round."""


@lru_cache(maxsize=2)
def portrait_studio(light: LightOf = "day") -> Room:
    """Return the corner by day or by a lamp in the evening; the same object each time."""
    lamps, around = (np.ones(3), np.ones(3)) if light == "day" else (BY_LAMP, IN_THE_DARK)
    key, rim = np.array([0.0, 2.7, 2.3]), np.array([0.0, 3.0, -1.8])
    face = np.array([0.0, 1.6, 0.0])
    backdrop = flat((-5.0, 0.0, -2.0), (10.0, 0, 0), (0, 5.0, 0), (128, 134, 140), uv_m=3.0)
    return Room(
        name="portrait_studio" if light == "day" else f"portrait_studio_{light}",
        props=(
            furniture.level("floor", (-5, -2), (5, 5), 0.0, (120, 118, 116), surfaces.carpet(2)),
            furniture.place_prop(
                "backdrop", backdrop, (0, 0, 0), 0.0, surfaces.plaster(4), casts_shadow=False
            ),
        ),
        lights=(
            Light("spot", lamps * [6.2, 6.0, 5.7], key, unit(face - key), 40.0, casts_shadow=True),
            Light("spot", around * [3.4, 3.5, 3.7], rim, unit(face - rim), 40.0, casts_shadow=True),
            *(
                Light("point", around * [0.8, 0.82, 0.85], np.array([side * 1.9, 1.7, 1.7]))
                for side in (-1, 1)
            ),
        ),
        sky=around * [0.33, 0.33, 0.34],
        ground=around * [0.22, 0.20, 0.18],
        background_srgb=(110, 114, 118),
    )
