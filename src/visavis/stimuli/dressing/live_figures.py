"""Live figures as a picture."""

from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.picture import Picture, Room
from visavis.stimuli.rooms.plain import HIGH_M, plain_room
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.live_figures import LiveFigures

FRONT_M: Final = 0.1
"""What is so near to the front wall is of it."""


@lru_cache(maxsize=16)
def _cast(characters: tuple[str, ...]) -> tuple[Character, ...]:
    return tuple(default_casting(name) for name in characters)


@lru_cache(maxsize=16)
def _room(at_m: tuple[float, float, float]) -> Room:
    """Return the plain room, moved, its front wall staying behind whoever looks."""
    room, by = plain_room(), np.array(at_m)
    x, y, z = at_m

    def moved(vertices_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        places: npt.NDArray[np.float32] = (vertices_m + by).astype(np.float32)
        is_front = vertices_m[:, 2] > HIGH_M[1] - FRONT_M
        places[is_front, 2] = vertices_m[is_front, 2]
        return places

    props = tuple(
        replace(
            prop,
            mesh=replace(prop.mesh, vertices_m=moved(prop.mesh.vertices_m)),
            blocks=tuple(
                replace(
                    block,
                    at_m=(block.at_m[0] + x, block.at_m[1] + y, block.at_m[2] + z),
                    floor_m=block.floor_m + y,
                )
                for block in prop.blocks
            ),
        )
        for prop in room.props
    )
    lights = tuple(
        lamp if lamp.position_m is None else replace(lamp, position_m=lamp.position_m + by)
        for lamp in room.lights
    )
    return replace(room, props=props, lights=lights)


def live_figures_picture(frame: SceneFrame) -> Picture:
    """Return what a frame of live figures looks like.

    Raises:
        DataError: the frame does not say how they stand.
    """
    scene = frame.scene
    if not isinstance(scene, LiveFigures) or frame.people is None:
        raise DataError(f"{scene.name}: a frame of live figures does not say how they stand")
    return Picture(
        t_ns=frame.t_ns,
        room=_room(scene.room_at_m),
        cast=_cast(scene.characters),
        people=frame.people,
        brightness_01=scene.brightness_01,
        mark_m=scene.mark_m,
    )
