"""A camera of one kilogram, drawn to its target by a spring, kept off the subject, never jerked.

The published system names no damping and would swing for ever; here it is critical, 2 √(k m).
Every step is the exact solution for a target at rest, so a step may be cut anywhere: two short
ones end where the long one does.
"""

from dataclasses import dataclass

import numpy as np

from lab.errors import DesignError
from lab.geometry import Vector
from stimuli.motion.spring import Spring


@dataclass(frozen=True)
class Drive:
    """The forces on a camera.

    `stiffness_n_m` draws it to its target. Nearer to the subject than `keep_off_m` it is pushed
    away by `repulsion_n_m` times what is lacking. It never moves faster than `max_speed_mps`.
    """

    stiffness_n_m: float = 6.0
    mass_kg: float = 1.0
    repulsion_n_m: float = 12.0
    keep_off_m: float = 0.8
    max_speed_mps: float = 4.0

    def __post_init__(self) -> None:
        above = (self.stiffness_n_m, self.mass_kg, self.max_speed_mps)
        if not (min(above) > 0 and self.repulsion_n_m >= 0 and self.keep_off_m >= 0):
            raise DesignError(
                f"a camera cannot be driven by {self}; stiffness, mass and speed must be above 0, "
                f"repulsion and distance at least 0"
            )

    @property
    def spring(self) -> Spring:
        """The critically damped spring between camera and target."""
        return Spring(float(np.sqrt(self.stiffness_n_m / self.mass_kg)), 1.0, 1.0)


def follow(
    position_m: Vector,
    velocity_mps: Vector,
    target_m: Vector,
    dt_s: float,
    drive: Drive,
    subject_m: Vector | None = None,
) -> tuple[Vector, Vector]:
    """Return where a camera is (3,) and how fast (3,) after `dt_s` of being drawn to a target.

    Target and subject stand still meanwhile; the push away from the subject is that of the start.
    """
    goal = target_m
    if subject_m is not None:
        away = position_m - subject_m
        distance = float(np.linalg.norm(away))
        if 0.0 < distance < drive.keep_off_m:
            push_n = drive.repulsion_n_m * (drive.keep_off_m - distance)
            goal = goal + push_n / drive.stiffness_n_m * away / distance
    offset, velocity = drive.spring.at(dt_s, position_m - goal, velocity_mps)
    step = goal + offset - position_m
    length, longest = float(np.linalg.norm(step)), drive.max_speed_mps * dt_s
    if length > longest:
        step = step * (longest / length)
    speed = float(np.linalg.norm(velocity))
    if speed > drive.max_speed_mps:
        velocity = velocity * (drive.max_speed_mps / speed)
    return position_m + step, velocity
