"""The 27 walks on a person of ours, on the spot, and the plain walk they are seen beside."""

from functools import cache
from typing import Final

import numpy as np

from visavis.experiments.adjectives.raters import impressions_of
from visavis.lab.geometry import Vector
from visavis.stimuli.dressing.casting import build_of, default_casting
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.walk_features import features_of
from visavis.stimuli.motion.synthesis.walk_styles import style_names, walk_examples

RATED: Final = "male_06"
BESIDE: Final = "male_24"
"""The same man in green and in red, as in the source."""
WALKS: Final = tuple(style_names("set_b"))
"""All walks, each an emotion at a speed (`walk_name`)."""
REFERENCE: Final = "neutral_normal"


@cache
def _examples(character: str) -> Examples:
    return walk_examples(style_names("set_b"), build_of(default_casting(character)))


@cache
def walk_of(name: str, character: str) -> Blend:
    """Return a walk on the spot, on somebody's skeleton."""
    examples = _examples(character)
    weights = np.eye(len(examples))[examples.index(name)]
    return Blend(examples, weights, in_place=True)


def walk_name(emotion: str, speed: str) -> str:
    """Return the name of an emotion at a speed."""
    return f"{emotion}_{speed}"


def round_s(name: str) -> float:
    """Return how long a cycle of a walk takes."""
    return walk_of(name, RATED).cycle_s


@cache
def features_seen(walk: Blend) -> dict[str, float]:
    """Return the features of a walk, as it would lead ahead."""
    return features_of(Blend(walk.examples, walk.weights).sampled())


@cache
def impressions_seen(walk: Blend, beside: Blend) -> Vector:
    """Return the four impressions of a walk beside another."""
    return impressions_of(features_seen(walk), features_seen(beside))
