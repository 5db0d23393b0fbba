"""A damped spring that brings a motion to its end pose, in closed form."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError


@compiled
def spring_rows(
    t: Vector, x0: Vector, v0: Vector, w: float, z: float, here: Vector, speed: Vector
) -> None:
    """Write where springs are and how fast at times (n,); x0 and v0 are (n,) or (1,) for all."""
    # Below critical damping the frequency of the swing, beyond it half what the exponents differ.
    own = w * math.sqrt(abs(1.0 - z * z))
    for r in range(t.shape[0]):
        x, v = x0[r % x0.shape[0]], v0[r % v0.shape[0]]
        if z < 1.0:
            decay = math.exp(-z * w * t[r])
            cosine, sine = decay * math.cos(own * t[r]), decay * math.sin(own * t[r]) / own
        else:
            # Both exponents are at most zero, so large times cannot overflow.
            slow = w / (z + math.sqrt(z * z - 1.0))
            decay, rest = math.exp(-slow * t[r]), math.expm1(-2 * own * t[r])
            cosine = decay * (1.0 + rest / 2)
            sine = decay * (t[r] if own == 0.0 else -rest / (2 * own))
        here[r] = x * cosine + (v + z * w * x) * sine
        speed[r] = v * cosine - (w * w * x + z * w * v) * sine


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
        t, x, v = (np.asarray(values, dtype=np.float64) for values in (t_s, x0, v0))
        if not (x.ndim == 0 and v.ndim == 0):
            t, x, v = np.broadcast_arrays(t, x, v)
        here, speed = np.empty(t.shape), np.empty(t.shape)
        spring_rows(
            np.ravel(t) * self.time_scale,
            np.ravel(x),
            np.ravel(v),
            self.omega_rad_s,
            self.zeta,
            here.reshape(-1),
            speed.reshape(-1),
        )
        return here[()], speed[()]
