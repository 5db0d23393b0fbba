"""The meshes of a laboratory's own room; its reader is loaded only where there is one."""

from functools import lru_cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Pose, Vector
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stimuli.dressing.picture_of import named_function
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.room_areas import RoomAreas, RoomShape, SeenObject

READER: Final = "visavis.stimuli.dressing.own_room:room_shape"


def shape_of(own_room: PlacedRoom) -> RoomShape:
    """Return the meshes of a room's file.

    Raises:
        DesignError: it cannot be read, has no meshes or too many triangles, or two have one name.
    """
    shape: RoomShape = named_function(READER, "reads a laboratory's room")(own_room)
    return shape


def areas_of_room(room: PlacedRoom) -> RoomAreas:
    """Return the meshes as areas around who looks; DesignError as `shape_of`."""
    return _areas_of(room.as_drawn())


@lru_cache(maxsize=8)
def _areas_of(room: PlacedRoom) -> RoomAreas:
    areas = RoomAreas(shape_of(room), room.room.stand_m, room.room.yaw_deg)
    # What takes long is done when a study is read, not between two frames of its session: kernels
    # are loaded, and the text of the event is kept.
    areas.areas_met(np.zeros((1, 3)), np.array([[0.0, 0.0, -1.0]]))
    _ = areas.shape.event
    return areas


def seen_of_room(own_room: PlacedRoom, eye_m: Vector) -> tuple[SeenObject, ...]:
    """Return what is seen of a room from an eye (3,), through its screen if there is one."""
    screen = own_room.screen
    eye = tuple(eye_m.tolist())
    if screen is None:
        return _seen_of(own_room.as_drawn(), eye, None)
    at, turn = screen.place.position_m, screen.place.orientation_wxyz
    through = screen.flat, tuple(at.tolist()), tuple(turn.tolist())
    return _seen_of(own_room.as_drawn(), eye, through)


_Through = tuple[FlatScreen, tuple[float, ...], tuple[float, ...]]


@lru_cache(maxsize=16)
def _seen_of(
    room: PlacedRoom, eye_m: tuple[float, ...], through: _Through | None
) -> tuple[SeenObject, ...]:
    screen = None
    if through is not None:
        flat, at_m, turn = through
        screen = PlacedScreen(flat, Pose(np.array(at_m), np.array(turn)))
    return tuple(_areas_of(room).seen_from(np.array(eye_m), screen))
