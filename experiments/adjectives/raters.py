"""Simulated raters: four impressions of a walk from what is measured of it, and pairs that load on
them. Names of walks play no part. Loadings are planted by us; the source prints no ratings.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.experiments.adjectives.pairs import FACTORS, PAIRS, PRINTED
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.walk_features import features_of
from visavis.stimuli.motion.synthesis.walk_styles import PLAIN, walk_examples

MOST: Final = 2.0
"""The end of the scale, which an impression nears and never reaches."""
REACH: Final = dict(zip(FACTORS, (1.3, 1.7, 2.4, 1.9), strict=True))
"""Impressions at which three quarters of the scale are used: about their spread over the walks."""
PERSON_SD: Final = 0.25
"""How far somebody answers too high or too low throughout."""


@dataclass(frozen=True)
class Loading:
    """How a pair follows its factor: by `gain`, with errors of `sd` steps of the scale."""

    factor: str
    gain: float
    sd: float


def _loadings() -> dict[str, Loading]:
    """Plant a factor for each pair: the source's for its 27 walks, where it kept the pair."""
    loadings = {}
    factors = {pair: factor for factor, pairs in PRINTED["B"].items() for pair in pairs}
    for k, pair in enumerate(PAIRS):
        # Pairs of one factor differ a little in how strongly they follow it.
        if pair in factors:
            loadings[pair] = Loading(factors[pair], 0.86 + 0.04 * (k % 5), 0.62)
        elif k % 2:
            loadings[pair] = Loading(FACTORS[k % 4], 0.2, 0.62)  # too weak to be kept
        else:
            loadings[pair] = Loading(FACTORS[k % 4], 0.80, 1.15)  # raters do not agree on it
    return loadings


LOADINGS: Final = _loadings()


def impressions_of(features: Mapping[str, float], reference: Mapping[str, float]) -> Vector:
    """Return the four impressions (`FACTORS`) of a walk beside a reference, within ±`MOST`.

    Quickness is pace and speed; clearness an upright trunk and head; activeness the swing of arms
    and the rise and fall of the body; largeness the room that arms and feet take.
    """

    def more(*names: str) -> float:
        """Return how much greater features are than the reference's, on average."""
        return float(np.mean([features[n] - reference[n] for n in names]))

    def times(name: str) -> float:
        """Return how much greater a feature is, in doublings."""
        return float(np.log2(max(features[name], 1e-3) / max(reference[name], 1e-3)))

    arms = ("left_upper_arm", "right_upper_arm")
    raw = {
        "quickness": -2.6 * times("duration") + 1.0 * times("mean_com_speed_fb"),
        "clearness": -more("mean_torso_fb") / 12.0 - more("mean_head_fb") / 22.0,
        "activeness": more(*(f"sd_{arm}_fb" for arm in arms)) / 7.0
        + more("sd_com_up") / 0.012
        + more("mean_left_forearm_fb", "mean_right_forearm_fb") / 60.0,
        "largeness": more(*(f"mean_{arm}_lr" for arm in arms)) / 4.0
        + more("step_length_lr") / 0.15
        + more("sd_torso_lr") / 4.0,
    }
    return np.array([MOST * np.tanh(raw[name] / REACH[name]) for name in FACTORS])


def mean_rating(pair: str, impressions: Vector) -> float:
    """Return what a pair is rated on average, before anybody's errors."""
    loading = LOADINGS[pair]
    return loading.gain * float(impressions[FACTORS.index(loading.factor)])


def expected_impressions(examples: Examples) -> Vector:
    """Return the four impressions (n, 4) of examples beside a plain walk, from 0 to 1.

    They are what simulated raters feel, and stand in for ratings until people have given some.
    """
    plain = walk_examples(dict.fromkeys(("plain", "again", "more"), PLAIN))
    reference = features_of(plain.clip(0))
    rows = [impressions_of(features_of(examples.clip(i)), reference) for i in range(len(examples))]
    scaled: Vector = (np.array(rows) + MOST) / (2.0 * MOST)
    return scaled


def drawn_ratings(means: Vector, raters: int, rng: np.random.Generator) -> Vector:
    """Return answers (raters, pairs, walks) as simulated raters give them; `means` (pairs, walks)
    are those of many raters.
    """
    sd = np.array([LOADINGS[pair].sd for pair in PAIRS])[:, None]
    people = [
        means + PERSON_SD * rng.standard_normal() + sd * rng.standard_normal(means.shape)
        for _ in range(raters)
    ]
    ratings: Vector = np.clip(np.round(np.array(people)), -MOST, MOST)
    return ratings
