"""What is moulded: 27 walks, three interfaces to their weights, and the targets to match.

Every slider goes from 0 to 1 and begins in the middle. Adjectives and features are the four primary
parameters of the source's two kinds; weights are those of the walks themselves.
"""

from functools import cache
from typing import Final

import numpy as np

from visavis.experiments.adjectives.pairs import FACTORS
from visavis.experiments.adjectives.raters import expected_impressions
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.synthesis.pose_distance import POSES, Likeness, compared_joints
from visavis.stimuli.motion.synthesis.walk_features import GROUPS, feature_table
from visavis.stimuli.motion.synthesis.walk_styles import style_names
from visavis.study.live import Live, Near, walks

INTERFACES: Final = ("weights", "adjectives", "features")
"""In the order in which the source has them adjusted."""
OWN: Final = "male_60"
TARGET: Final = "male_06"
"""The same man in blue, moulded, and in green, the target, as in the source."""
EYE_M: Final = (1.5, 1.3, -3.6)
MIDDLE: Final = 0.5
PLACES: Final[dict[str, tuple[float, float, float, float]]] = {
    "one": (0.79, 0.01, 0.22, 0.28),
    "two": (0.01, 0.05, 0.06, 0.07),
    "three": (0.85, 0.03, 0.59, 0.90),
    "four": (0.86, 0.11, 0.27, 0.46),
    "five": (0.23, 0.06, 0.12, 0.45),
    "practice_weights": (0.66, 0.04, 0.18, 0.06),
    "practice_adjectives": (0.96, 0.04, 0.25, 0.36),
    "practice_features": (0.08, 0.07, 0.25, 0.39),
}
"""Quickness, clearness, activeness and largeness of the targets; `chosen_places` chose them."""
TARGETS: Final = tuple(name for name in PLACES if not name.startswith("practice"))
CANDIDATES: Final = 4000
AWAY_M: Final = 0.065
"""A target is farther than a match from where each interface begins."""


@cache
def live_of(interface: str) -> Live:
    """Return the figure of an interface: the man in blue, the target beside him."""
    examples = walks("set_b", character=OWN)
    points: Vector | None = None
    if interface == "adjectives":
        points = expected_impressions(examples)
    elif interface == "features":
        points = feature_table(examples).primary
    at = None if points is None else dict(zip(examples.names, points, strict=True))
    return Live(examples, at=at, character=OWN, beside=TARGET, eye_m=EYE_M)


@cache
def slider_names(interface: str) -> tuple[str, ...]:
    """Return the names of an interface's sliders."""
    if interface == "adjectives":
        return FACTORS
    return tuple(GROUPS) if interface == "features" else tuple(style_names("set_b"))


@cache
def target_shares(target: str) -> Vector:
    """Return the weights (27,) of a target."""
    return live_of("adjectives").shares(PLACES[target])


def near(target: str, within_m: float) -> Near:
    """Return when a figure is near enough to a target."""
    names = live_of("adjectives").examples.names
    return Near(dict(zip(names, target_shares(target).tolist(), strict=True)), within_m)


def chosen_places(count: int = len(PLACES)) -> Vector:
    """Return so many targets (count, 4): random adjectives, far from the beginnings and each other.

    Of `CANDIDATES` points those count that are `AWAY_M` from where every interface begins. The
    first is the farthest from there, each further one the farthest from those before it.
    """
    points = np.round(np.random.default_rng(3).uniform(size=(CANDIDATES, 4)), 2)
    examples = live_of("adjectives").examples
    joints = compared_joints(examples.skeleton)
    starts = [live_of(i).shares(np.full(live_of(i).slider_count, MIDDLE)) for i in INTERFACES]
    shares = live_of("adjectives").shares(points)

    def from_all(own: Vector) -> Vector:
        """Return how far all candidates are from a blend."""
        likeness = Likeness(examples, own, POSES, joints)
        return np.array([likeness.rough_m(row) for row in shares])

    away = np.min([from_all(own) for own in starts], axis=0)
    chosen: list[int] = []
    apart = np.where(away > AWAY_M, away, -np.inf)
    for _ in range(count):
        chosen.append(int(np.argmax(apart)))
        others = np.min([from_all(shares[k]) for k in chosen], axis=0)
        apart = np.where(away > AWAY_M, others, -np.inf)
    return points[chosen]
