"""A camera of one kilogram, pulled to its target by a spring and pushed away from the subject.

The published system names no damping, so that it would swing for ever; here damping is critical, 2
√(k m). Every step is the exact solution for a target at rest, so a step may be cut anywhere: two
short ones end where the long one does.
"""

from dataclasses import dataclass

import numpy as np

from visavis.lab.compiled import compiled
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector

_NOBODY_NEAR = np.full(3, np.inf)


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
    def omega_rad_s(self) -> float:
        """The stiffness of the spring between camera and target, per mass."""
        return float(np.sqrt(self.stiffness_n_m / self.mass_kg))


@compiled
def pull(
    place: Vector, velocity: Vector, target: Vector, dt_s: float, omega_rad_s: float
) -> tuple[Vector, Vector]:
    """Return place and velocity (3,) after a critically damped pull to a target at rest.

    What `Spring` gives with a damping ratio of 1, at a fraction of its cost.
    """
    # Closed form of x'' = −2 ω x' − ω² x: any step gives what many small ones do, so that films of
    # different rates agree.
    off = place - target
    drift = velocity + omega_rad_s * off
    decay = np.exp(-omega_rad_s * dt_s)
    return (
        target + decay * (off + dt_s * drift),
        decay * (velocity - omega_rad_s * dt_s * drift),
    )


@compiled
def _drive(
    place: Vector,
    velocity: Vector,
    target: Vector,
    subject: Vector,
    dt_s: float,
    omega_rad_s: float,
    push_per_pull: float,
    keep_off_m: float,
    max_speed_mps: float,
) -> tuple[Vector, Vector]:
    away = place - subject
    distance = np.sqrt((away * away).sum())
    goal = target.copy()
    if 0.0 < distance < keep_off_m:
        # The push away is written as a shift of the target, so that one closed solution serves
        # both.
        goal += push_per_pull * (keep_off_m - distance) / distance * away
    there, speed = pull(place, velocity, goal, dt_s, omega_rad_s)
    step = there - place
    length, longest = np.sqrt((step * step).sum()), max_speed_mps * dt_s
    if length > longest:
        there = place + step * (longest / length)
    fast = np.sqrt((speed * speed).sum())
    if fast > max_speed_mps:
        speed = speed * (max_speed_mps / fast)
    return there, speed


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
    state: tuple[Vector, Vector] = _drive(
        position_m,
        velocity_mps,
        target_m,
        _NOBODY_NEAR if subject_m is None else subject_m,
        dt_s,
        drive.omega_rad_s,
        drive.repulsion_n_m / drive.stiffness_n_m,
        drive.keep_off_m,
        drive.max_speed_mps,
    )
    return state
