"""Who the simulated participants are: the population's constants, and one person drawn from it."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import UsageError
from visavis.people.observer.state import PERSON_DTYPE

MIN_RETURN_GAIN, MAX_RETURN_GAIN = 0.1, 90.0
"""Limits of the factor by which contact changes a head's attraction, from those it repels most to
those it attracts most."""
MIN_RECHECK_GAIN = -0.9
"""Lowest extra attraction of an agent that looked away, in those who avoid it most."""


@dataclass(frozen=True)
class Attraction:
    """What attracts gaze: relative weights, of which only ratios matter."""

    head_appeal: float = 1.0
    """C: unit of the weights, a head of average size in the middle of the view."""
    body_appeal: float = 0.5
    """C: a chest, against a head."""
    room_appeal: float = 2.15
    """F: one of the room's points (walls, ceiling, floor), against a head."""
    speaker_appeal: float = 2.0
    """C: the side towards which the audience looks, where the speaker is known to stand."""
    size_power: float = 0.5
    """C: attraction grows with angular radius to this power."""
    left_bias: float = 0.25
    """C (sign: Foulsham et al. 2013, Ossandon et al. 2014): log weight per 20° to the left."""
    centre_deg: float = 35.0
    """C: weights fall with the angle from the middle of the view as a Gaussian of this width."""
    head_appeal_log_sd: float = 0.42
    """F: between-person spread of the share of looking that heads get."""
    novelty_gain: float = 1.0
    """C: weight of a target not yet inspected in this trial."""
    familiar_share: float = 0.34
    """F: weight of a head inspected before, without contact, once recovered."""
    recovery_s: float = 0.6
    """F: time constant with which a target just left attracts again (inhibition of return)."""
    second_look_gain: float = 0.9
    """F: extra attraction of a head inspected a moment ago (facilitation of return, Smith &
    Henderson 2009), ..."""
    second_look_s: float = 2.5
    """C: ... and the time constant with which it fades."""
    early_gain: float = 0.7
    """F: extra attraction of heads just after the scene appears, ..."""
    early_s: float = 4.0
    """C: ... and the time constant with which it fades."""
    amplitude_deg: float = 14.0
    """L: near targets before far ones, exponential in saccade size (Tatler et al. 2006)."""


@dataclass(frozen=True)
class Visits:
    """How long visits and fixations last."""

    head_visit_s: float = 0.262
    """F: mean visit to a head without contact (one or more fixations on it)."""
    head_visit_log_sd: float = 0.45
    """F: its within-person log spread."""
    head_visit_between_log_sd: float = 0.22
    """F: its between-person log spread."""
    other_visit_s: float = 0.35
    """C: mean visit to a body or a point of the room."""
    other_visit_log_sd: float = 0.45
    """C: its log spread."""
    fixation_s: float = 0.28
    """L: mean fixation in scene viewing (Henderson 2003); longer visits hold several."""
    fixation_log_sd: float = 0.35
    """L: its log spread; fixation durations are skewed to the right."""
    onset_latency_s: float = 0.25
    """L: from the appearance of a scene or an instruction to the first saccade."""


@dataclass(frozen=True)
class Noticing:
    """When gaze contact is noticed."""

    contact_deg: float = 5.0
    """L: gaze within about this angle of one's eyes is felt as contact (Gamer & Hecht 2007)."""
    notice_p: float = 0.95
    """C: probability that contact is noticed on looking at the head at all."""
    notice_s: float = 0.12
    """C: mean time from landing on a head to knowing where it looks."""
    change_notice_s: float = 0.20
    """C: mean time to notice that the agent looked at begins or ends contact."""
    notice_log_sd: float = 0.35
    """C: log spread of both."""
    parafovea_p: float = 0.10
    """C: probability per fixation to notice contact just beside the point looked at, ..."""
    parafovea_deg: float = 6.0
    """C: ... falling with eccentricity as a Gaussian of this width (Palanica & Itier 2011)."""
    onset_p: float = 0.46
    """F: the same for the first impression of a scene just appeared, taken from its middle, ..."""
    onset_deg: float = 9.0
    """F: ... falling with the horizontal angle from there (published: the centre's effect)."""
    capture_gain: float = 4.0
    """F: extra attraction of an agent whose contact was noticed beside the point looked at."""


@dataclass(frozen=True)
class Contact:
    """The effects of gaze contact on looking."""

    hold_s: float = 0.30
    """F: mean prolongation of a visit by contact."""
    hold_log_sd: float = 0.60
    """C: its within-person log spread."""
    hold_between_share: float = 0.98
    """F: its between-person spread, a share of the mean; people below zero cut a visit short when
    they are looked at."""
    startle_s: float = 0.27
    """F: mean time a visit goes on after contact was seen to end."""
    startle_between_share: float = 2.05
    """F: its between-person spread, a share of the mean; people below zero leave at once."""
    hold_growth: float = 1.0
    """F: factor on `hold_s` at each further visit to an agent in contact."""
    caught_hold: float = 1.15
    """F: factor on `hold_s` for an agent seen to look elsewhere before, ..."""
    caught_return: float = 2.1
    """F: ... and on `return_gain`: being caught staring asks for another look."""
    return_gain: float = 9.0
    """F: median factor by which an agent known to be in contact draws gaze back."""
    return_between_log_sd: float = 2.15
    """F: its between-person log spread; below one, contact repels."""
    return_levels: float = 0.35
    """F: how much less those most drawn exceed the mean than others stay below it, ..."""
    hold_levels: float = 0.60
    """F: ... and the same of those most held, so that differences of looking are as normal as the
    source's t tests take them to be."""
    return_habituation: float = 0.42
    """F: factor on the former at each further visit."""
    recheck_gain: float = 4.5
    """F: extra attraction of an agent that was seen to look away, ..."""
    recheck_between_share: float = 1.8
    """F: its between-person spread, a share of the mean; below zero it is avoided."""
    recheck_s: float = 5.0
    """F: ... and the time constant with which it fades."""


@dataclass(frozen=True)
class Anxiety:
    """Social anxiety, what it does to looking, and how its questionnaire is answered."""

    anxiety_on_hold: float = -0.35
    """F: correlation of the trait with the log of `hold_s` (published: dwell rs -.37 to -.57)."""
    anxiety_on_return: float = -0.45
    """F: correlation of the trait with the log of `return_gain`."""
    anxiety_on_visit: float = -0.55
    """F: correlation of the trait with the log of `head_visit_s` (published: A rs -.40)."""
    hold_with_return: float = 0.9
    """F: correlation of the two gains through what is not anxiety."""
    lsas_mean: float = 46.0
    """C: mean total of the social anxiety scale in a volunteer sample (range 0-144)."""
    lsas_sd: float = 21.0
    """C: its between-person spread."""


@dataclass(frozen=True)
class EyeMovement:
    """Movements of the eyes and the head."""

    saccade_s: float = 0.021
    """L: main sequence, duration at amplitude zero (Carpenter 1988)."""
    saccade_s_per_deg: float = 0.0022
    """L: main sequence, duration per degree."""
    undershoot_p: float = 0.5
    """L: share of saccades above 5° that fall short and need a second one (Becker 1991)."""
    undershoot_share: float = 0.10
    """L: mean shortfall of these, share of the amplitude."""
    correction_s: float = 0.14
    """L: mean time until the second saccade."""
    scatter_share: float = 0.30
    """C: fixations scatter round a target's centre by this share of its radius (SD per axis)."""
    drift_deg: float = 0.10
    """L: amplitude of slow drift within a fixation."""
    tremor_deg: float = 0.005
    """L: amplitude of tremor."""
    head_gain: float = 0.35
    """L: share of a gaze shift that the head contributes when seated (Freedman 2008), mean."""
    head_gain_sd: float = 0.12
    """L: its between-person spread; people are head movers or eye movers."""
    head_rate_per_s: float = 7.0
    """C: rate of the critically damped head movement; most of it follows the eyes' arrival."""
    eye_range_deg: float = 28.0
    """L: the head takes over what would leave the eyes further out than this."""


@dataclass(frozen=True)
class Body:
    """Blinks, pupils and build."""

    blinks_per_min: float = 15.0
    """L: mean rate (Bentivoglio et al. 1997)."""
    blinks_log_sd: float = 0.35
    """L: between-person spread of its logarithm."""
    blink_s: float = 0.13
    """L: mean time with the lids shut; 40 ms closing and 60 ms opening are added."""
    pupil_dark_mm: float = 5.5
    """L: diameter in the dark, mean."""
    pupil_bright_mm: float = 3.6
    """L: diameter before the lit scene, mean."""
    pupil_sd_mm: float = 0.5
    """L: between-person spread of both."""
    pupil_arousal_mm: float = 0.10
    """C: dilation while in contact."""
    pupil_s: float = 0.6
    """L: time constant of the light reflex."""
    sway_m: float = 0.003
    """C: amplitude of a seated trunk's sway."""
    ipd_m: float = 0.063
    """L: distance between the pupils, mean (SD 3.5 mm)."""
    neck_back_m: float = 0.10
    """C: the head turns about a point this far behind the eyes ..."""
    neck_up_m: float = 0.08
    """C: ... and this far below them."""


@dataclass(frozen=True)
class Population:
    """Every constant of the model, with its role and where its value comes from.

    F: fitted by hand so that studies of 30 reproduce the published means, spreads and verdicts
    (`python -m benchmarks.stare_participants`). L: an ordinary value of the eye movement
    literature, not fitted. C: a choice, plausible but without a figure to hold it against, made
    before fitting and kept. `*_sd` are between-person
    standard deviations (of the logarithm where the name says log); within-person spreads are
    `*_log_sd` of visits and fixations.
    """

    attraction: Attraction = Attraction()
    visits: Visits = Visits()
    noticing: Noticing = Noticing()
    contact: Contact = Contact()
    anxiety: Anxiety = Anxiety()
    movement: EyeMovement = EyeMovement()
    body: Body = Body()


DEFAULT_POPULATION = Population()


@dataclass(frozen=True)
class Temperament:
    """One simulated person: `constants` for the kernel and what the questionnaires ask about.

    `constants` has dtype `state.PERSON_DTYPE`, shape (1,). `anxiety` is the standardised
    trait; `head_appeal` multiplies what heads are worth.
    """

    constants: npt.NDArray[np.void]
    anxiety: float
    head_appeal: float
    left_bias: float
    age_years: int
    is_female: bool
    vr_experience: int
    games_experience: int


def correlated_normal(z: float, fresh: float, r: float) -> float:
    """Return a standard normal with correlation `r` to `z`."""
    return float(r * z + np.sqrt(1 - r * r) * fresh)


def _compress_upper_side(z: float, by: float) -> float:
    """Return a standard normal with its upper side drawn in by `by`; mean 0 and SD 1 stay."""
    square = by * by
    mean = (1 - np.exp(square / 2)) / by
    sd = np.sqrt(np.exp(2 * square) - np.exp(square)) / by
    return float(((1 - np.exp(-by * z)) / by - mean) / sd)


def draw_temperament(population: Population, rng: np.random.Generator) -> Temperament:
    """Draw one person; the seat is left at the origin."""
    q = population
    # All normal deviates at once: each constant has a fixed place among them.
    z = rng.standard_normal(16)
    # Anxiety correlates with holding contact, returning to it and the length of visits.
    anxiety = float(z[0])
    hold = correlated_normal(anxiety, z[1], q.anxiety.anxiety_on_hold)
    rest = correlated_normal(z[1], z[2], q.anxiety.hold_with_return)
    come_back = correlated_normal(anxiety, rest, q.anxiety.anxiety_on_return)
    visit = correlated_normal(anxiety, z[3], q.anxiety.anxiety_on_visit)
    hold_level, return_level = (
        _compress_upper_side(hold, q.contact.hold_levels),
        _compress_upper_side(come_back, q.contact.return_levels),
    )
    drawn_values = {
        "head_visit_s": q.visits.head_visit_s * np.exp(q.visits.head_visit_between_log_sd * visit),
        "other_visit_s": q.visits.other_visit_s * np.exp(0.10 * z[4]),
        "hold_s": q.contact.hold_s * (1 + q.contact.hold_between_share * hold_level),
        "startle_s": q.contact.startle_s * (1 + q.contact.startle_between_share * hold_level),
        "return_gain": np.clip(
            q.contact.return_gain * np.exp(q.contact.return_between_log_sd * return_level),
            MIN_RETURN_GAIN,
            MAX_RETURN_GAIN,
        ),
        "recheck_gain": max(
            MIN_RECHECK_GAIN,
            q.contact.recheck_gain * (1 + q.contact.recheck_between_share * come_back),
        ),
        "parafovea_rad": np.radians(q.noticing.parafovea_deg),
        "onset_rad": np.radians(q.noticing.onset_deg),
        "amplitude_rad": np.radians(q.attraction.amplitude_deg),
        "fixation_s": q.visits.fixation_s * np.exp(0.08 * z[5]),
        "onset_latency_s": q.visits.onset_latency_s * np.exp(0.12 * z[6]),
        "saccade_s_per_rad": np.degrees(q.movement.saccade_s_per_deg) * np.exp(0.06 * z[7]),
        "drift_rad": np.radians(q.movement.drift_deg) * np.exp(0.2 * z[8]),
        "tremor_rad": np.radians(q.movement.tremor_deg),
        "head_gain": np.clip(q.movement.head_gain + q.movement.head_gain_sd * z[9], 0.05, 0.8),
        "head_rate": q.movement.head_rate_per_s * np.exp(0.1 * z[10]),
        "eye_range_rad": np.radians(q.movement.eye_range_deg),
        "blink_interval_s": 60.0 / (q.body.blinks_per_min * np.exp(q.body.blinks_log_sd * z[11])),
        "pupil_dark_mm": q.body.pupil_dark_mm + q.body.pupil_sd_mm * z[12],
        "pupil_bright_mm": q.body.pupil_bright_mm + 0.7 * q.body.pupil_sd_mm * z[12],
        "sway_m": q.body.sway_m * np.exp(0.3 * z[13]),
        "ipd_m": q.body.ipd_m + 0.0035 * z[14],
    }
    # The kernels read constants as one structured row; the questionnaires read the rest.
    parts = (q.attraction, q.visits, q.noticing, q.contact, q.movement, q.body)
    # What does not differ between people has the name of the population's constant.
    names = PERSON_DTYPE.names or ()
    shared = {n: getattr(part, n) for part in parts for n in names if hasattr(part, n)}
    constants = np.zeros(1, dtype=PERSON_DTYPE)
    for name, value in (shared | drawn_values).items():
        constants[name] = value
    return Temperament(
        constants=constants,
        anxiety=anxiety,
        head_appeal=float(np.exp(q.attraction.head_appeal_log_sd * z[15])),
        left_bias=float(q.attraction.left_bias + 0.1 * rng.standard_normal()),
        age_years=int(np.clip(round(22 + rng.gamma(1.0, 8.5)), 18, 65)),
        is_female=bool(rng.random() < 8 / 30),
        vr_experience=int(np.clip(round(3.4 + 1.4 * rng.standard_normal()), 1, 5)),
        games_experience=int(np.clip(round(3.5 + 1.5 * rng.standard_normal()), 1, 5)),
    )


def scaled_population(population: Population, effect: float) -> Population:
    """Scale all effects of gaze contact on people; the rest of their behaviour stays.

    Durations and additions are multiplied by `effect`, factors are raised to its power, so that
    1 is the fitted population and 0 is no effect of contact. The scale acts on mechanisms; means
    change with it, but not in proportion. Raises UsageError above 2, where the model was never
    tested.
    """
    if not 0 <= effect <= 2:
        raise UsageError(
            f"these simulated people can scale their effect from 0 to 2, not {effect:g}"
        )
    p = population
    if effect in (0, 1):
        return p
    contact = replace(
        p.contact,
        hold_s=p.contact.hold_s * effect,
        startle_s=p.contact.startle_s * effect,
        recheck_gain=p.contact.recheck_gain * effect,
        hold_growth=p.contact.hold_growth**effect,
        caught_hold=p.contact.caught_hold**effect,
        caught_return=p.contact.caught_return**effect,
        return_gain=p.contact.return_gain**effect,
        return_between_log_sd=p.contact.return_between_log_sd * effect,
        return_habituation=p.contact.return_habituation**effect,
    )
    noticing = replace(p.noticing, capture_gain=p.noticing.capture_gain * effect)
    return replace(p, contact=contact, noticing=noticing)
