"""Made-up gaze of people in a headset, whose events are known: heads that turn, noise, late eyes.

Somebody looks about in a room, or follows what moves, while the head turns to and fro by itself;
the eyes counter-rotate. The tracker adds white noise and its samples bear the head of another
moment (`late_ms`), as where its delay is not known. A seed gives the set.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.gaze_detectors.sets import Labelling, Labels, labelling_of
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.lab.geometry import Vector, unit

FINE_HZ = 1000
SECONDS = 30.0
SWINGS_HZ, SWING_WEIGHTS = (0.37, 0.83, 1.31), (0.3, 0.4, 0.3)
SHARES = (1.0, 0.25, 0.1)
"""Of the head's speed about the vertical, how much it nods and rolls by."""
WIDEST_DEG = (20.0, 12.0)
"""Gaze stays within these of straight ahead, right and up."""


@dataclass(frozen=True)
class Wearing:
    """How somebody wears a headset: the head's fastest turn, noise (RMS from sample to sample),
    how late the eyes are paired with the head, the rate, the share of looks that pursue, and how
    much of the head's turn the eyes compensate.
    """

    head_deg_s: float
    noise_deg: float
    late_ms: float = 0.0
    rate_hz: float = 120.0
    pursuit_01: float = 0.0
    vor_gain: float = 1.0


@dataclass(frozen=True)
class WornRecording:
    """Stamps (n,), unit vectors in world and in the head (n, 3), and what every sample is of."""

    t_ns: np.ndarray
    in_world: Vector
    in_head: Vector
    truth: Labelling


def worn(wearing: Wearing, seed: int, seconds: float = SECONDS) -> WornRecording:
    """Make one recording."""
    rng = np.random.default_rng(seed)
    place, labels = _looks(rng, seconds, wearing.pursuit_01)
    fine_s = np.arange(len(labels)) / FINE_HZ
    head = _head(rng, fine_s, wearing.head_deg_s)
    place += (1 - wearing.vor_gain) * head[:, :2] * (-1, 1)  # a turn is to the left
    eye = _turned(_ray(place), head, back=True)
    # A sample of time t shows the eye as it was `late_ms` before, and bears the head of t.
    step = FINE_HZ / wearing.rate_hz
    late = round(wearing.late_ms * FINE_HZ / 1000)
    at = np.arange(max(late, 0), len(labels) + min(late, 0), step).astype(np.int64)
    in_head = eye[at - late]
    # Noise of σ right and up has an RMS from sample to sample of 2 σ.
    sigma = np.radians(wearing.noise_deg / 2)
    across = unit(np.cross(in_head, [0.0, 1.0, 0.0]))
    over = np.cross(across, in_head)
    jitter = rng.normal(0.0, sigma, (len(at), 2))
    in_head = unit(in_head + across * jitter[:, :1] + over * jitter[:, 1:])
    in_world = _turned(in_head, head[at], back=False)
    t_ns = np.rint(np.arange(len(at)) * 1e9 / wearing.rate_hz).astype(np.int64)
    return WornRecording(t_ns, in_world, in_head, labelling_of(labels[at - late]))


def worn_set(wearing: Wearing, people: int = 6) -> list[WornRecording]:
    """Make the recordings of some people, the same at every call."""
    return [worn(wearing, seed) for seed in range(people)]


def _looks(rng: np.random.Generator, seconds: float, pursuit_01: float) -> tuple[Vector, Labels]:
    """Return gaze in the room (n, 2) in degrees at `FINE_HZ`, and what it does."""
    places: list[Vector] = []
    labels: list[Labels] = []
    here = np.zeros(2)
    left = round(seconds * FINE_HZ)
    while left > 0:
        speed = np.zeros(2)
        if rng.uniform() < pursuit_01:
            n, kind = round(rng.uniform(0.5, 1.2) * FINE_HZ), Movement.PURSUIT
            # towards the middle, so that it stays in view
            towards = np.arctan2(-here[1], -here[0]) + rng.normal(0.0, 0.4)
            speed = rng.uniform(10.0, 25.0) * np.array([np.cos(towards), np.sin(towards)])
        else:
            n, kind = round((0.12 + rng.gamma(3.0, 0.07)) * FINE_HZ), Movement.FIXATION
        path = here + np.outer(np.arange(1, n + 1) / FINE_HZ, speed)
        target = rng.uniform(-1, 1, 2) * WIDEST_DEG
        while np.hypot(*(target - path[-1])) < 2.0:
            target = rng.uniform(-1, 1, 2) * WIDEST_DEG
        leap = target - path[-1]
        # The main sequence, and the course of least jerk.
        m = round((0.021 + 0.0022 * float(np.hypot(*leap))) * FINE_HZ)
        share = np.arange(1, m + 1) / m
        course = 10 * share**3 - 15 * share**4 + 6 * share**5
        places += [path, path[-1] + course[:, None] * leap]
        labels += [np.full(n, kind, np.int8), np.full(m, Movement.SACCADE, np.int8)]
        here, left = target, left - n - m
    return np.concatenate(places), np.concatenate(labels)


def _head(rng: np.random.Generator, t_s: Vector, fastest_deg_s: float) -> Vector:
    """Return the head's turn, nod and roll (n, 3) in degrees: sines that never meet again."""
    axes = []
    for share in SHARES:
        phases = rng.uniform(0, 2 * np.pi, len(SWINGS_HZ))
        swings = 2 * np.pi * np.array(SWINGS_HZ)
        weights = np.array(SWING_WEIGHTS) / swings
        axes.append(share * np.sin(np.outer(t_s, swings) + phases) @ weights)
    head: Vector = np.column_stack(axes) * fastest_deg_s
    return head


def _ray(place_deg: Vector) -> Vector:
    right, up = np.radians(place_deg).T
    ray: Vector = np.column_stack(
        [np.cos(up) * np.sin(right), np.sin(up), -np.cos(up) * np.cos(right)]
    )
    return ray


def _turned(ray: Vector, head_deg: Vector, *, back: bool) -> Vector:
    """Return rays by a head that rolls, nods, then turns; `back`: from the world into the head."""
    turn, nod, roll = np.radians(head_deg).T
    turned = ray.copy()
    # Each turns the second axis towards the first.
    steps = [(roll, 1, 0), (nod, 2, 1), (turn, 0, 2)]
    for angle, first, second in reversed(steps) if back else steps:
        c, s = np.cos(angle), np.sin(angle) * (-1 if back else 1)
        one, other = turned[:, first].copy(), turned[:, second].copy()
        turned[:, first], turned[:, second] = one * c + other * s, other * c - one * s
    return turned
