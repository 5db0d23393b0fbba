"""A damped spring that brings a motion to its end pose, in closed form."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError


@dataclass(frozen=True)
class Spring:
    """x'' + 2 zeta omega x' + omega² x = 0: `omega_rad_s` stiffness, `zeta` damping ratio.

    `time_scale` multiplies the time before anything else; velocities are per scaled second. The
    defaults are the published crouch (overshoot 4.60 %, at rest after a second).
    """

    omega_rad_s: float = 10.0
    zeta: float = 0.7
    time_scale: float = 0.7

    def __post_init__(self) -> None:
        if not (self.omega_rad_s > 0 and self.zeta >= 0 and self.time_scale > 0):
            raise MotionError(
                f"spring with omega {self.omega_rad_s}, zeta {self.zeta}, time scale "
                f"{self.time_scale}; omega and time scale must be above 0, zeta at least 0"
            )

    def at(
        self, t_s: npt.ArrayLike, x0: npt.ArrayLike = 1.0, v0: npt.ArrayLike = 0.0
    ) -> tuple[Vector, Vector]:
        """Return position and velocity t_s >= 0 after position x0 with velocity v0.

        Exact for any step, so stepping at 30 or 90 Hz ends at the same place.
        """
        t = np.asarray(t_s, dtype=np.float64) * self.time_scale
        x, v = np.asarray(x0, dtype=np.float64), np.asarray(v0, dtype=np.float64)
        w, z = self.omega_rad_s, self.zeta
        if z < 1.0:
            alpha = w * np.sqrt(1.0 - z * z)
            decay = np.exp(-z * w * t)
            cosine, sine = decay * np.cos(alpha * t), decay * t * np.sinc(alpha * t / np.pi)
        else:
            # Both exponents are at most zero, so large times cannot overflow.
            beta = w * np.sqrt(z * z - 1.0)
            slow = w / (z + np.sqrt(z * z - 1.0))
            decay, rest = np.exp(-slow * t), np.expm1(-2 * beta * t)
            cosine = decay * (1.0 + rest / 2)
            sine = decay * (t if beta == 0.0 else -rest / (2 * beta))
        here = x * cosine + (v + z * w * x) * sine
        speed = v * cosine - (w * w * x + z * w * v) * sine
        return here, speed
