"""Psychometric functions: the share of right answers by level, and their fit to answers.

The fit is Bayesian, on a grid that is laid twice: wide at first, then over what is probable. Priors
are weak and stand in `fit_psychometric`; estimates are medians of the posterior, intervals leave as
much below as above. The model is that of Wichmann & Hill (2001), Percept. Psychophys. 63:1293,
doi:10.3758/BF03194544; to lapses as unknowns with a prior see Schütt et al. (2016), Vision Res.
122:105, doi:10.1016/j.visres.2016.02.002.
"""

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, xlog1py, xlogy

from visavis.lab.errors import DataError

Floats = npt.NDArray[np.float64]
PsychometricFunction = Literal["weibull", "normal"]
INTERVAL_01: Final = 0.95
"""How much of the posterior an interval holds."""
MIN_TRIALS: Final = 10
"""Fewer answers are not fitted."""
MAX_LAPSE_01: Final = 0.2
MAX_GUESS_01: Final = 0.5
LAPSE_PRIOR: Final = 19.0
GUESS_PRIOR: Final = 9.0
"""A rate that is estimated has the prior (1 - rate) to this power: beta of 1 and 20, 1 and 10."""
SLOPE_SD: Final = 1.5
"""Standard deviation of the prior of the slope's natural logarithm, cut off at two of them."""
WEIBULL_SLOPE: Final = 2.2
"""Median of the prior of a Weibull function's slope."""
SPREAD_OF_RANGE: Final = 0.2
"""Median of the prior of a normal function's slope, as a share of the levels' range."""
_TAIL: Final = 1e-5
_FIRST: Final = (41, 25, 5, 6)
_SECOND: Final = (61, 41, 9, 9)
"""Points of the two grids: thresholds, slopes, lapses, guesses."""


class NoFitError(DataError):
    """Answers do not lead to a psychometric function; the message says why."""


@dataclass(frozen=True)
class PsychometricFit:
    """A function fitted to answers: medians of the posterior, and ends of 95 % intervals."""

    threshold: float
    threshold_low: float
    threshold_high: float
    slope: float
    slope_low: float
    slope_high: float
    lapse_01: float
    guess_01: float
    trials: int


def share_right(
    level: Any,
    threshold: Any,
    slope: Any,
    guess: Any,
    lapse: Any,
    function: PsychometricFunction = "weibull",
) -> Floats:
    """Return the share of right answers at a level.

    "weibull" is guess + (1 - guess - lapse) (1 - exp(-(level / threshold) ** slope)), so that at
    the threshold 63 % of the way is gone; "normal" has the distribution function of a normal
    variable whose mean is the threshold and whose standard deviation is the slope: there it is
    half.
    """
    if function == "weibull":
        with np.errstate(over="ignore"):  # far above a steep function's threshold: all is seen
            rises = -np.expm1(-((np.asarray(level) / threshold) ** slope))
    else:
        rises = ndtr((np.asarray(level) - threshold) / slope)
    return np.asarray(guess + (1.0 - guess - lapse) * rises, np.float64)


def fit_psychometric(
    level: npt.ArrayLike,
    is_right: npt.ArrayLike,
    *,
    guess: float | None = 0.5,
    lapse: float | None = None,
    function: PsychometricFunction = "weibull",
) -> PsychometricFit:
    """Return the function that answers at levels (n,) lead to.

    `guess` and `lapse` are shares that are known; None estimates them, up to .5 and .2. The
    threshold is as likely anywhere in the range of the levels and half as far beyond (on a
    logarithmic scale for "weibull"). The slope's logarithm is normal, with standard deviation 1.5
    around a slope of 2.2 for "weibull" and of a fifth of the levels' range for "normal".

    Raises:
        NoFitError: there are too few answers or levels, all answers are alike, or the threshold
            lies outside what was shown.
    """
    levels, right, total = _counts(level, is_right)
    if function == "weibull" and levels[0] <= 0:
        raise NoFitError(
            f"the lowest level is {levels[0]:g}; a Weibull function has levels above 0"
        )
    low, high = (float(v) for v in _scale(levels[[0, -1]], function))
    margin = (high - low) / 2
    slope = WEIBULL_SLOPE if function == "weibull" else SPREAD_OF_RANGE * float(np.ptp(levels))
    ends = [
        (low - margin, high + margin),
        (np.log(slope) - 2 * SLOPE_SD, np.log(slope) + 2 * SLOPE_SD),
        (0.0, MAX_LAPSE_01) if lapse is None else (lapse, lapse),
        (0.0, MAX_GUESS_01) if guess is None else (guess, guess),
    ]
    # The first grid says where the posterior lies; the second covers that alone, finely.
    axes = _axes(ends, _FIRST)
    posterior = _posterior(axes, levels, right, total, np.log(slope), function)
    at, here = axes[0], _marginal(posterior, 0)
    if (outside := float(here[(at < low) | (at > high)].sum())) > 0.5:
        where = "below" if here[at < low].sum() > here[at > high].sum() else "above"
        raise NoFitError(
            f"the threshold lies {where} the levels shown ({levels[0]:g} to {levels[-1]:g}), with "
            f"a probability of {outside:.2f}"
        )
    axes = _axes([_support(v, _marginal(posterior, i)) for i, v in enumerate(axes)], _SECOND)
    posterior = _posterior(axes, levels, right, total, np.log(slope), function)
    quantiles = [_quantiles(v, _marginal(posterior, i)) for i, v in enumerate(axes)]
    threshold = np.exp(quantiles[0]) if function == "weibull" else quantiles[0]
    slopes = np.exp(quantiles[1])
    return PsychometricFit(
        float(threshold[1]),
        float(threshold[0]),
        float(threshold[2]),
        float(slopes[1]),
        float(slopes[0]),
        float(slopes[2]),
        float(quantiles[2][1]),
        float(quantiles[3][1]),
        int(total.sum()),
    )


def _counts(level: npt.ArrayLike, is_right: npt.ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return levels, right answers and answers at each.

    Raises:
        NoFitError: they say nothing of a function.
    """
    at, answers = np.asarray(level, np.float64), np.asarray(is_right, np.float64)
    there = np.isfinite(at) & np.isfinite(answers)
    at, answers = at[there], answers[there]
    if at.size < MIN_TRIALS:
        raise NoFitError(f"{at.size} answers; a fit needs {MIN_TRIALS}")
    levels, place = np.unique(at, return_inverse=True)
    if levels.size < 2:
        raise NoFitError(f"all answers are at one level, {levels[0]:g}")
    if answers.min() == answers.max():
        raise NoFitError(f"all answers are {'right' if answers[0] else 'wrong'}")
    right = np.asarray(np.bincount(place, weights=answers, minlength=levels.size), np.float64)
    total = np.asarray(np.bincount(place, minlength=levels.size), np.float64)
    return levels, right, total


def _scale(value: Floats, function: PsychometricFunction) -> Floats:
    return np.log(value) if function == "weibull" else value


def _axes(ends: list[tuple[float, float]], counts: tuple[int, ...]) -> list[Floats]:
    return [
        np.array([low]) if low == high else np.linspace(low, high, count)
        for (low, high), count in zip(ends, counts, strict=True)
    ]


def _posterior(
    axes: list[Floats],
    levels: Floats,
    right: Floats,
    total: Floats,
    log_slope: float,
    function: PsychometricFunction,
) -> Floats:
    """Return the posterior (thresholds, slopes, lapses, guesses), 1 in all."""
    thresholds, slopes, lapses, guesses = axes
    at = np.exp(thresholds) if function == "weibull" else thresholds
    rises = share_right(
        levels, at[:, None, None], np.exp(slopes)[None, :, None], 0.0, 0.0, function
    )
    log = np.empty((thresholds.size, slopes.size, lapses.size, guesses.size))
    for i, lapse in enumerate(lapses):
        for j, guess in enumerate(guesses):
            share = guess + (1.0 - guess - lapse) * rises
            log[:, :, i, j] = (xlogy(right, share) + xlog1py(total - right, -share)).sum(axis=-1)
    log -= (((slopes - log_slope) / SLOPE_SD) ** 2 / 2)[None, :, None, None]
    if lapses.size > 1:
        log += LAPSE_PRIOR * np.log1p(-lapses)[None, None, :, None]
    if guesses.size > 1:
        log += GUESS_PRIOR * np.log1p(-guesses)
    likely = np.exp(log - log.max())
    return np.asarray(likely / likely.sum(), np.float64)


def _marginal(posterior: Floats, axis: int) -> Floats:
    others = tuple(other for other in range(4) if other != axis)
    return np.asarray(posterior.sum(axis=others), np.float64)


def _support(values: Floats, probability: Floats) -> tuple[float, float]:
    """Return between which values of a grid all but the tails of the probability lies."""
    there = np.flatnonzero(probability > _TAIL * probability.max())
    first, last = max(int(there[0]) - 1, 0), min(int(there[-1]) + 1, values.size - 1)
    return float(values[first]), float(values[last])


def _quantiles(values: Floats, probability: Floats) -> Floats:
    """Return the lower end, the median and the upper end of a marginal posterior."""
    tail = (1.0 - INTERVAL_01) / 2
    if values.size == 1:
        return np.repeat(values, 3)
    pieces = (probability[1:] + probability[:-1]) / 2  # a density, straight between the points
    below = np.concatenate([[0.0], np.cumsum(pieces)]) / pieces.sum()
    return np.asarray(np.interp((tail, 0.5, 1.0 - tail), below, values), np.float64)
