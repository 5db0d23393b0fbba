"""From what could be seen of a wave to an answer: the mind of a simulated participant.

Every cue points somewhere; how well its direction is read depends on how many pixels of it are
seen. The cues together, how well each customer can see the wave, and a leaning towards oneself
make one customer more plausible than another. Technique, direction and addressee reach nothing
here: only `Evidence` does.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.experiments.waving.perception import Evidence
from visavis.lab.geometry import Vector


@dataclass(frozen=True)
class Population:
    """Parameters of all simulated participants, and their SDs between people.

    A cue of n pixels is read with an error of `blur_deg` (`pixels` / n) ^ `sharpness` and
    `looseness_deg` together (per cue: eyes, face, torso, hand), times a factor of the person whose
    logarithm has an SD of `acuity_sd`. `reach_power` weighs how well a customer can see the wave;
    a share below `least_reach_01` counts as that share. `self_bias` is in log odds. `lapse_01` is
    the usual share of waves that were not attended to, in which any place is answered, `lapse_sd`
    the SD of its log odds.
    Realism falls with what is hidden and rises with feeling addressed. Fitted to published values
    by `benchmarks.waving_fit`; it knows neither technique nor direction.
    """

    blur_deg: tuple[float, float, float, float] = (9.67, 0.152, 12.3, 7.29)
    pixels: tuple[float, float, float, float] = (4.0, 600.0, 1800.0, 500.0)
    looseness_deg: tuple[float, float, float, float] = (0.332, 193.0, 6.08, 10.2)
    sharpness: float = 0.877
    reach_power: float = 8.66
    least_reach_01: float = 0.254
    self_bias: float = 0.973
    self_bias_sd: float = 0.12
    acuity_sd: float = 1.03
    lapse_01: float = 0.0034
    lapse_sd: float = 0.197
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
    """One simulated participant; `blur` multiplies every error of reading a cue, `lapse_01` is the
    share of waves not attended to.
    """

    blur: float
    self_bias: float
    lapse_01: float
    realism: float
    speed: float
    age: int
    gender: str


def draw_person(population: Population, rng: np.random.Generator) -> Person:
    """Draw somebody."""
    blur, bias, realism, speed, age = rng.standard_normal(5)
    is_woman, lapse = rng.random() < 3 / 16, rng.standard_normal()
    return Person(
        blur=float(np.exp(population.acuity_sd * blur)),
        self_bias=population.self_bias + population.self_bias_sd * float(bias),
        lapse_01=float(lapse_share(population, lapse)),
        realism=population.realism_mean + population.realism_person_sd * float(realism),
        speed=float(np.exp(0.25 * speed)),
        age=int(np.clip(round(25 + 3 * age), 18, 60)),
        gender="woman" if is_woman else "man",
    )


def lapse_share(population: Population, z: float | Vector) -> float | Vector:
    """Return the share of waves not attended to by a person z SDs from the mean."""
    odds = population.lapse_01 / (1 - population.lapse_01) * np.exp(population.lapse_sd * z)
    share: float | Vector = odds / (1 + odds)
    return share


def noise_deg(pixels: Vector, blur: float | Vector, population: Population) -> Vector:
    """Return the error (..., 4) with which cues of so many pixels (..., 4) are read."""
    visible_px = np.maximum(pixels, 1e-3)
    sharp = np.array(population.blur_deg) * (np.array(population.pixels) / visible_px) ** (
        population.sharpness
    )
    error: Vector = blur * np.hypot(sharp, np.array(population.looseness_deg))
    return error


def worth_of(
    read_deg: Vector, noise: Vector, bearing_deg: Vector, reach_01: Vector, population: Population
) -> Vector:
    """Return how plausible each place is (..., 5), in log odds, from what was read (..., 4)."""
    miss = (read_deg[..., None] - bearing_deg[..., None, :]) / noise[..., None]
    least = population.least_reach_01
    worth: Vector = -0.5 * (miss**2).sum(axis=-2)
    worth = worth + population.reach_power * np.log(np.maximum(reach_01, least))
    return worth


@dataclass(frozen=True, eq=False)
class Judgement:
    """One judgement of a wave: probabilities (5,) of the places, answers, times taken."""

    probability: Vector
    place: int
    realism: int
    who_s: float
    realism_s: float


def judge(
    evidence: Evidence,
    own_place: int,
    person: Person,
    population: Population,
    rng: np.random.Generator,
    *,
    effect: bool = True,
) -> Judgement:
    """Judge one wave; `own_place` is the index of the observer's place.

    Without `effect` nothing of the wave is taken in and nobody leans to their own place, because
    that leaning alone makes answers to waves at oneself right more often.
    """
    q = population
    noise = noise_deg(evidence.pixels, person.blur, q)
    read = evidence.pointing_deg + noise * rng.standard_normal(len(noise))
    worth = worth_of(read, noise, evidence.bearing_deg, evidence.reach_01, q)
    if not effect:
        worth = rng.gumbel(size=len(worth))
    worth[own_place] += effect * person.self_bias
    likely = np.exp(worth - worth.max())
    probability = likely / likely.sum()
    place = int(np.argmax(probability))
    if rng.random() < person.lapse_01:
        place = int(rng.integers(len(probability)))
    doubt = float(-(probability * np.log(probability + 1e-12)).sum() / np.log(len(probability)))
    realism = person.realism + effect * q.realism_of_sight * (evidence.visible_01 - 0.7)
    realism += effect * q.realism_of_contact * (float(probability[own_place]) - 0.4)
    realism += q.realism_noise_sd * float(rng.standard_normal())
    who_s, realism_s = q.answer_s * person.speed * np.exp(q.answer_log_sd * rng.standard_normal(2))
    return Judgement(
        probability,
        place,
        int(np.clip(round(realism), 1, 9)),
        float(who_s + q.doubt_s * doubt),
        float(realism_s),
    )
