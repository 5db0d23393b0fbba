"""Turn volumes over time into collisions."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.analysis.collisions.errors import MalformedSeries
from visavis.analysis.collisions.volume import Rule
from visavis.lab.geometry import Vector

THRESHOLD_M3 = 1e-6
"""A larger common volume is contact (Berton et al. 2020)."""
MIN_DURATION_NS = 10_000_000
"""A collision lasts longer than this (Berton et al. 2020)."""


@dataclass(frozen=True)
class Collision:
    """One participant-character pair from the first step in contact to the last.

    `start_ns`, `end_ns` are the times of these steps, so a single step lasts 0; `peak_ns` is when
    `max_volume_m3` was reached (the first time). `counted` tells whether it lasted longer than the
    minimum. `cut` tells that the step before or after it was not measured (lost tracking, or the
    end of the series), so the true duration is unknown. `rule` is how volumes were measured.
    """

    character: int
    start_ns: int
    end_ns: int
    n_steps: int
    peak_ns: int
    max_volume_m3: float
    counted: bool
    cut: bool
    rule: Rule

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last step in contact."""
        return (self.end_ns - self.start_ns) / 1e9


def find_collisions(
    t_ns: npt.NDArray[np.int64],
    volumes_m3: Vector,
    rule: Rule,
    *,
    threshold_m3: float = THRESHOLD_M3,
    min_duration_ns: int = MIN_DURATION_NS,
) -> tuple[Collision, ...]:
    """Find every run of steps with a volume above the threshold, in order of their start.

    `t_ns` (n,) rising, `volumes_m3` (n, characters). NaN means not measured: it ends a run and
    marks it as cut, and no contact is invented for it. Raises MalformedSeries.
    """
    volumes = np.asarray(volumes_m3, float)
    if volumes.ndim != 2 or t_ns.shape != volumes.shape[:1]:
        raise MalformedSeries(
            f"{t_ns.shape} times do not fit volumes of shape {volumes.shape}; "
            "give (n,) and (n, characters)"
        )
    if (back := np.flatnonzero(np.diff(t_ns) <= 0)).size:
        row = int(back[0]) + 1
        raise MalformedSeries(f"time does not rise at row {row}; sort the steps, drop repeats")
    if (volumes < 0).any() or np.isinf(volumes).any():
        row, character = np.argwhere((volumes < 0) | np.isinf(volumes))[0]
        raise MalformedSeries(f"row {row}, character {character}: no volume; measure it again")
    collisions = []
    n = len(t_ns)
    for character in range(volumes.shape[1]):
        column = volumes[:, character]
        contact = np.concatenate([[False], column > threshold_m3, [False]])
        edges = np.flatnonzero(contact[1:] != contact[:-1])
        for start, past in edges.reshape(-1, 2):
            before_known = start > 0 and not np.isnan(column[start - 1])
            after_known = past < n and not np.isnan(column[past])
            peak = int(start + np.argmax(column[start:past]))
            duration = int(t_ns[past - 1] - t_ns[start])
            collisions.append(
                Collision(
                    character=character,
                    start_ns=int(t_ns[start]),
                    end_ns=int(t_ns[past - 1]),
                    n_steps=int(past - start),
                    peak_ns=int(t_ns[peak]),
                    max_volume_m3=float(column[peak]),
                    counted=duration > min_duration_ns,
                    cut=not (before_known and after_known),
                    rule=rule,
                )
            )
    return tuple(sorted(collisions, key=lambda c: (c.start_ns, c.character)))


def speed_at(t_ns: npt.NDArray[np.int64], position_m: Vector, at_ns: int) -> float:
    """Return the speed at a time in m/s, between the samples around it; NaN where one is lost.

    `position_m` (n, 2 or 3). Use it with a collision's `start_ns` for the speed at contact.
    """
    i = int(np.searchsorted(t_ns, at_ns, side="right"))
    if i == 0 or (i == len(t_ns) and at_ns > t_ns[-1]):
        return float("nan")
    i = min(i, len(t_ns) - 1)
    if i == 0:
        return float("nan")
    distance_m = np.linalg.norm(position_m[i] - position_m[i - 1])
    return float(distance_m / ((t_ns[i] - t_ns[i - 1]) / 1e9))


def nearest_part(
    point_m: Vector, starts_m: Vector, ends_m: Vector, radii_m: Vector
) -> tuple[int, float]:
    """Return the capsule (index into n) whose surface is nearest to a point, and how far.

    `starts_m`, `ends_m` (n, 3), `radii_m` (n,); the distance is negative inside. With the centre
    of a common volume it tells the body part in collision.
    """
    along = ends_m - starts_m
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    share = np.clip(np.einsum("ij,ij->i", point_m - starts_m, along) / square, 0, 1)
    distance = np.linalg.norm(point_m - starts_m - share[:, None] * along, axis=1) - radii_m
    best = int(np.argmin(distance))
    return best, float(distance[best])
