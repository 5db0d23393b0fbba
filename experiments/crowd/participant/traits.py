"""Who a simulated participant is: body, walking habits and how a felt vibration changes them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector
from visavis.people.observer.temperament import correlated_normal


@dataclass(frozen=True)
class Walking:
    """How people walk where nothing is felt."""

    free_speed_m_s: float = 0.475
    """Speed in a dense crowd seen in a headset, in m/s (Berton et al. 2020 report 0.43 inside
    it)."""
    free_speed_spread: float = 0.18
    """Its spread between people (log scale)."""
    turn_slowing: float = 0.18
    """Share of speed lost at a full quarter turn."""
    narrow_slowing: float = 0.20
    """Share of speed lost where it is narrow."""
    stride_m: float = 0.43
    """Length of two steps at that speed: short, as those of people who feel their way."""
    shoulder_width_m: float = 0.49
    """Width of the shoulders, with the arms beside them, of somebody 1.75 m tall."""
    body_depth_m: float = 0.26
    """Depth of the same body; assumed."""
    margin_m: float = 0.010
    """Free space on either side for which the shoulders turn (a constant margin: Higuchi 2012;
    below 1.3 shoulder widths: Warren and Whang 1987)."""
    margin_spread_m: float = 0.036
    """Its spread between people."""
    turn_limit_deg: float = 78.0
    """How far the shoulders turn at most; assumed."""
    turn_s: float = 0.15
    """Time constant of a turn."""
    wander_m: float = 0.03
    """How far the body strays from its way."""
    wander_s: float = 1.2
    """Time constant of that, in seconds; assumed."""
    clear_m: float = 0.01
    """What they leave free beside the trunk where they stray; assumed."""
    reading_s: float = 2.2
    """How long reading the board takes; assumed."""
    reaction_s: float = 0.7
    """How long people take to start; assumed."""


@dataclass(frozen=True)
class Routes:
    """Which way people take: cost is length plus `squeeze` for narrow gaps."""

    squeeze: float = 15.0
    """Cost of gaps below `easy_gap_m`."""
    easy_gap_m: float = 0.80
    """Width from which a gap costs nothing."""
    taste_person: float = 0.30
    """Log-normal taste, the same in every trial of a person in the same crowd."""
    taste_trial: float = 0.20
    """Log-normal taste, new in every trial."""


@dataclass(frozen=True)
class Arms:
    """How arms hang and swing. A person's looseness, one number, makes both larger and steps
    shorter, so that some touch many more people than others.
    """

    swing_rad: float = 0.25
    """How far arms swing."""
    spread_rad: float = 0.38
    """How far they hang from the body."""
    loose_swing: float = 0.36
    """Effect of looseness on the swing (log scale)."""
    loose_spread: float = 0.38
    """Effect of looseness on the spread (log scale)."""
    loose_stride: float = 0.18
    """Effect of looseness on the stride (log scale)."""
    tuck: float = 0.7
    """Share by which arms are kept closer where it is narrowest; none where 0.9 m are free."""
    tuck_spread: float = 0.10
    """Its spread between people."""


@dataclass(frozen=True)
class Caution:
    """What felt vibrations teach. Caution grows towards 1 while one is felt."""

    caution_per_s: float = 0.014
    """How fast caution grows."""
    caution_forgotten_s: float = 3600.0
    """Over which time it is forgotten."""
    careful_margin_m: float = 0.060
    """The margin that it leads to, in which people differ less than in their own."""
    careful_margin_spread_m: float = 0.020
    """Its spread between people."""
    careful_with_own: float = 0.7
    """How much who keeps a wide margin learns a wide one (correlation)."""
    caution_tuck: float = 0.55
    """Share by which it keeps arms closer than habit does."""
    caution_tuck_spread: float = 0.35
    """How much people differ in that: below none, arms come out, as of somebody who gets
    careless."""
    response_tail: float = 4.0
    """Degrees of freedom of Student's t, by which they differ."""
    loose_response: float = 0.60
    """How much less arms come in, in the loose."""
    caution_wander: float = 0.62
    """Share by which it keeps the way truer."""


@dataclass(frozen=True)
class Alarm:
    """What a vibration does at once. Alarm grows towards 1 while one is felt."""

    alarm_per_s: float = 0.5
    """How fast alarm grows; assumed."""
    alarm_forgotten_s: float = 12.0
    """Over which time it is forgotten; assumed."""
    alarm_slowing: float = 0.14
    """Share of speed that it costs."""
    alarm_slowing_spread: float = 0.50
    """Its spread between people (log scale)."""
    alarm_margin_m: float = 0.034
    """How much it widens the margin."""
    alarm_margin_spread_m: float = 0.060
    """Its spread between people, normal, so that it narrows it in some."""
    alarm_with_own: float = 0.7
    """How much who keeps a wide margin is alarmed more (correlation)."""


@dataclass(frozen=True)
class Form:
    """How somebody is just now: it wanders round what they are, whatever is felt."""

    form_walks: int = 8
    """Over about how many walks it wanders."""
    form_pace: float = 0.095
    """Spread of pace (log scale)."""
    form_loose: float = 0.27
    """Spread of looseness, in spreads between people."""
    form_margin_m: float = 0.008
    """Spread of the margin."""
    form_wander: float = 0.6
    """Spread of sway (log scale)."""


@dataclass(frozen=True)
class Population:
    """Parameters of all simulated participants; spreads are between people.

    What is not marked as assumed was tuned by hand to the published means and spreads on seeds 7,
    101 and 4242, volumes by the source's cubes as they would be on the characters' surfaces, which
    hold about 0.7 of those on capsules (see `benchmarks.crowd_participants --surfaces`).
    """

    walking: Walking = Walking()
    routes: Routes = Routes()
    arms: Arms = Arms()
    caution: Caution = Caution()
    alarm: Alarm = Alarm()
    form: Form = Form()


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
    CLEAR,
    N_TRAITS,
) = range(26)


@dataclass(frozen=True)
class Person:
    """One simulated participant; `traits` (25,) as the walking kernel reads them."""

    sex: str
    age: int
    stature_m: float
    reading_s: float
    reaction_s: float
    presence: float
    embodiment: Vector
    traits: Vector


def draw_person(population: Population, rng: np.random.Generator, *, feels: bool) -> Person:
    """Draw a person; without `feels` vibration changes nothing, everything else is the same."""
    q = population
    sex = "woman" if rng.random() < 8 / 23 else "man"
    mean, spread = (1.65, 0.06) if sex == "woman" else (1.78, 0.065)
    stature = float(mean + spread * np.clip(rng.standard_normal(), -2, 2))
    z = np.clip(rng.standard_normal(8), -2, 2)
    loose, shoulders, slowing, stride, alarmed = np.clip(rng.standard_normal(5), -2, 2)
    arms = float(np.clip(rng.standard_t(q.caution.response_tail), -3, 3))
    traits = np.zeros(N_TRAITS)
    traits[FREE_SPEED] = q.walking.free_speed_m_s * np.exp(q.walking.free_speed_spread * z[0])
    traits[TURN_SLOWING] = q.walking.turn_slowing
    traits[NARROW_SLOWING] = q.walking.narrow_slowing
    traits[STRIDE] = (
        q.walking.stride_m * stature / 1.75 * np.exp(-q.arms.loose_stride * loose + 0.08 * stride)
    )
    traits[WIDTH] = q.walking.shoulder_width_m * stature / 1.75
    traits[DEPTH] = q.walking.body_depth_m * stature / 1.75
    traits[MARGIN] = q.walking.margin_m + q.walking.margin_spread_m * z[1]
    traits[TURN_LIMIT] = np.radians(q.walking.turn_limit_deg)
    traits[TURN_S] = q.walking.turn_s
    traits[WANDER] = q.walking.wander_m * np.exp(0.15 * z[2])
    traits[WANDER_S] = q.walking.wander_s
    traits[CLEAR] = q.walking.clear_m
    traits[SWING] = min(
        q.arms.swing_rad * np.exp(q.arms.loose_swing * loose + 0.2 * z[3]), MAX_SWING_RAD
    )
    traits[TUCK] = float(np.clip(q.arms.tuck + q.arms.tuck_spread * z[4], 0, 1))
    traits[STATURE] = stature
    responsive = float(np.exp(0.3 * z[5]))
    traits[CAUTION_PER_S] = q.caution.caution_per_s * responsive if feels else 0.0
    traits[CAUTION_FORGOTTEN] = q.caution.caution_forgotten_s
    traits[ALARM_PER_S] = q.alarm.alarm_per_s * responsive if feels else 0.0
    traits[ALARM_FORGOTTEN] = q.alarm.alarm_forgotten_s
    traits[CAREFUL_MARGIN] = (
        q.caution.careful_margin_m
        + q.caution.careful_margin_spread_m
        * correlated_normal(z[1], shoulders, q.caution.careful_with_own)
    )
    answer = 1.0 + q.caution.caution_tuck_spread * arms - q.caution.loose_response * loose
    traits[CAUTION_TUCK] = min(q.caution.caution_tuck * answer, 1.0)
    traits[CAUTION_WANDER] = q.caution.caution_wander
    traits[ALARM_SLOWING] = q.alarm.alarm_slowing * np.exp(q.alarm.alarm_slowing_spread * slowing)
    wariness = correlated_normal(z[1], alarmed, q.alarm.alarm_with_own)
    traits[ALARM_MARGIN] = q.alarm.alarm_margin_m + q.alarm.alarm_margin_spread_m * wariness
    traits[SPREAD] = min(q.arms.spread_rad * np.exp(q.arms.loose_spread * loose), MAX_SPREAD_RAD)
    return Person(
        sex=sex,
        age=int(np.clip(np.rint(26 + 6 * rng.standard_normal()), 18, 43)),
        stature_m=stature,
        reading_s=float(q.walking.reading_s * np.exp(0.25 * z[6])),
        reaction_s=float(q.walking.reaction_s * np.exp(0.25 * z[7])),
        presence=float(5.1 + 0.9 * rng.standard_normal()),
        embodiment=np.array([6.0, 3.6, 5.0]) + np.array([0.7, 1.2, 1.1]) * rng.standard_normal(3),
        traits=traits,
    )


def in_form(person: Person, population: Population, form: Vector) -> Vector:
    """Return the traits (25,) of a walk; `form` (4,), N(0, 1): pace, looseness, margin, sway."""
    q, traits = population, person.traits.copy()
    pace, loose = q.form.form_pace * form[0], q.form.form_loose * form[1]
    traits[FREE_SPEED] *= np.exp(pace)
    traits[STRIDE] *= np.exp(-q.arms.loose_stride * loose)
    traits[SWING] = min(traits[SWING] * np.exp(q.arms.loose_swing * loose), MAX_SWING_RAD)
    traits[SPREAD] = min(traits[SPREAD] * np.exp(q.arms.loose_spread * loose), MAX_SPREAD_RAD)
    traits[MARGIN] += q.form.form_margin_m * form[2]
    traits[CAREFUL_MARGIN] += q.form.form_margin_m * form[2]
    traits[WANDER] *= np.exp(q.form.form_wander * form[3])
    return traits
