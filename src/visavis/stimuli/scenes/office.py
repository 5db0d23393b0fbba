"""The office of the waving study as places: five customers in a line, three clerks at desks.

Ground plane: the customers stand along x at z = 0 and look towards −z; the clerks sit behind
their desks and look towards +z. What stands in between hides parts of the clerks: little on the
left, more on the right (figure 2.7 of the source describes the layout; its measures are not
published, these are ours).

Participants stand at the origin of the tracked room whatever their place in the line, so what is
shown is the office moved by `shift_m`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.warping.track import WarpTrack
from visavis.stimuli.panels import PanelFrame
from visavis.stimuli.scene import Scene


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
"""Where a standing person's eyes usually are, a virtual customer's always."""

BYSTANDERS: Final = (
    Place("bystander_left", 0.76, -2.2, -80.0),
    Place("bystander_middle", 1.98, -2.5, 25.0),
    Place("bystander_right", 2.68, -2.2, 115.0),
)
"""Agents who stand in between and talk, type or telephone."""
PLANTS: Final = (
    Place("plant_1", -1.88, -2.7, 0.0),
    Place("plant_2", -1.48, -3.2, 0.0),
    Place("plant_3", -0.44, -3.4, 0.0),
    Place("plant_4", 0.60, -3.7, 0.0),
    Place("plant_5", 1.00, -3.2, 0.0),
    Place("plant_6", 2.20, -3.6, 0.0),
)
SHELVES: Final = (Place("shelf", 1.40, -3.5, 180.0),)
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
    names = ", ".join(p.name for p in every)
    raise DesignError(f"the office has no place {name!r}; choose one of {names}")


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


def shift_m(participant_place: str) -> Vector:
    """Return what leads (3,) from the office's coordinates to those of the tracked room."""
    return -place(participant_place).floor_m


@dataclass(frozen=True, eq=False)
class Waving:
    """Who waves and how: `clip` has the floor at y = 0, the clerk's place as its origin and −z as
    its front; the body as a whole is turned by `heading_deg`. Times count from the scene's onset.
    `warp` is what is added to the wave, None for nothing.
    """

    clerk: str
    clip: Clip
    heading_deg: float
    start_s: float
    fade_s: float
    warp: WarpTrack | None = None

    @property
    def end_s(self) -> float:
        """When the arm begins to sink; the clip has begun with the arm's rising."""
        return self.start_s - self.fade_s + self.clip.duration_s


@dataclass(frozen=True)
class OfficeScene(Scene):
    """The office from one of the customers' places; nobody waves when `waving` is None.

    `seed` draws what everybody does beside the wave.
    """

    participant_place: str = "place_3"
    waving: Waving | None = None
    seed: int = 0
    dressed_by: str = "visavis.stimuli.dressing.office:office_picture"

    @property
    def waver(self) -> int | None:
        """The index of the agent who waves; None while nobody does."""
        if self.waving is None:
            return None
        return next(i for i, a in enumerate(self.agents) if a.place == self.waving.clerk)


@dataclass(frozen=True, slots=True)
class OfficeFrame(PanelFrame):
    """The office in one frame: people move from `start_ns` on; `panels` may ask something.

    `warp` stands in place of the wave's own where it has been corrected since.
    """

    start_ns: int = 0
    warp: WarpTrack | None = None
