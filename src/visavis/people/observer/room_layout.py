"""A laboratory's own room without people as targets of a simulated observer."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg
from visavis.lab.screen import PlacedScreen
from visavis.people.observer import state
from visavis.people.observer.picture_layout import ELSEWHERE_APPEAL, PictureLayout, spots_of
from visavis.stimuli.room_areas import SeenObject
from visavis.stimuli.scene import Scene

AHEAD_DEG: Final = (-30.0, 0.0, 30.0)
UP_DEG: Final = (-15.0, 10.0)
ELSEWHERE_M: Final = 3.0


class RoomLayout(PictureLayout):
    """What is seen of a room from a seat, through a `screen` if there is one. Things attract by the
    root of their share of the mean size; somebody to whom they make no difference looks anywhere.
    """

    def __init__(
        self,
        scene: Scene,
        things: Sequence[SeenObject],
        seat: Vector,
        screen: PlacedScreen | None,
        names: Sequence[str] = (),
    ) -> None:
        self.scene, self.names = scene, tuple(names)
        if screen is not None:
            elsewhere, wide_rad = spots_of(screen)
        else:
            yaw_deg, pitch_deg = np.meshgrid(AHEAD_DEG, UP_DEG)
            towards = direction_from_yaw_pitch_deg(yaw_deg.ravel(), pitch_deg.ravel())
            elsewhere, wide_rad = list(seat + ELSEWHERE_M * towards), float(np.radians(15.0))
        n = len(things)
        size_deg2 = np.array([thing.size_deg2 for thing in things])
        by_size = np.sqrt(size_deg2 / size_deg2.mean()) if n else size_deg2
        rest = np.full(len(elsewhere), ELSEWHERE_APPEAL / len(elsewhere))
        self.appeal = np.concatenate([by_size, rest])
        self.appeal_anywhere = np.concatenate([np.zeros(n), rest])
        offset = np.array([*(thing.place_m for thing in things), *elsewhere]) - seat
        distance = np.linalg.norm(offset, axis=1)
        t = np.zeros(len(offset), dtype=state.TARGET_DTYPE)
        t["kind"], t["agent"], t["lost_ns"] = state.ROOM, -1, -1
        t["direction"], t["distance_m"] = offset / distance[:, None], distance
        t["radius_rad"] = wide_rad
        t["radius_rad"][:n] = [min(thing.radius_rad, wide_rad) for thing in things]
        self.targets = t
        self.agent_eyes = np.zeros((0, 3))
        self.rest = (0.0, 0.0)
