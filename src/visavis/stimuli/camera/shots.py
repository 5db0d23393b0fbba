"""Measures of film editing: size of a shot, angle and motion across a cut, length of shots.

Everything is seen from the subject: the angle between two cameras stands at the subject, image
velocity is the subject's own as a level camera shows it that looks at the subject.
"""

from dataclasses import dataclass
from enum import StrEnum
from statistics import NormalDist
from typing import Protocol

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector


class ShotSize(StrEnum):
    """How large a person stands in the picture."""

    EXTREME_LONG = "extreme-long"
    LONG = "long"
    FULL = "full"
    MEDIUM = "medium"
    CLOSE = "close"


HEIGHT_SHARE = {
    ShotSize.EXTREME_LONG: 0.2,
    ShotSize.LONG: 0.5,
    ShotSize.FULL: 0.8,
    ShotSize.MEDIUM: 1.1,
    ShotSize.CLOSE: 2.5,
}
"""Height of the person as a share of the picture's; above 1 the picture holds a part of them."""


def shot_distance_m(subject_m: float, fov_v_deg: float, height_share: float) -> float:
    """Return from how far away a subject fills a share of the picture's height.

    Raises:
        DesignError: no such distance: lengths and shares must be above 0, the field of view
            between 0 and 180 degrees.
    """
    if not (subject_m > 0 and height_share > 0 and 0 < fov_v_deg < 180):
        raise DesignError(
            f"no shot shows {subject_m} m as {height_share} of a picture of {fov_v_deg} degrees; "
            f"give a height and a share above 0 and a field of view between 0 and 180 degrees"
        )
    return float(subject_m / (2 * height_share * np.tan(np.radians(fov_v_deg) / 2)))


@compiled
def shot_size_score(distance_m: float, wanted_m: float) -> float:
    """Return 1 at the wanted distance, falling to 0 with the relative error squared."""
    error = (distance_m - wanted_m) / wanted_m
    return float(np.exp(-error * error))


@compiled
def view_angle_deg(subject: Vector, before: Vector, after: Vector) -> float:
    """Return the angle (degrees) at a subject (3,) between two cameras (3,); NaN at the subject."""
    ax, ay, az = before[0] - subject[0], before[1] - subject[1], before[2] - subject[2]
    bx, by, bz = after[0] - subject[0], after[1] - subject[1], after[2] - subject[2]
    # By sine and cosine: an arc cosine alone loses small angles to rounding.
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    if (ax == ay == az == 0.0) or (bx == by == bz == 0.0):
        return np.nan
    across = np.sqrt(x * x + y * y + z * z)
    return float(np.degrees(np.arctan2(across, ax * bx + ay * by + az * bz)))


@compiled
def image_velocity(subject: Vector, velocity: Vector, camera: Vector) -> tuple[float, float]:
    """Return a subject's velocity to the right and up (m/s) in a level camera that looks at it.

    Arrays are (3,) in world. Where the camera stands straight above or below, or at the subject,
    no direction is level and both are NaN.
    """
    x, y, z = subject[0] - camera[0], subject[1] - camera[1], subject[2] - camera[2]
    flat, length = np.hypot(x, z), np.sqrt(x * x + y * y + z * z)
    if flat == 0.0:
        return np.nan, np.nan
    right = (-z * velocity[0] + x * velocity[2]) / flat
    along = (x * velocity[0] + z * velocity[2]) / flat
    return right, (flat * velocity[1] - y * along) / length


@compiled
def flow_cosine(subject: Vector, velocity: Vector, before: Vector, after: Vector) -> float:
    """Return the cosine between a subject's image velocities before and after a cut.

    NaN where nothing moves in either picture.
    """
    ax, ay = image_velocity(subject, velocity, before)
    bx, by = image_velocity(subject, velocity, after)
    length = np.hypot(ax, ay) * np.hypot(bx, by)
    if not length > 0.0:
        return np.nan
    return float((ax * bx + ay * by) / length)


@compiled
def on_same_side(subject: Vector, velocity: Vector, before: Vector, after: Vector) -> bool:
    """Tell whether a cut stays on one side of the line along which the subject moves."""
    a = velocity[2] * (before[0] - subject[0]) - velocity[0] * (before[2] - subject[2])
    b = velocity[2] * (after[0] - subject[0]) - velocity[0] * (after[2] - subject[2])
    return bool(a * b > 0.0)


class ShotLengths(Protocol):
    """How long shots last."""

    def draw_s(self, rng: np.random.Generator) -> float:
        """Draw the length of the next shot."""


@dataclass(frozen=True)
class LogNormalLengths:
    """Shot lengths as films have them: their logarithm is normal, `sigma` its spread."""

    median_s: float = 6.0
    sigma: float = 0.5

    def __post_init__(self) -> None:
        if not (self.median_s > 0 and self.sigma >= 0):
            raise DesignError(
                f"shots of median {self.median_s} s and sigma {self.sigma}; the median must be "
                f"above 0, sigma at least 0"
            )

    @property
    def mean_s(self) -> float:
        """The mean length, above the median as some shots are long."""
        return float(self.median_s * np.exp(self.sigma**2 / 2))

    def quantile_s(self, share: float) -> float:
        """Return the length that a share (above 0, below 1) of all shots does not exceed."""
        return float(self.median_s * np.exp(self.sigma * NormalDist().inv_cdf(share)))

    def draw_s(self, rng: np.random.Generator) -> float:
        """Draw the length of the next shot."""
        return float(self.median_s * np.exp(self.sigma * rng.standard_normal()))
