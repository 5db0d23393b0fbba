"""A corner in which close-ups are taken: a grey backdrop, and lamps before and above the person.

A person stands at the origin and faces +z. Both sides of a face get the same light: where the white
of one eye is brighter than that of the other, a look at the camera seems to go past it.
"""

from functools import lru_cache

import numpy as np

from visavis.lab.geometry import unit
from visavis.stimuli.picture import Light, Room
from visavis.stimuli.rooms import furniture, surfaces
from visavis.stimuli.rooms.solids import flat


@lru_cache(maxsize=1)
def portrait_studio() -> Room:
    """Return the corner; the same object each time."""
    key, rim = np.array([0.0, 2.7, 2.3]), np.array([0.0, 3.0, -1.8])
    face = np.array([0.0, 1.6, 0.0])
    backdrop = flat((-5.0, 0.0, -2.0), (10.0, 0, 0), (0, 5.0, 0), (128, 134, 140), uv_m=3.0)
    return Room(
        name="portrait_studio",
        props=(
            furniture.level("floor", (-5, -2), (5, 5), 0.0, (120, 118, 116), surfaces.carpet(2)),
            furniture.place_prop(
                "backdrop", backdrop, (0, 0, 0), 0.0, surfaces.plaster(4), casts_shadow=False
            ),
        ),
        lights=(
            Light(
                "spot", np.array([6.2, 6.0, 5.7]), key, unit(face - key), 40.0, casts_shadow=True
            ),
            Light(
                "spot", np.array([3.4, 3.5, 3.7]), rim, unit(face - rim), 40.0, casts_shadow=True
            ),
            *(
                Light("point", np.array([0.8, 0.82, 0.85]), np.array([side * 1.9, 1.7, 1.7]))
                for side in (-1, 1)
            ),
        ),
        sky=np.array([0.33, 0.33, 0.34]),
        ground=np.array([0.22, 0.20, 0.18]),
        background_srgb=(110, 114, 118),
    )
