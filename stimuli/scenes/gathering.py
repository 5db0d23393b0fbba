"""A few people who stand or sit before the participant, each doing something: places as data.

World frame: the participant's eyes are above the origin and look along −z.
"""

from dataclasses import dataclass

from stimuli.motion.kinds import Kind
from stimuli.scene import Scene


@dataclass(frozen=True)
class Standing:
    """One person: who plays them, the name of their place, (x, z) in metres on the floor, the turn
    about the vertical (0 faces −z, positive to their left), and what they do from the onset on.
    """

    character: str
    place: str
    x_m: float
    z_m: float
    yaw_deg: float
    does: Kind
    seed: int = 0


@dataclass(frozen=True)
class GatheringScene(Scene):
    """People in a plain room; `start_ns` is the session time at which they begin."""

    people: tuple[Standing, ...] = ()
    start_ns: int = 0
    dressed_by: str = "stimuli.dressing.gathering:gathering_picture"
