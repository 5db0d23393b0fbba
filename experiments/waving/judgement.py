"""From what could be seen of a wave to an answer: the mind of a simulated participant.

Every cue points somewhere; how well its direction is read depends on how many pixels of it are
seen. The cues together, how well each customer can see the wave, and a leaning towards oneself
make one customer more plausible than another. Technique, direction and addressee reach nothing
here: only `Evidence` does.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from experiments.waving.perception import Evidence
from lab.geometry import Vector


@dataclass(frozen=True)
class Population:
    """What simulated participants have in common and how they differ (SD between people).

    A cue of n pixels is read with an error of `blur_deg` (`pixels` / n) ^ `sharpness` and
    `looseness_deg` together (per cue: eyes, face, torso, hand). `reach_power` is how much it
    counts that a customer can see the wave, of whom sees less than `least_reach_01` as much as of
    who sees just that; `self_bias` is in log odds, `skill_sd` of log error.
    Realism falls with what is hidden and rises with feeling addressed. Fitted to the published
    means by `benchmarks.waving_participants`; it knows neither technique nor direction.
    """

    blur_deg: tuple[float, float, float, float] = (6.8, 2.1, 29.0, 4.1)
    pixels: tuple[float, float, float, float] = (4.0, 600.0, 1800.0, 500.0)
    looseness_deg: tuple[float, float, float, float] = (1.1, 0.89, 79.0, 24.0)
    sharpness: float = 1.8
    reach_power: float = 5.6
    least_reach_01: float = 0.61
    self_bias: float = 1.0
    self_bias_sd: float = 0.12
    skill_sd: float = 0.55
    lapse_01: float = 0.02
    realism_mean: float = 6.0
    realism_person_sd: float = 1.1
    realism_noise_sd: float = 1.2
    realism_of_sight: float = 0.8
    realism_of_contact: float = 0.5
    answer_s: float = 1.1
    answer_log_sd: float = 0.35
    doubt_s: float = 1.4


DEFAULT_POPULATION: Final = Population()


@dataclass(frozen=True)
class Person:
    """One simulated participant; `blur` multiplies every error of reading a cue."""

    blur: float
    self_bias: float
    realism: float
    speed: float
    age: int
    gender: str


def draw_person(population: Population, rng: np.random.Generator) -> Person:
    """Draw somebody."""
    return Person(
        blur=float(np.exp(population.skill_sd * rng.standard_normal())),
        self_bias=population.self_bias + population.self_bias_sd * float(rng.standard_normal()),
        realism=population.realism_mean
        + population.realism_person_sd * float(rng.standard_normal()),
        speed=float(np.exp(0.25 * rng.standard_normal())),
        age=int(np.clip(round(25 + 3 * rng.standard_normal()), 18, 60)),
        gender="woman" if rng.random() < 3 / 16 else "man",
    )


@dataclass(frozen=True, eq=False)
class Judgement:
    """What somebody makes of a wave: probabilities (5,) of the places, answers, times taken."""

    probability: Vector
    place: int
    realism: int
    who_s: float
    realism_s: float


def judge(
    evidence: Evidence, own_place: int, person: Person, population: Population,
    rng: np.random.Generator, *, effect: bool = True,
) -> Judgement:  # fmt: skip
    """Judge one wave; `own_place` is the index of the observer's place.

    Without `effect` nothing of the wave is taken in: answers follow leanings alone.
    """
    q = population
    seen = np.maximum(evidence.pixels, 1e-3)
    blur = person.blur * np.array(q.blur_deg) * (np.array(q.pixels) / seen) ** q.sharpness
    loose = np.array(q.looseness_deg)
    noise = np.hypot(blur, loose)
    read = evidence.pointing_deg + noise * rng.standard_normal(len(noise))
    miss = (read[:, None] - evidence.bearing_deg) / noise[:, None]
    worth = -0.5 * (miss**2).sum(axis=0)
    worth += q.reach_power * np.log(np.maximum(evidence.reach_01, q.least_reach_01))
    if not effect:
        worth = rng.gumbel(size=len(worth))
    worth[own_place] += person.self_bias
    likely = np.exp(worth - worth.max())
    probability = likely / likely.sum()
    place = int(np.argmax(probability))
    if rng.random() < q.lapse_01:
        place = int(rng.integers(len(probability)))
    doubt = float(-(probability * np.log(probability + 1e-12)).sum() / np.log(len(probability)))
    felt = person.realism + effect * q.realism_of_sight * (evidence.visible_01 - 0.7)
    felt += effect * q.realism_of_contact * (float(probability[own_place]) - 0.4)
    felt += q.realism_noise_sd * float(rng.standard_normal())
    who_s, realism_s = q.answer_s * person.speed * np.exp(q.answer_log_sd * rng.standard_normal(2))
    return Judgement(
        probability,
        place,
        int(np.clip(round(felt), 1, 9)),
        float(who_s + q.doubt_s * doubt),
        float(realism_s),
    )
