"""Who a simulated participant is: body, walking habits and how a felt vibration changes them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector


@dataclass(frozen=True)
class Population:
    """Parameters of all simulated participants; spreads are between people.

    Walking: `free_speed_m_s` in a dense crowd seen in a headset (Berton et al. 2020 report
    0.43 m/s inside it), `turn_slowing` the share of speed lost at a full quarter turn,
    `stride_m` two steps at that speed. Turning: the shoulders turn until body and `margin_m`
    on either side fit the gap (a constant margin: Higuchi 2012; below 1.3 shoulder widths:
    Warren and Whang 1987), at most `turn_limit_deg`. Steering: `wander_m` is how far the body
    strays from its way, over `wander_s`. Routes: cost is length plus `squeeze` for gaps below
    `easy_gap_m`, with log-normal tastes, `taste_person` the same in every trial of a person in
    the same crowd, `taste_trial` new each time. Arms: they hang `spread_rad` from the body and
    swing by `swing_rad`; a person's looseness, one number, makes both larger and steps shorter
    (`loose_*`, log scale), so that some touch many more people than others.

    Vibration: while one is felt, caution grows towards 1 by `caution_per_s` and alarm by
    `alarm_per_s`; they are forgotten over `caution_forgotten_s` and `alarm_forgotten_s`.
    Caution leads from a person's own margin to a learned one, `careful_margin_m`, in which
    people differ less than in their own; it keeps arms closer by the share `caution_tuck` and
    the way truer by the share `caution_wander`. How far arms come in differs by
    `caution_tuck_spread`, with Student's t of `response_tail` degrees of freedom, and is smaller
    in loose people (`loose_response`); below zero the arms come out, as in somebody who gets
    careless. Alarm slows by the share `alarm_slowing`, with a spread on the log scale, and widens
    the margin by `alarm_margin_m`, with a normal spread, so that it narrows it in some. People with
    a wide margin learn a wide one (`careful_with_own`) and are alarmed more (`alarm_with_own`).

    Form: how somebody is just now wanders over about `form_walks` walks, whatever is felt, round
    what they are: pace by `form_pace` and sway by `form_wander` (both log scale), looseness by
    `form_loose`, in spreads between people, and the margin by `form_margin_m`.

    Shoulder width and depth, the limits of turns and the times (`turn_s`, `wander_s`,
    `reading_s`, `reaction_s`, `alarm_*_s`) are assumed; everything else was tuned by hand to
    the published means and spreads, so that surfaces and capsules lie on either side of them,
    on seeds 1, 7, 101 and 102 (see `benchmarks.crowd_participants`).
    """

    free_speed_m_s: float = 0.51
    free_speed_spread: float = 0.18
    turn_slowing: float = 0.25
    narrow_slowing: float = 0.20
    stride_m: float = 0.68
    shoulder_width_m: float = 0.46
    body_depth_m: float = 0.26
    margin_m: float = 0.018
    margin_spread_m: float = 0.036
    turn_limit_deg: float = 78.0
    turn_s: float = 0.28
    wander_m: float = 0.046
    wander_s: float = 1.2
    swing_rad: float = 0.31
    spread_rad: float = 0.38
    loose_swing: float = 0.60
    loose_spread: float = 0.50
    loose_stride: float = 0.29
    tuck: float = 0.15
    tuck_spread: float = 0.10
    squeeze: float = 6.0
    easy_gap_m: float = 0.80
    taste_person: float = 0.30
    taste_trial: float = 0.20
    reading_s: float = 2.2
    reaction_s: float = 0.7
    caution_per_s: float = 0.014
    caution_forgotten_s: float = 3600.0
    alarm_per_s: float = 0.5
    alarm_forgotten_s: float = 12.0
    careful_margin_m: float = 0.066
    careful_margin_spread_m: float = 0.020
    careful_with_own: float = 0.7
    caution_tuck: float = 0.50
    caution_tuck_spread: float = 0.35
    caution_wander: float = 0.62
    alarm_slowing: float = 0.10
    alarm_slowing_spread: float = 0.50
    alarm_margin_m: float = 0.030
    alarm_margin_spread_m: float = 0.060
    alarm_with_own: float = 0.7
    loose_response: float = 0.60
    response_tail: float = 4.0
    form_walks: int = 8
    form_pace: float = 0.095
    form_loose: float = 0.27
    form_margin_m: float = 0.008
    form_wander: float = 0.6


DEFAULT_POPULATION: Final = Population()
MAX_SWING_RAD: Final = 1.0
MAX_SPREAD_RAD: Final = 0.8
"""Arms swing and hang out no farther, however loose."""

(
    FREE_SPEED,
    TURN_SLOWING,
    NARROW_SLOWING,
    STRIDE,
    WIDTH,
    DEPTH,
    MARGIN,
    TURN_LIMIT,
    TURN_S,
    WANDER,
    WANDER_S,
    SWING,
    TUCK,
    STATURE,
    CAUTION_PER_S,
    CAUTION_FORGOTTEN,
    ALARM_PER_S,
    ALARM_FORGOTTEN,
    CAREFUL_MARGIN,
    CAUTION_TUCK,
    CAUTION_WANDER,
    ALARM_SLOWING,
    ALARM_MARGIN,
    SPREAD,
    N_TRAITS,
) = range(25)


@dataclass(frozen=True)
class Person:
    """One simulated participant; `traits` (24,) as the walking kernel reads them."""

    sex: str
    age: int
    stature_m: float
    reading_s: float
    reaction_s: float
    presence: float
    embodiment: Vector
    traits: Vector


def _correlated_normal(z: float, fresh: float, r: float) -> float:
    """Return a standard normal with correlation `r` to `z`."""
    return float(r * z + np.sqrt(1 - r * r) * fresh)


def draw_person(population: Population, rng: np.random.Generator, *, feels: bool) -> Person:
    """Draw a person; without `feels` vibration changes nothing, everything else is the same."""
    q = population
    sex = "woman" if rng.random() < 8 / 23 else "man"
    mean, spread = (1.65, 0.06) if sex == "woman" else (1.78, 0.065)
    stature = float(mean + spread * np.clip(rng.standard_normal(), -2, 2))
    z = np.clip(rng.standard_normal(8), -2, 2)
    loose, shoulders, slowing, stride, alarm = np.clip(rng.standard_normal(5), -2, 2)
    arms = float(np.clip(rng.standard_t(q.response_tail), -3, 3))
    traits = np.zeros(N_TRAITS)
    traits[FREE_SPEED] = q.free_speed_m_s * np.exp(q.free_speed_spread * z[0])
    traits[TURN_SLOWING] = q.turn_slowing
    traits[NARROW_SLOWING] = q.narrow_slowing
    traits[STRIDE] = q.stride_m * stature / 1.75 * np.exp(-q.loose_stride * loose + 0.08 * stride)
    traits[WIDTH] = q.shoulder_width_m * stature / 1.75
    traits[DEPTH] = q.body_depth_m * stature / 1.75
    traits[MARGIN] = q.margin_m + q.margin_spread_m * z[1]
    traits[TURN_LIMIT] = np.radians(q.turn_limit_deg)
    traits[TURN_S] = q.turn_s
    traits[WANDER] = q.wander_m * np.exp(0.15 * z[2])
    traits[WANDER_S] = q.wander_s
    traits[SWING] = min(q.swing_rad * np.exp(q.loose_swing * loose + 0.2 * z[3]), MAX_SWING_RAD)
    traits[TUCK] = float(np.clip(q.tuck + q.tuck_spread * z[4], 0, 1))
    traits[STATURE] = stature
    responsive = float(np.exp(0.3 * z[5]))
    traits[CAUTION_PER_S] = q.caution_per_s * responsive if feels else 0.0
    traits[CAUTION_FORGOTTEN] = q.caution_forgotten_s
    traits[ALARM_PER_S] = q.alarm_per_s * responsive if feels else 0.0
    traits[ALARM_FORGOTTEN] = q.alarm_forgotten_s
    traits[CAREFUL_MARGIN] = q.careful_margin_m + q.careful_margin_spread_m * _correlated_normal(
        z[1], shoulders, q.careful_with_own
    )
    answer = 1.0 + q.caution_tuck_spread * arms - q.loose_response * loose
    traits[CAUTION_TUCK] = min(q.caution_tuck * answer, 1.0 - traits[TUCK])
    traits[CAUTION_WANDER] = q.caution_wander
    traits[ALARM_SLOWING] = q.alarm_slowing * np.exp(q.alarm_slowing_spread * slowing)
    traits[ALARM_MARGIN] = q.alarm_margin_m + q.alarm_margin_spread_m * _correlated_normal(
        z[1], alarm, q.alarm_with_own
    )
    traits[SPREAD] = min(q.spread_rad * np.exp(q.loose_spread * loose), MAX_SPREAD_RAD)
    return Person(
        sex=sex,
        age=int(np.clip(np.rint(26 + 6 * rng.standard_normal()), 18, 43)),
        stature_m=stature,
        reading_s=float(q.reading_s * np.exp(0.25 * z[6])),
        reaction_s=float(q.reaction_s * np.exp(0.25 * z[7])),
        presence=float(5.1 + 0.9 * rng.standard_normal()),
        embodiment=np.array([6.0, 3.6, 5.0]) + np.array([0.7, 1.2, 1.1]) * rng.standard_normal(3),
        traits=traits,
    )


def in_form(person: Person, population: Population, form: Vector) -> Vector:
    """Return the traits (24,) of a walk; `form` (4,), N(0, 1): pace, looseness, margin, sway."""
    q, traits = population, person.traits.copy()
    pace, loose = q.form_pace * form[0], q.form_loose * form[1]
    traits[FREE_SPEED] *= np.exp(pace)
    traits[STRIDE] *= np.exp(-q.loose_stride * loose)
    traits[SWING] = min(traits[SWING] * np.exp(q.loose_swing * loose), MAX_SWING_RAD)
    traits[SPREAD] = min(traits[SPREAD] * np.exp(q.loose_spread * loose), MAX_SPREAD_RAD)
    traits[MARGIN] += q.form_margin_m * form[2]
    traits[CAREFUL_MARGIN] += q.form_margin_m * form[2]
    traits[WANDER] *= np.exp(q.form_wander * form[3])
    return traits
