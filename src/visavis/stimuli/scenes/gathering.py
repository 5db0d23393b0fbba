"""A few people before the participant or about a place, each doing something: places as data.

World frame: the participant's eyes are above the origin and look along −z.
"""

from dataclasses import dataclass

from visavis.stimuli.motion.faces import NEUTRAL, Face
from visavis.stimuli.motion.kinds import Kind
from visavis.stimuli.motion.people import Doing
from visavis.stimuli.scene import Scene


@dataclass(frozen=True)
class Standing:
    """One person: who plays them, the name of their place, (x, z) in metres on the floor, the turn
    about the vertical (0 faces −z, positive to their left), what they do from the onset on, one
    thing or several in turn, and the face that they make.
    """

    character: str
    place: str
    x_m: float
    z_m: float
    yaw_deg: float
    does: Kind | tuple[Doing, ...]
    seed: int = 0
    face: Face = NEUTRAL


@dataclass(frozen=True)
class GatheringScene(Scene):
    """People in a room; `start_ns` is the session time at which they begin.

    `room_by` names what makes the room ("module:function"), a plain one where it is left out.
    """

    people: tuple[Standing, ...] = ()
    start_ns: int = 0
    room_by: str = ""
    dressed_by: str = "visavis.stimuli.dressing.gathering:gathering_picture"
    moved_by: str = "visavis.stimuli.dressing.gathering:heads_of_gathering"
