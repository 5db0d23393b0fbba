"""Where random dots are at any time, and how much of what was drawn moves together.

Every place follows from the seed, the dot and its life by itself, without those before it: a frame
that is drawn again, a film and a page compute the same. `site/dots.js` holds the same formulae.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.kinds import takes_kinds
from visavis.stimuli.flat import Dots

Floats = npt.NDArray[np.float64]
_COLUMN, _ROW, _DIRECTION, _PHASE = range(4)
"""What a random number is for."""
NEAR_STEPS: Final = 1.5
"""A dot that goes so many times as far as dots go in a step is another one to who sees it."""


def step_at(dots: Dots, elapsed_s: float) -> int:
    """Return how often the dots have moved by a time after their onset."""
    return max(0, int(np.floor(elapsed_s * dots.rate_hz + 0.5)))


def places_deg(dots: Dots, step: int) -> Floats:
    """Return where every dot is after so many steps, (n, 2): right of and above the field's middle;
    NaN where it lies outside a round field.
    """
    places, _ = _places_and_lives(dots, step)
    return places


@takes_kinds()
def motion_of(dots: Dots, seconds: float) -> tuple[float, float]:
    """Return the mean motion of the dots that were drawn in some time from their onset, to the
    right and upwards in degrees a second.

    Dots that vanish, or are then too far away to be the same, count as standing still: all dots
    moving together give almost their speed, fewer a share of it.
    """
    n_steps = max(1, step_at(dots, seconds))
    furthest_deg = NEAR_STEPS * dots.speed_deg_per_s / dots.rate_hz
    total, seen = np.zeros(2), 0
    before, lives_before = _places_and_lives(dots, 0)
    for step in range(1, n_steps + 1):
        after, lives = _places_and_lives(dots, step)
        moved = after - before
        is_same = (lives == lives_before) & (np.hypot(*moved.T) <= furthest_deg)
        total += moved[is_same].sum(axis=0)
        seen += int(np.isfinite(before[:, 0]).sum())
        before, lives_before = after, lives
    right, up = total * dots.rate_hz / max(seen, 1)
    return float(right), float(up)


def _places_and_lives(dots: Dots, step: int) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return the places of `places_deg`, and in which of its lives every dot is."""
    count = round(dots.density_per_deg2 * dots.width_deg**2)
    dot = np.arange(count)
    life, age = np.zeros(count, np.int64), np.full(count, step)
    if dots.lifetime_s is not None:
        lasts = max(1, int(np.floor(dots.lifetime_s * dots.rate_hz + 0.5)))
        whole_age = step + np.floor(_random_01(dots, dot, 0, _PHASE) * lasts).astype(np.int64)
        life, age = whole_age // lasts, whole_age % lasts
    is_signal = dot < np.floor(dots.coherence_01 * count + 0.5)
    own_rad = 2 * np.pi * _random_01(dots, dot, life, _DIRECTION)
    rad = np.where(is_signal, np.radians(dots.direction_deg), own_rad)
    way_deg = dots.speed_deg_per_s / dots.rate_hz * age
    if dots.noise == "position":  # a life of noise lasts one step
        life, way_deg = np.where(is_signal, life, step), np.where(is_signal, way_deg, 0.0)
    wide = dots.width_deg
    x = wide * _random_01(dots, dot, life, _COLUMN) + way_deg * np.cos(rad)
    y = wide * _random_01(dots, dot, life, _ROW) + way_deg * np.sin(rad)
    places = np.stack([x, y], axis=1)
    places = places - wide * np.floor(places / wide) - wide / 2
    if dots.aperture == "circle":
        places[np.hypot(*places.T) > (wide - dots.dot_deg) / 2] = np.nan
    return places, life


def _random_01(
    dots: Dots, dot: npt.NDArray[np.int64], life: npt.NDArray[np.int64] | int, what: int
) -> Floats:
    """Return a random number for each dot in one of its lives, from 0 to below 1."""
    mixed = _mix(np.full(len(dot), dots.seed or 0, np.uint32))
    for number in (dot, life, what):
        mixed = _mix(mixed + np.asarray(number).astype(np.uint32))
    return mixed / 2.0**32


def _mix(x: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """Return 32 bits of which each depends on every one of `x`, by the function "lowbias32"
    (Wellons 2018, https://nullprogram.com/blog/2018/07/31/, public domain).
    """
    x = x ^ (x >> np.uint32(16))
    x = x * np.uint32(0x7FEB352D)
    x = x ^ (x >> np.uint32(15))
    x = x * np.uint32(0x846CA68B)
    return x ^ (x >> np.uint32(16))
