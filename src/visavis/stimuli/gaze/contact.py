"""Eye contact: looks drawn in advance for conversation and for avoidance.

In conversation of two people at 2 m, somebody looks at the other for about 75 % of the time while
listening and 40 % while talking, in glances of 3 s on average (Argyle 1988, Bodily Communication,
ch. 10, after Argyle & Ingham 1972, Semiotica 6:32). Being looked at is most comfortable for 3.3 s,
standard deviation 0.7 s (Binetti et al. 2016, R Soc Open Sci 3:160086).
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from visavis.stimuli.gaze.gaze_plan import LookAt
from visavis.stimuli.motion.errors import MotionError

LISTENING_01: Final = 0.75
MEAN_GLANCE_S: Final = 3.0
SHAPE: Final = 4.0
"""Shape of the gamma distribution of durations; our choice."""
MIN_S: Final = 0.35
SHYEST_GLANCE_S: Final = 0.5


def contact_looks(
    rng: np.random.Generator,
    duration_s: float,
    contact: LookAt,
    *,
    looking_01: float = LISTENING_01,
    mean_glance_s: float = MEAN_GLANCE_S,
) -> tuple[LookAt, ...]:
    """Draw looks that meet a target's eyes for a share of the time and rest elsewhere between.

    `contact` says whom ("observer", "person" or a point); its start is where the looks begin.

    Raises:
        MotionError: the share is not between 0 and 1, or the glance not longer than 0.35 s.
    """
    if not 0.0 < looking_01 < 1.0:
        raise MotionError(f"eye contact for a share of {looking_01}; give one between 0 and 1")
    if not mean_glance_s > MIN_S:
        raise MotionError(f"glances of {mean_glance_s} s; give more than {MIN_S} s")
    mean_away_s = mean_glance_s * (1.0 - looking_01) / looking_01
    return _alternating(
        rng,
        duration_s,
        contact,
        lambda: _lasting_s(rng, mean_glance_s),
        lambda: _lasting_s(rng, mean_away_s),
        begins_away=bool(rng.random() > looking_01),
    )


def avoiding_looks(
    rng: np.random.Generator, duration_s: float, contact: LookAt, *, mean_away_s: float = 8.0
) -> tuple[LookAt, ...]:
    """Draw looks that stay away from a target, but for a short glance now and then."""
    return _alternating(
        rng,
        duration_s,
        contact,
        lambda: _lasting_s(rng, SHYEST_GLANCE_S),
        lambda: _lasting_s(rng, mean_away_s),
        begins_away=True,
    )


def _lasting_s(rng: np.random.Generator, mean_s: float) -> float:
    """Draw a duration; none is shorter than eyes need to settle."""
    if mean_s <= MIN_S:
        return MIN_S
    return MIN_S + float(rng.gamma(SHAPE, (mean_s - MIN_S) / SHAPE))


def _alternating(
    rng: np.random.Generator,
    duration_s: float,
    contact: LookAt,
    glance_s: Callable[[], float],
    away_s: Callable[[], float],
    *,
    begins_away: bool,
) -> tuple[LookAt, ...]:
    t_s, away = contact.start_s, begins_away
    looks = []
    while t_s < contact.start_s + duration_s:
        if away:
            side = 1.0 if rng.random() < 0.5 else -1.0
            where = (side * float(rng.uniform(12.0, 38.0)), float(rng.uniform(-24.0, 8.0)))
            looks.append(LookAt(t_s, "aside", where))
            t_s += away_s()
        else:
            looks.append(LookAt(t_s, contact.target, contact.where))
            t_s += glance_s()
        away = not away
    return tuple(looks)
