"""Rhythms of small movements: smooth noise, events at irregular times, eased steps.

All of it is a function of time and of whole numbers that stand for a person and a purpose, so
any moment can be asked for in any order and comes out the same.
"""

import math

import numpy as np

from visavis.lab.compiled import compiled

S1, S2, S3, S4, S5, S6, S7, S8, S9, S10 = (
    (-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 11)
)
"""sin x / x = 1 + S1 x² + S2 x⁴ and so on; the term after `S10` is below 1e-18 at half of pi."""
MASK = np.uint64(0xFFFFFFFFFFFFFFFF)


@compiled
def chance(person: int, purpose: int, count: int) -> float:
    """Return a number in [0, 1) that belongs to three whole numbers."""
    # Constants and shifts of splitmix64 (public domain, S. Vigna).
    x = np.uint64(person) * np.uint64(0x9E3779B97F4A7C15)
    x ^= np.uint64(purpose) * np.uint64(0xBF58476D1CE4E5B9)
    x += np.uint64(count) * np.uint64(0x94D049BB133111EB)
    x ^= x >> np.uint64(30)
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(27)
    x *= np.uint64(0x94D049BB133111EB)
    x ^= x >> np.uint64(31)
    return float(x >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@compiled
def ease(share: float) -> float:
    """Return a rise from 0 to 1 with zero velocity and acceleration at both ends."""
    x = min(1.0, max(0.0, share))
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


@compiled
def sine_of_turns(x: float) -> float:
    """Return sin(2π x) to within 3e-16 of one turn. Without a call, so that several run at once."""
    rest = x - np.floor(x + 0.5)
    # Fold the second and third quarter of the turn onto the others.
    quarter = rest if abs(rest) <= 0.25 else math.copysign(0.5, rest) - rest
    z = 2.0 * np.pi * quarter
    y = z * z
    tail = S6 + y * (S7 + y * (S8 + y * (S9 + y * S10)))
    series = S1 + y * (S2 + y * (S3 + y * (S4 + y * (S5 + y * tail))))
    return float(z * (1.0 + y * series))


@compiled
def drift(t_s: float, slowest_hz: float, person: int, purpose: int) -> float:
    """Return smooth noise of about unit size: five sines over two octaves and a half."""
    total = 0.0
    for i in range(5):
        frequency = slowest_hz * 1.43**i * (0.85 + 0.3 * chance(person, purpose, 2 * i))
        phase = chance(person, purpose, 2 * i + 1)
        total += sine_of_turns(frequency * t_s + phase) * 0.8**i
    return total / 1.83


@compiled
def stepping(
    t_s: float, mean_s: float, change_s: float, person: int, purpose: int
) -> tuple[float, float]:
    """Return a value in [−1, 1] that rests, then eases to a new one, and how far a change is.

    Changes come `mean_s` apart on average, at least 0.4 of that; each takes `change_s`. The second
    number is 0 at rest and 1 in the middle of a change.
    """
    # Times are hashed from the slot's number; before its start the slot before is still on.
    k = np.floor(t_s / mean_s)
    start = (k + 0.6 * chance(person, purpose, 2 * int(k) + 1)) * mean_s
    if t_s < start:
        k -= 1.0
        start = (k + 0.6 * chance(person, purpose, 2 * int(k) + 1)) * mean_s
    before = 2.0 * chance(person, purpose, 2 * int(k)) - 1.0
    after = 2.0 * chance(person, purpose, 2 * int(k) + 2) - 1.0
    x = min(1.0, (t_s - start) / change_s)
    under_way = 16.0 * x * x * (1.0 - x) * (1.0 - x)
    return before + (after - before) * ease(x), under_way


@compiled
def bump(
    t_s: float, mean_s: float, lasting_s: float, person: int, purpose: int
) -> tuple[float, float]:
    """Return a passing event: its height 0..1..0 now, and a number in [0, 1) that is its own.

    One event in each `mean_s` seconds; it lasts `lasting_s`, which must be below 0.4 of that.
    """
    # Times are hashed from the slot's number, so that any moment can be computed alone.
    k = np.floor(t_s / mean_s)
    start = (k + 0.6 * chance(person, purpose, 2 * int(k) + 1)) * mean_s
    x = (t_s - start) / lasting_s
    own = chance(person, purpose, 2 * int(k))
    if x <= 0.0 or x >= 1.0:
        return 0.0, own
    y = 4.0 * x * (1.0 - x)
    return y * y * y, own
