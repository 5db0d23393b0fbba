"""Three walks through a gallery, each with something that is done on the way."""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.motion.kinds import Crouch, Idle, Kind, Talk, Walk, Wave, gait_duration_s
from visavis.stimuli.motion.people import Doing
from visavis.stimuli.scenes.gathering import Standing

WALKER: Final = "female_02"
ROOM: Final = "visavis.stimuli.rooms.gallery:gallery"
SPEED_MPS: Final = 1.25
DOES_S: Final = 3.4
"""How long somebody stays with what they do on the way."""
FADE_S: Final = 0.7
ENDS_S: Final = 0.8
"""How long they stand at the end."""
SEED: Final = 7

Point = tuple[float, float]


@dataclass(frozen=True)
class Way:
    """Points (x, z) of a walk, and what is done at one of them facing a heading (0 is −z)."""

    points_m: tuple[Point, ...]
    at: int
    does: Kind
    heading_deg: float


WALKS: Final = {
    "round": Way(((-3.4, 3.6), (1.5, 3.4), (1.6, -3.2), (-1.5, -3.3)), 2, Crouch(0.9), 60.0),
    "behind": Way(((5.9, 4.0), (4.4, 0.4), (4.1, -3.7), (-0.8, -3.2)), 1, Wave("right"), 189.0),
    "between": Way(((-5.8, -3.8), (-5.4, 0.9), (-0.4, 0.9), (1.5, 3.8)), 2, Talk(1.2), -82.0),
}
BYSTANDERS: Final = (
    Standing("male_01", "bystander_1", 0.75, 0.75, 100.0, Idle(), 11),
    Standing("female_04", "bystander_2", 4.9, 3.6, 170.0, Idle(), 12),
    Standing("male_03", "bystander_3", -2.6, -4.1, 15.0, Idle(), 13),
)


@dataclass(frozen=True)
class TimedWalk:
    """A walk in time: what its walker does, when the thing on the way begins, and its length."""

    plan: tuple[Doing, ...]
    does_s: float
    seconds: float


@cache
def timed_walk(name: str) -> TimedWalk:
    """Return a walk in time."""
    way, leg_m = WALKS[name], build_of(default_casting(WALKER)).skeleton.leg_m
    t_s, does_s = 0.0, 0.0
    plan: list[Doing] = []
    for k, (a, b) in enumerate(zip(way.points_m, way.points_m[1:], strict=False)):
        to = np.subtract(b, a)
        heading = float(np.degrees(np.arctan2(-to[0], -to[1])))
        gait = Walk(SPEED_MPS, float(np.hypot(*to)))
        place = (a[0], 0.0, a[1])
        plan.append(
            Doing(gait, t_s, FADE_S, place, heading)
            if plan
            else Doing(gait, place_m=place, heading_deg=heading)
        )
        t_s += gait_duration_s(gait, leg_m)
        if k + 1 == way.at:
            does_s = t_s
            plan.append(Doing(way.does, t_s, FADE_S, (b[0], 0.0, b[1]), way.heading_deg))
            t_s += DOES_S
    end = way.points_m[-1]
    plan.append(Doing(Idle("hanging"), t_s, FADE_S, (end[0], 0.0, end[1])))
    return TimedWalk(tuple(plan), does_s, round(t_s + ENDS_S, 1))


@cache
def everybody(name: str) -> tuple[Standing, ...]:
    """Return who is in the gallery on a walk; the walker comes first."""
    (x, z), *_ = WALKS[name].points_m
    return (Standing(WALKER, "walker", x, z, 0.0, timed_walk(name).plan, SEED), *BYSTANDERS)
