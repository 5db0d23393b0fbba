"""The meshes of a laboratory's own room; its reader is loaded only where there is one."""

from typing import Final

from visavis.stimuli.dressing.picture_of import named_function
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.room_areas import RoomAreas, RoomShape

READER: Final = "visavis.stimuli.dressing.own_room:room_shape"


def shape_of(placed: PlacedRoom) -> RoomShape:
    """Return the meshes of a room's file.

    Raises:
        DesignError: it cannot be read, has no meshes or too many triangles, or two have one name.
    """
    shape: RoomShape = named_function(READER, "reads a laboratory's room")(placed.as_drawn())
    return shape


def areas_of_room(placed: PlacedRoom) -> RoomAreas:
    """Return the meshes as areas around who looks; DesignError as `shape_of`."""
    return RoomAreas(shape_of(placed), placed.room.stand_m, placed.room.yaw_deg)
