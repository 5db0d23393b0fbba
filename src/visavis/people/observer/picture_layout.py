"""A picture with areas of interest as targets of a simulated observer."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.people.observer import state
from visavis.stimuli.areas import PlacedAreas
from visavis.stimuli.scene import Scene

ELSEWHERE: Final = (0.2, 0.5, 0.8)
"""Places across and down a picture where people look for no reason that is known."""
ELSEWHERE_APPEAL: Final = 0.5
"""Attraction of all of them together; that of an area of average size is 1."""


class PictureLayout:
    """The areas of a picture seen from a seat, each with its appeal: the salience that its study
    gives, or else the root of its share of the mean size. Somebody to whom areas make no difference
    looks all over the picture.
    """

    def __init__(self, scene: Scene, sheets: Sequence[PlacedAreas], seat: Vector) -> None:
        self.scene = scene
        points, sizes, saliences = [], [], []
        for one in sheets:
            wide, high = one.degrees_px(seat)
            for area in one.areas:
                points.append(one.place_m(*area.middle()))
                sizes.append(area.size_px2() * wide * high)
                saliences.append(area.salience)
        size_deg2 = np.array(sizes)
        by_size = np.sqrt(size_deg2 / size_deg2.mean())
        appeals = [s if s is not None else by_size[i] for i, s in enumerate(saliences)]
        back = max(sheets, key=lambda one: one.size_m[0] * one.size_m[1])
        width, height = back.size_px
        elsewhere = [back.place_m(x * width, y * height) for x in ELSEWHERE for y in ELSEWHERE]
        rest = np.full(len(elsewhere), ELSEWHERE_APPEAL / len(elsewhere))
        self.appeal = np.concatenate([appeals, rest])
        self.appeal_anywhere = np.concatenate([np.zeros(len(points)), rest])
        offset = np.array([*points, *elsewhere]) - seat
        distance = np.linalg.norm(offset, axis=1)
        t = np.zeros(len(offset), dtype=state.TARGET_DTYPE)
        t["kind"], t["agent"], t["lost_ns"] = state.ROOM, -1, -1
        t["direction"], t["distance_m"] = offset / distance[:, None], distance
        t["radius_rad"] = np.radians(back.degrees_px(seat)[0] * width / 3)
        t["radius_rad"][: len(points)] = np.radians(np.sqrt(size_deg2 / np.pi))
        self.targets = t
        self.agent_eyes = np.zeros((0, 3))
        ahead = offset[: len(points)].mean(axis=0)
        self.rest = (float(np.arctan2(-ahead[0], -ahead[2])), 0.0)
