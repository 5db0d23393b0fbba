"""The 27 walks on a person of ours, on the spot, and the plain walk they are seen beside."""

from functools import cache
from typing import Final

import numpy as np

from visavis.experiments.adjectives.raters import impressions_of
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.walk_features import features_of
from visavis.stimuli.motion.synthesis.walk_styles import style_names
from visavis.study.live import Live, walks

RATED: Final = "male_06"
BESIDE: Final = "male_24"
"""The same man in green and in red, as in the source."""
WALKS: Final = tuple(style_names("set_b"))
"""All walks, each an emotion at a speed (`walk_name`)."""
REFERENCE: Final = "neutral_normal"
EYE_M: Final = (1.5, 1.3, -3.6)
"""Where raters see both from at first: from the side of their front, steps and posture show."""


@cache
def figures() -> Live:
    """Return the two figures, who may walk in any of the ways."""
    return Live(walks("set_b", character=RATED), character=RATED, beside=BESIDE, eye_m=EYE_M)


def walk_of(name: str) -> Blend:
    """Return a walk on the spot."""
    examples = figures().examples
    return Blend(examples, np.eye(len(examples))[examples.index(name)], in_place=True)


def walk_name(emotion: str, speed: str) -> str:
    """Return the name of an emotion at a speed."""
    return f"{emotion}_{speed}"


def features_seen(walk: Blend) -> dict[str, float]:
    """Return the features of a walk, as it would lead ahead."""
    return _features(walk.examples, tuple(walk.weights.tolist()))


def impressions_seen(walk: Blend, beside: Blend) -> Vector:
    """Return the four impressions of a walk beside another."""
    return impressions_of(features_seen(walk), features_seen(beside))


@cache
def _features(examples: Examples, weights: tuple[float, ...]) -> dict[str, float]:
    return features_of(Blend(examples, np.array(weights)).sampled())
