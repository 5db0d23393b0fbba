"""The office of the waving study as places: five customers in a line, three clerks at desks.

Ground plane: the customers stand along x at z = 0 and look towards −z; the clerks sit behind
their desks and look towards +z. What stands in between hides parts of the clerks: little on the
left, more on the right (figure 2.7 of the source describes the layout; its measures are not
published, these are ours).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from lab.errors import DesignError
from lab.geometry import Vector


@dataclass(frozen=True)
class Place:
    """Where somebody or something stands: (x, z) in metres and the turn about the vertical.

    With a yaw of 0 it faces −z; positive turns it to its left.
    """

    name: str
    x_m: float
    z_m: float
    yaw_deg: float

    @property
    def floor_m(self) -> Vector:
        """The point (3,) on the floor."""
        return np.array([self.x_m, 0.0, self.z_m])


CUSTOMERS: Final = (
    Place("place_1", -2.3, 0.10, 0.0),
    Place("place_2", -1.15, 0.0, 0.0),
    Place("place_3", 0.0, 0.0, 0.0),
    Place("place_4", 1.15, 0.0, 0.0),
    Place("place_5", 2.3, 0.10, 0.0),
)
"""From the participant's left to right."""
PARTICIPANT_PLACES: Final = ("place_2", "place_3", "place_4")
CLERKS: Final = (
    Place("clerk_left", -2.5, -5.0, 180.0),
    Place("clerk_middle", 0.0, -5.2, 180.0),
    Place("clerk_right", 2.5, -5.0, 180.0),
)
DESK_BEFORE_M: Final = 0.52
"""How far the middle of a desk is before its clerk's hips."""
SEAT_M: Final = 0.46
DESK_HEIGHT_M: Final = 0.73
STANDING_EYE_M: Final = 1.62
"""Where a customer's eyes are supposed when a clerk aims at the place of a virtual one."""

BYSTANDERS: Final = (
    Place("bystander_left", -2.55, -2.45, -70.0),
    Place("bystander_middle", 0.62, -2.75, 25.0),
    Place("bystander_right", 1.72, -2.15, 115.0),
)
"""Agents who stand in between and talk or telephone."""
PLANTS: Final = (Place("plant_middle", -0.72, -3.35, 0.0), Place("plant_right", 2.62, -2.95, 0.0))
SHELVES: Final = (Place("shelf_right", 1.45, -3.45, 180.0),)
PILLAR: Final = Place("pillar", 3.55, -1.9, 0.0)
ROOM_LOW_M: Final = (-4.6, -7.2)
ROOM_HIGH_M: Final = (4.6, 2.4)


def place(name: str) -> Place:
    """Return a place by name.

    Raises:
        DesignError: the office has no such place.
    """
    every = (*CUSTOMERS, *CLERKS, *BYSTANDERS, *PLANTS, *SHELVES, PILLAR)
    for candidate in every:
        if candidate.name == name:
            return candidate
    known = ", ".join(p.name for p in every)
    raise DesignError(f"the office has no place {name!r}; choose one of {known}")


def neighbour(participant_place: str, direction: str) -> Place:
    """Return who is waved at: the participant ("self"), or the customer to the left or right.

    Raises:
        DesignError: the participant stands at no middle place, or the direction is unknown.
    """
    steps = {"left": -1, "self": 0, "right": 1}
    if participant_place not in PARTICIPANT_PLACES or direction not in steps:
        raise DesignError(
            f"nobody is waved at from {participant_place!r} towards {direction!r}; use one of "
            f"{', '.join(PARTICIPANT_PLACES)} and left, self or right"
        )
    index = [p.name for p in CUSTOMERS].index(participant_place)
    return CUSTOMERS[index + steps[direction]]
