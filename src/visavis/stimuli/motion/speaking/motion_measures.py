"""Measures of a moving speaker beside a corpus: how jerky joints are, how postures are used."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import jensenshannon
from scipy.stats import entropy

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.clip import Motion, placed_joints
from visavis.stimuli.motion.speaking.body_track import RATE_HZ, BodyTrack
from visavis.stimuli.motion.speaking.speaker import NINE, com_class, yaw_class


@dataclass(frozen=True)
class PostureUse:
    """How evenly a speaker is in the nine postures of weight and hips, in bits (0 to 3.17):
    `own_bits` of a motion, `corpus_bits` of a corpus. `apart_bits` is how far both are from each
    other (Jensen–Shannon divergence): 0 where each is there as often, 1 where none is in both.
    """

    own_bits: float
    corpus_bits: float
    apart_bits: float


def posture_use(own: BodyTrack, corpus: tuple[BodyTrack, ...]) -> PostureUse:
    """Return how a motion uses the postures, beside a corpus."""
    shares, usual = posture_shares((own,)), posture_shares(corpus)
    return PostureUse(
        float(entropy(shares, base=2)),
        float(entropy(usual, base=2)),
        float(jensenshannon(shares, usual, base=2)) ** 2,
    )


def posture_shares(tracks: tuple[BodyTrack, ...]) -> Vector:
    """Return the share of frames in each of the postures `NINE`, shape (9,)."""
    rows = [
        NINE.index((com_class(float(com)), yaw_class(float(yaw))))
        for track in tracks
        for com, yaw in zip(track.com, track.yaw, strict=True)
    ]
    shares: Vector = np.bincount(rows, minlength=len(NINE)) / len(rows)
    return shares


def mean_jerk_mps3(motion: Motion, seconds: float) -> float:
    """Return the size of the third derivative of all joints' places, averaged over joints and
    frames at `RATE_HZ`.
    """
    at_m = placed_joints(motion, np.arange(0.0, seconds, 1.0 / RATE_HZ)).position_m
    jerk = np.diff(at_m, n=3, axis=0) * RATE_HZ**3
    return float(np.linalg.norm(jerk, axis=-1).mean())
